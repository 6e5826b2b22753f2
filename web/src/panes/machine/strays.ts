import type { Event, Slot } from "../../protocol/messages";
import { addressWords } from "../../protocol/text";
import type { State } from "../../store/state";
import { inNeed } from "../slots/reducer";
import type { WorldState } from "../world/reducer";
import type { FoundDevice } from "./reducer";

/** A device's key in the window: two buses may have a device of one LSS address. */
export const deviceKey = ({ bus, address }: Pick<FoundDevice, "bus" | "address">): string => `${bus}/${address}`;

/** "1h / 3h, serial number 31h" */
export function deviceName({ address }: Pick<FoundDevice, "address">): string {
  const { type, serial } = addressWords(address);
  return `${type}, serial number ${serial}`;
}

const why: Record<string, string> = {
  surplus: "every slot of its type has its device",
  foreign: "no slot takes its type",
  clone: "two devices have its LSS address",
  "wrong revision": "no free slot takes its revision",
  "fixed mismatch": "its node-ID is not its slot's",
  misplaced: "it sits in another slot's place",
  returned: "its slot has another device",
};

/** Why it has no slot, in a few words; of one about which Berth asks, that it asks. */
export const whyWords = ({ says }: FoundDevice): string =>
  says ? (why[says.kind] ?? says.kind) : "Berth asks where it belongs";

/** The open question that a device is among. */
export const questionAbout = (device: FoundDevice, open: readonly Event[]): Event | undefined =>
  open.find(
    (event) => event.bus === device.bus && event.devices?.some((each) => each.toUpperCase() === device.address),
  );

/** The plant, asked after Berth heard it last, says that it is not plugged in or has no power. */
export function isGone(device: FoundDevice, world: WorldState): boolean {
  const there = world.devices.find((each) => each.bus === device.bus && each.address === device.address);
  return there !== undefined && !(there.plugged && there.powered) && world.toldS > device.toldS;
}

/** Frames come many times a second: what does not rest on them is found anew only when one of its parts is another. */
function remembered<T>(partsOf: (state: State) => readonly unknown[], make: (state: State) => T): (state: State) => T {
  let last: { parts: readonly unknown[]; value: T } | null = null;
  return (state) => {
    const parts = partsOf(state);
    const same = last?.parts.every((part, i) => part === parts[i]);
    last = same && last ? last : { parts, value: make(state) };
    return last.value;
  };
}

/** Devices on the buses that have no slot, as far as is known. */
export const withoutSlot = remembered(
  ({ machine, world }) => [machine.found, machine.hidden, world],
  ({ machine, world }) =>
    machine.found.filter(
      (device) => !device.slot && !machine.hidden.includes(deviceKey(device)) && !isGone(device, world),
    ),
);

/** Those of them that Berth has said something about: it does not just look for their place. */
export const straysOf = remembered(
  (state) => [withoutSlot(state), state.data.questions],
  (state) => withoutSlot(state).filter((device) => device.says !== null || questionAbout(device, state.data.questions)),
);

export type Needy = { slot: Slot; device?: undefined } | { slot?: undefined; device: FoundDevice };

/** What needs somebody: slots, then devices without one. A question is its slots'. */
export const inNeedOf = remembered(
  (state) => [state.data.slots, straysOf(state)],
  (state): Needy[] => [
    ...inNeed(state.data.slots).map((slot) => ({ slot })),
    ...straysOf(state)
      .filter((device) => device.says !== null)
      .map((device) => ({ device })),
  ],
);

/** Slots whose place a device can take by `replace`: those of its type. */
export function placesOf(device: FoundDevice, slots: readonly Slot[]): Slot[] {
  const type = `0x${device.address.replace(/-/g, "").slice(0, 16)}`.toLowerCase();
  return slots.filter((slot) => slot.bus === device.bus && slot.type?.toLowerCase() === type);
}

/** What a slot says in the machine file to take this type, too. */
export function alsoLine(address: string): string {
  const [vendor, product, revision] = address.split("-").map((word) => `0x${word}`);
  return `also = [{ vendor = ${vendor}, product = ${product}, revision = ${revision} }]`;
}
