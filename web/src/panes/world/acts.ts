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

export function deviceActs(device: string): WorldAct[] {
  return [
    { label: "Unplug", verb: "sim unplug", values: { device } },
    { label: "Plug in", verb: "sim plug", values: { device } },
    { label: "Power off", verb: "sim power-off", values: { device } },
    { label: "Power on", verb: "sim power-on", values: { device } },
    { label: "Deaf for 5 s", verb: "sim deaf", values: { device, duration: "5 s" } },
    { label: "Slow by 50 ms", verb: "sim slow", values: { device, latency: "50 ms" } },
  ];
}
