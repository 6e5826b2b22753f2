import type { Emcy, Event, Reply, Slot } from "../../protocol/messages";
import { LSS_ADDRESS, typeWords } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import type { Action, State } from "../../store/state";

export interface SlotsState {
  sort: { id: string; desc: boolean }[];
  /** The slot whose replacement is being followed, and when it was asked for. */
  replacing: { slot: string; atS: number } | null;
}

export type SlotsAction =
  { type: "slots/sort"; sort: SlotsState["sort"] } | { type: "slots/replacing"; replacing: SlotsState["replacing"] };

export const firstSlots: SlotsState = { sort: [{ id: "state", desc: false }], replacing: null };

export function slotsReducer(state: SlotsState, action: Action, { requests }: Pick<State, "requests">): SlotsState {
  if (action.type === "slots/sort") return { ...state, sort: action.sort };
  if (action.type === "slots/replacing") return { ...state, replacing: action.replacing };
  if (action.type === "message" && action.message.type === "reply") return withReply(state, action.message, requests);
  return state;
}

/** A replacement that Berth refused (2: it is not possible) is not followed. */
function withReply(state: SlotsState, { id, status }: Reply, requests: State["requests"]): SlotsState {
  const sent = requests.find((entry) => entry.id === id);
  const refused = sent?.verb === "replace" && status === 2 && sent.owner === `slots:${state.replacing?.slot ?? ""}`;
  return refused ? { ...state, replacing: null } : state;
}

/** What is wrong with a slot, what to do, and the act that does it. */
export interface Need {
  what: string;
  todo: string;
  act: "replace" | "answer" | "boot" | null;
}

/** "2310h ×3". */
export function emcyWords(emcy: Emcy | undefined): string {
  if (!emcy) return "";
  return emcy.code.replace(/^0x/, "") + "h" + (emcy.count > 1 ? ` ×${emcy.count}` : "");
}

/** docs/boot-up.md, in words for the floor. */
export const bootLetters: Record<string, string> = {
  B: "It does not answer. Switch it on, or replace it.",
  C: "Its device type (1000h) is not the one of this slot. Put in the right device.",
  D: "Another type of device answers here. Put in the right device.",
  G: "Its software is not known. Check the program's file.",
  H: "It has other software than the slot wants. Update its program.",
  I: "The download of its program failed. Try it again.",
  J: "Its configuration failed. The reason names the object.",
  K: "It was started, and no heartbeat reported that it is operational. Check the device.",
  L: "It was operational already when Berth started.",
  M: "Another product answers here. Put in the right device.",
  N: "The same type with another revision or serial number sits here.",
  O: "A device with another serial number sits here. Confirm the replacement.",
};

/** How the boot-up of a slot's device ended; empty: nothing is known of it, or nothing is wrong. */
export function bootWords(slot: Slot): string {
  // Its letter is that of a device that is gone.
  if (slot.state === "empty") return `No device: plug one in of ${typeNamed(slot)}.`;
  return slot.boot ? `${slot.boot}: ${bootLetters[slot.boot] ?? ""}` : "";
}

function typeNamed(slot: Slot): string {
  const type = typeWords(slot.type);
  return `the slot's type${type && `, ${type}`}`;
}

export function needOf(slot: Slot): Need | null {
  const letter = slot.boot ? bootLetters[slot.boot] : undefined;
  switch (slot.state) {
    case "absent":
      return {
        what: "The device does not answer.",
        todo: "Switch it on and check its cable. If it is broken, replace it.",
        act: "replace",
      };
    case "empty":
      return { what: "This slot has no device.", todo: `Plug in a device of ${typeNamed(slot)}.`, act: null };
    case "question":
      return {
        what: "Berth cannot decide which device belongs here.",
        todo: "Let the devices show themselves with Locate, then choose one.",
        act: "answer",
      };
    case "failed":
      return {
        what: "The device could not be started.",
        todo: letter ?? "Read the reason below. If the device is broken, replace it.",
        act: "replace",
      };
    case "duplicate":
      return {
        what: "Two devices have this node-ID.",
        todo: "Switch off the one that does not belong here.",
        act: null,
      };
    case "wrong type":
      return {
        what: "A device of another type sits here.",
        todo: letter ?? "Put in a device of the slot's type.",
        act: "replace",
      };
    case "power cycle needed":
      return {
        what: "The new configuration works only after power off and on.",
        todo: "Switch the device off and on again.",
        act: null,
      };
    default:
      return null;
  }
}

export function inNeed(slots: readonly Slot[]): Slot[] {
  return slots.filter((slot) => needOf(slot) !== null);
}

/** The open question about a slot. Berth takes the answer as `replace SLOT --device ADDRESS`. */
export function questionOf(slot: Slot, open: readonly Event[]): Event | null {
  return open.find((event) => event.bus === slot.bus && event.slots?.includes(slot.name)) ?? null;
}

/** Its device stays pre-operational until it has saved its parameters once and was reset: that was offered. */
export function savesFirst(slot: Slot, events: readonly Event[]): boolean {
  const mine = events.filter((event) => event.bus === slot.bus);
  const offered = mine.findLastIndex((event) => event.offers_save === true && event.slots?.includes(slot.name));
  if (offered < 0 || slot.state === "operational") return false;
  return !mine.slice(offered).some((event) => event.slot === slot.name && event.text === "operational");
}

/** Devices of this slot that were to give up their node-ID and did not come back: they can be forgotten. */
export function forgettable(slot: Slot, events: readonly Event[]): string[] {
  const mine = events.filter((event) => event.bus === slot.bus && event.slot === slot.name);
  const open = new Set<string>();
  for (const event of mine) {
    const address = event.devices?.[0] ?? LSS_ADDRESS.exec(event.text)?.[0];
    if (!address) continue;
    if (event.kind === "unfinished") open.add(address);
    if (event.kind === "forgotten") open.delete(address);
  }
  return [...open];
}

export function eventsOf(slot: Slot, events: readonly Event[]): Event[] {
  return events.filter((event) => {
    const named = event.slot === slot.name || (event.slots?.includes(slot.name) ?? false);
    return event.bus === slot.bus && named;
  });
}

export type Progress = "done" | "now" | "later";

/** The fitter's three steps, read from what happened since the replacement was asked for. */
export function replacementSteps(
  slot: Slot,
  events: readonly Event[],
  sinceS: number,
): { text: string; at: Progress }[] {
  const since = eventsOf(slot, events).filter((event) => event.at_s >= sinceS);
  const bound = since.some((event) => event.kind === "bound");
  const running = bound && slot.state === "operational";
  const configured = running || since.some((event) => event.kind === "configured");
  const texts = [
    { text: "Unplug the old device and plug in the spare", done: bound },
    { text: `Spare is known as ${slot.name}, node-ID ${slot.id}`, done: bound },
    { text: "Its settings are written", done: configured },
    { text: "It runs", done: running },
  ];
  const current = texts.findIndex((step) => !step.done);
  return texts.map((step, i) => ({ text: step.text, at: step.done ? "done" : i === current ? "now" : "later" }));
}

/** The spare ran, and does no longer: what is wrong now is another matter. */
export function isReplaced(slot: Slot, events: readonly Event[], sinceS: number): boolean {
  const since = eventsOf(slot, events).filter((event) => event.at_s >= sinceS);
  const bound = since.findIndex((event) => event.kind === "bound");
  const ran = bound >= 0 && since.slice(bound).some((event) => event.text === "operational");
  return ran && slot.state !== "operational";
}

export function isSelected(slot: Slot, selected: string): boolean {
  return slotKey(slot) === selected;
}

/** The DCF in the answer of `upload`, or null. */
export function dcfOf(reply: unknown): Uint8Array<ArrayBuffer> | null {
  const text = typeof reply === "object" && reply !== null && "dcf" in reply ? reply.dcf : null;
  if (typeof text !== "string" || !/^([0-9a-f]{2}( |$))+$/i.test(text)) return null;
  return Uint8Array.from(text.split(" "), (byte) => parseInt(byte, 16));
}
