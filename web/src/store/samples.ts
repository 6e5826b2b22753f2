/** Small values for tests. */
import type { Batch } from "../protocol/batch";
import { bytesOf, emptyBatch, EXTENDED } from "../protocol/batch";
import type { Slot, Snapshot } from "../protocol/messages";

export const slot = (change: Partial<Slot> = {}): Slot => ({
  bus: "field",
  id: 10,
  name: "belt",
  type: "0x0000000100000010",
  r_sn: "0x0001000100000001",
  state: "operational",
  since_s: 1.278,
  ...change,
});

export const snapshot = (change: Partial<Snapshot> = {}): Snapshot => ({
  type: "snapshot",
  seq: 7,
  machine: { name: "belt", simulated: true, file: "belt.toml" },
  buses: [{ name: "field", bit_rate: 250000, port: "sim", role: "master", master_id: 127, beneath: null }],
  slots: [slot(), slot({ id: 11, name: "barrier" })],
  events: [],
  questions: [],
  time_s: 2,
  verbs: [],
  lock: { real: false, unlocked_until_s: null },
  role: "configure",
  ...change,
});

/** "701#05 601#4018100400000000": one frame a millisecond. */
export function batch(first: number, frames: string): Batch {
  const list = frames.split(/\s+/).filter(Boolean);
  const made = emptyBatch(first, list.length);
  list.forEach((text, i) => {
    const [id = "", data = ""] = text.split("#");
    const bytes = bytesOf(data);
    made.seconds[i] = (first + i) / 1000;
    made.ids[i] = parseInt(id, 16);
    made.flags[i] = id.length > 3 ? EXTENDED : 0;
    made.lengths[i] = bytes.length;
    made.data.set(bytes, i * 8);
  });
  return made;
}
