import type { PlantDevice } from "./reducer";

export interface WorldAct {
  label: string;
  verb: string;
  values: Record<string, string>;
}

export const timeActs: WorldAct[] = [
  { label: "▮▮ Pause", verb: "world pause", values: {} },
  { label: "▶ Run", verb: "world run", values: {} },
  { label: "▸ One frame", verb: "world step", values: {} },
  { label: "× 1", verb: "world speed", values: { factor: "1" } },
  { label: "× 10", verb: "world speed", values: { factor: "10" } },
];

const sim = (label: string, values: Record<string, string>): WorldAct => ({ label, verb: "sim", values });

const someFrames = (frames: string): string => (frames === "1" ? "the next frame" : `the next ${frames} frames`);

/** The next frames of a bus, or of one device, are damaged: receivers see an error, and they are repeated. */
export function damageAct(bus: string, frames: string, from = ""): WorldAct {
  const values = { bus, ...(frames === "1" ? {} : { frames }), ...(from ? { from } : {}) };
  return { label: `Damage ${someFrames(frames)} ${from ? "it sends" : `on ${bus}`}`, verb: "world damage", values };
}

export const plugAct = (word: string, plugged: boolean): WorldAct =>
  plugged ? sim("Unplug", { action: "unplug", device: word }) : sim("Plug in", { action: "plug", device: word });

/** These nodes and the rest of the bus no longer hear each other. */
export const cutAct = (label: string, bus: string, nodes: readonly string[]): WorldAct =>
  sim(label, { action: "cut-cable", nodes: nodes.join("\n"), bus });

/** Every cut of the bus is mended. */
export const mendAct = (bus: string): WorldAct => sim(`Mend the cable of ${bus}`, { action: "join", bus });

/** What a person can do to a device as it is. `word` names it; null: nothing is known of it but its slot. */
export function deviceActs(word: string, device: PlantDevice | null): WorldAct[] {
  const plugged = device?.plugged ?? true;
  const powered = plugged && (device?.powered ?? true);
  const acts = [plugAct(word, plugged)];
  if (!device) acts.push(plugAct(word, false));
  if (plugged && (powered || !device)) acts.push(sim("Power off", { action: "power-off", device: word }));
  if (plugged && (!powered || !device)) acts.push(sim("Power on", { action: "power-on", device: word }));
  if (!powered) return acts;
  acts.push(
    sim("Reset", { action: "reset", device: word }),
    sim("Deaf for 5 s", { action: "deaf", device: word, duration: "5 s" }),
    sim("Deaf", { action: "deaf", device: word }),
    sim("Slow by 50 ms", { action: "slow", device: word, latency: "50 ms" }),
  );
  if (!device || device.deaf || device.late > 0)
    acts.push(sim("Neither deaf nor slow", { action: "recover", device: word }));
  return acts;
}
