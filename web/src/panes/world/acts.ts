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

/** The next frame of a bus is damaged: receivers see an error, and it is repeated. */
export function busAct(bus: string): WorldAct {
  return { label: `Damage a frame on ${bus}`, verb: "world damage", values: { bus } };
}

export function deviceActs(device: string): WorldAct[] {
  return [
    { label: "Unplug", verb: "sim", values: { action: "unplug", device } },
    { label: "Plug in", verb: "sim", values: { action: "plug", device } },
    { label: "Power off", verb: "sim", values: { action: "power-off", device } },
    { label: "Power on", verb: "sim", values: { action: "power-on", device } },
    { label: "Deaf for 5 s", verb: "sim", values: { action: "deaf", device, duration: "5 s" } },
    { label: "Slow by 50 ms", verb: "sim", values: { action: "slow", device, latency: "50 ms" } },
  ];
}
