import { useEffect, useRef } from "react";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { visible } from "../../protocol/text";
import { isHeard } from "../../store/beneath";
import { useData } from "../../window/context";

/** Load of each bus over the last minute. */
export function LoadPlot({ width }: { width: number }) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const [loads, buses] = useData((state) => [state.loads, state.data.buses] as const);
  const heard = buses.filter(isHeard);
  const names = heard.map((bus) => bus.name).join("\n");
  const at = buses.flatMap((bus, i) => (isHeard(bus) ? [i] : [])).join(" ");
  const there = loads.length > 1;
  useEffect(() => {
    if (!box.current || !there) return;
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const axis = { stroke: colour("--quiet"), grid: { stroke: colour("--line"), width: 1 }, font: "11px sans-serif" };
    const lines = ["--good", "--busy", "--question", "--bad"];
    plot.current = new uPlot(
      {
        width,
        height: 118,
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false, range: [-60, 0] }, y: { range: [0, 100] } },
        axes: [
          { ...axis, size: 30, values: (_, ticks) => ticks.map((t) => `${t} s`) },
          { ...axis, size: 56, values: (_, ticks) => ticks.map((t) => `${t} %`) },
        ],
        series: [
          {},
          ...names.split("\n").map((label, i) => ({ label, stroke: colour(lines[i % 4] ?? ""), width: 1.5 })),
        ],
      },
      [],
      box.current,
    );
    return () => plot.current?.destroy();
  }, [width, names, there]);
  useEffect(() => {
    const last = loads[loads.length - 1]?.at ?? 0;
    const lines = at.split(" ").map((i) => loads.map((point) => (point.loads[Number(i)] ?? 0) * 100));
    plot.current?.setData([loads.map((point) => point.at - last), ...lines]);
  }, [loads, names, at]);
  if (!there) return null;
  return (
    <section className="load-plot">
      <h2>
        Load <span className="quiet">{heard.map((bus) => visible(bus.name)).join(", ")}, last minute</span>
      </h2>
      <div ref={box} />
    </section>
  );
}
