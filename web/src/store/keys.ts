/** A slot's key in the window: bus and node-ID, for names need not be unique over buses. */
export const slotKey = (slot: { bus: string; id: number }): string => `${slot.bus}/${slot.id}`;
