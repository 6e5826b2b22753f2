import { meaningOf } from "../../can/words";
import { frameOf, type Batch } from "../../protocol/batch";
import type { Event } from "../../protocol/messages";
import { LSS_ADDRESS } from "../../protocol/text";
import type { Action, State } from "../../store/state";

/** A device that discovery found; `slot` is its place once it is bound: "field/12". */
export interface FoundDevice {
  bus: string;
  address: string;
  slot: string;
}

export interface MachineState {
  found: readonly FoundDevice[];
  /** The last question of a search as it was on the bus, and how many there were. */
  question: { bus: string; text: string; n: number } | null;
}

export const firstMachine: MachineState = { found: [], question: null };

export function machineReducer(machine: MachineState, action: Action, state: State): MachineState {
  if (action.type === "batch") return withQuestion(machine, action.batch, state);
  if (action.type !== "message") return machine;
  const { message } = action;
  if (message.type === "snapshot") return { ...machine, found: withEvents([], message.events, state) };
  if (message.type !== "change" || !message.events?.length || state.connection.phase !== "open") return machine;
  const found = withEvents(machine.found, message.events, state);
  return found === machine.found ? machine : { ...machine, found };
}

function withEvents(before: readonly FoundDevice[], events: readonly Event[], state: State): readonly FoundDevice[] {
  let changed = false;
  const devices = new Map(before.map((device) => [`${device.bus} ${device.address}`, device]));
  for (const event of events) {
    if (event.kind !== "found" && event.kind !== "bound" && event.kind !== "new device") continue;
    const address = (LSS_ADDRESS.exec(event.text)?.[0] ?? "").toUpperCase();
    if (!address) continue;
    const key = `${event.bus} ${address}`;
    const slot = event.kind === "bound" ? keyOfName(event, state) : (devices.get(key)?.slot ?? "");
    // A slot has one device: the one that sat there before is gone.
    if (slot) for (const [other, device] of devices) if (device.slot === slot && other !== key) devices.delete(other);
    devices.set(key, { bus: event.bus, address, slot });
    changed = true;
  }
  return changed ? [...devices.values()] : before;
}

function keyOfName(event: Event, state: State): string {
  const slot = state.data.slots.find((entry) => entry.bus === event.bus && entry.name === event.slot);
  return slot ? `${slot.bus}/${slot.id}` : "";
}

function withQuestion(machine: MachineState, batch: Batch, state: State): MachineState {
  let { question } = machine;
  for (let i = 0; i < batch.count; i++) {
    const id = batch.ids[i] ?? 0;
    const kind = id >>> 18;
    if (id !== 0x7e5 && kind !== 0x7e5) continue;
    const frame = frameOf(batch, i);
    const meaning = meaningOf(frame.id, frame.extended, frame.remote, frame.data);
    if (meaning.service !== "RAND" && !/Fastscan|identify/.test(meaning.text)) continue;
    question = { bus: state.data.buses[frame.bus]?.name ?? "", text: meaning.text, n: (question?.n ?? 0) + 1 };
  }
  return question === machine.question ? machine : { ...machine, question };
}

/** A node of the tree of addresses: devices that share these first words of their LSS address. */
export interface AddressNode {
  word: string;
  count: number;
  bound: number;
  children: AddressNode[];
}

export function addressTree(found: readonly FoundDevice[]): AddressNode[] {
  const root: AddressNode = { word: "", count: 0, bound: 0, children: [] };
  for (const device of found) {
    let node = root;
    for (const word of device.address.split("-")) {
      let child = node.children.find((entry) => entry.word === word);
      if (!child) {
        child = { word, count: 0, bound: 0, children: [] };
        node.children.push(child);
      }
      child.count++;
      if (device.slot) child.bound++;
      node = child;
    }
  }
  return root.children;
}
