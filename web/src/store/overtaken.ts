import type { Slot } from "../protocol/messages";
import type { Sent } from "./state";

/** What came after an answer that said no. */
export interface Since {
  /** The slot; empty: all slots of the bus. */
  name: string;
  state: string;
  sinceS: number;
}

/** Wrong usage (2) stays wrong, whatever the devices do. */
const refused = (sent: Sent) => sent.done && (sent.status === 1 || sent.status === 3);
/** Without a slot's name these are about all slots of their bus. */
const ofTheBus = new Set(["bind", "configure"]);

/** What a refused or "not yet" answer no longer tells: its slot has got there since. Null: the answer stands. */
export function overtaken(sent: Sent, slots: readonly Slot[]): Since | null {
  if (!refused(sent)) return null;
  const { bus, slot, node, target } = sent.values;
  const name = slot ?? node ?? target ?? "";
  const mine = slots.filter((entry) => !bus || entry.bus === bus);
  if (name) {
    const named = mine.filter((entry) => entry.name === name || String(entry.id) === name);
    const only = named.length === 1 ? named[0] : undefined;
    return only && gotThere(only, sent) ? { name: only.name, state: only.state, sinceS: only.since_s } : null;
  }
  if (!ofTheBus.has(sent.verb) || !mine.every((entry) => entry.state === "operational")) return null;
  const last = Math.max(...mine.map((entry) => entry.since_s));
  return last > sent.answeredS ? { name: "", state: "operational", sinceS: last } : null;
}

/** `replace` said that no device came: then any device there is news. */
function gotThere(slot: Slot, { verb, answeredS }: Sent): boolean {
  const arrived = verb === "replace" && slot.r_sn !== null;
  return slot.since_s > answeredS && (arrived || slot.state === "operational");
}
