import { meaningOfFrame } from "../../can/words";
import { frameOf, type Batch } from "../../protocol/batch";
import type { Event } from "../../protocol/messages";
import { LSS_ADDRESS } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import type { Action, State } from "../../store/state";

/** A device that discovery found; `slot` is its place once it is bound: "field/12". */
export interface FoundDevice {
  bus: string;
  address: string;
  slot: string;
  /** When Berth told of it last. */
  toldS: number;
  /** Why it has no slot, and what to do, in Berth's words; null: Berth said nothing of the kind. */
  says: { kind: string; text: string } | null;
}

export interface MachineState {
  found: readonly FoundDevice[];
  /** Keys of devices without a slot that a person took off the bus. */
  hidden: readonly string[];
  /** The last question of a search as it was on the bus, and how many there were. */
  question: { bus: string; text: string; n: number } | null;
}

export type MachineAction = { type: "machine/hide"; key: string };

export const firstMachine: MachineState = { found: [], hidden: [], question: null };

export function machineReducer(machine: MachineState, action: Action, state: State): MachineState {
  if (action.type === "batch") return withQuestion(machine, action.batch, state);
  if (action.type === "machine/hide") return { ...machine, hidden: [...machine.hidden, action.key] };
  if (action.type !== "message") return machine;
  const { message } = action;
  if (message.type === "snapshot") return { ...machine, found: withEvents([], message.events, state) };
  if (message.type !== "change" || !message.events?.length || state.connection.phase !== "open") return machine;
  const found = withEvents(machine.found, message.events, state);
  if (found === machine.found) return machine;
  const before = new Set(machine.found);
  const fresh = new Set(found.filter((device) => !before.has(device)).map(({ bus, address }) => `${bus}/${address}`));
  return { ...machine, found, hidden: machine.hidden.filter((key) => !fresh.has(key)) };
}

/** A device found, with or without a place; then why one has none. */
const kinds = new Set(["found", "bound", "new device"]);
const odd = new Set(["surplus", "foreign", "clone", "wrong revision", "fixed mismatch", "misplaced", "returned"]);

function withEvents(before: readonly FoundDevice[], events: readonly Event[], state: State): readonly FoundDevice[] {
  let changed = false;
  const devices = new Map(before.map((device) => [`${device.bus} ${device.address}`, device]));
  for (const event of events) {
    if (!kinds.has(event.kind) && !odd.has(event.kind)) continue;
    const address = (LSS_ADDRESS.exec(event.text)?.[0] ?? "").toUpperCase();
    if (!address) continue;
    const key = `${event.bus} ${address}`;
    const old = devices.get(key);
    const slot = event.kind === "bound" ? keyOfName(event, state) : stillIn(old?.slot ?? "", address, state);
    const says = odd.has(event.kind) ? { kind: event.kind, text: event.text } : slot ? null : (old?.says ?? null);
    // A slot has one device: the one that sat there before is gone.
    if (slot) for (const [other, device] of devices) if (device.slot === slot && other !== key) devices.delete(other);
    devices.set(key, { bus: event.bus, address, slot, toldS: event.at_s, says });
    changed = true;
  }
  return changed ? [...devices.values()] : before;
}

/** The slot, unless it has no device now, or another one. */
function stillIn(key: string, address: string, state: State): string {
  const slot = state.data.slots.find((entry) => slotKey(entry) === key);
  const number = address.replace(/-/g, "").slice(16).toLowerCase();
  return slot?.r_sn?.slice(2).toLowerCase() === number ? key : "";
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
    const meaning = meaningOfFrame(frame);
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
