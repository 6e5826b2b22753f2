/** What was recorded of the examples by `berth up --record --json --events` and `berth trace --frames`. */
import { readFileSync } from "node:fs";
import { gunzipSync } from "node:zlib";

const file = (name) => readFileSync(new URL(`recorded/${name}`, import.meta.url));
const unpacked = (name) => JSON.parse(gunzipSync(file(name)).toString());

export const verbs = JSON.parse(file("verbs.json").toString());
export const dump = unpacked("dump.json.gz");

/** "0000000000.000506 field 7E5#0400000000000000 words" */
export function parseFrame(line) {
  const [time, bus, frame, ...words] = line.split(" ");
  const [id, data] = frame.split("#");
  const rtr = data.startsWith("R");
  return {
    t: Number(time),
    bus,
    id: parseInt(id, 16),
    ext: id.length > 3,
    rtr,
    data: rtr ? "" : data,
    dlc: rtr ? Number(data.slice(1)) || 0 : undefined,
    text: words.join(" "),
  };
}

export function recorded(name) {
  const { events, slots, frames } = unpacked(`${name}.json.gz`);
  return { events, slots, frames: frames.map(parseFrame) };
}
