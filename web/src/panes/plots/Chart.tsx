import { useEffect, useRef, useState } from "react";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { visible } from "../../protocol/text";
import { useData } from "../../window/context";
import type { Point } from "./reducer";

export interface Line {
  label: string;
  points: readonly Point[];
}

const colours = ["--busy", "--question", "--good", "--nmt"];
const dashes = [[], [8, 4], [2, 3], [10, 3, 2, 3]];

/** Colour and shape of a line: both differ from those of the line before. */
export function styleOf(i: number): { colour: string; dash: number[] } {
  return { colour: colours[(i + Math.floor(i / 4)) % 4] ?? "", dash: dashes[i % 4] ?? [] };
}

export function Swatch({ i }: { i: number }) {
  const { colour, dash } = styleOf(i);
  return (
    <svg className="swatch" width="30" height="10" aria-hidden="true">
      <line x1="0" y1="5" x2="30" y2="5" stroke={`var(${colour})`} strokeWidth="2" strokeDasharray={dash.join(" ")} />
    </svg>
  );
}

export function Legend({ lines }: { lines: readonly Line[] }) {
  return (
    <ul className="legend">
      {lines.map((line, i) => (
        <li key={line.label}>
          <Swatch i={i} /> {visible(line.label)}
          <span className="number quiet"> {lastOf(line)}</span>
        </li>
      ))}
    </ul>
  );
}

function lastOf({ points }: Line): string {
  const last = points[points.length - 1];
  return last ? String(Number(last[1].toFixed(2))) : "";
}

const HEIGHT = 150;

function aligned(lines: readonly Line[], now: number): uPlot.AlignedData {
  const tables = lines.map(({ points }): uPlot.AlignedData => [
    points.map(([at]) => at - now),
    points.map(([, value]) => value),
  ]);
  return tables.length ? uPlot.join(tables) : [[]];
}

interface ChartProps {
  title: string;
  unit: string;
  lines: readonly Line[];
  /** Seconds that are drawn. */
  span: number;
  /** Values that the axis has at least. */
  least?: readonly [number, number];
}

/** Lines over the last seconds. The legend is a list beside it, for those who see no colours, and for those who hear it. */
export function Chart({ title, unit, lines, span, least }: ChartProps) {
  const theme = useData((state) => state.window.theme);
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const [width, setWidth] = useState(0);
  useEffect(() => {
    if (!box.current) return;
    const observer = new ResizeObserver(([entry]) => entry && setWidth(Math.floor(entry.contentRect.width)));
    observer.observe(box.current);
    return () => observer.disconnect();
  }, []);
  const [low, high] = least ?? [Infinity, -Infinity];
  const shape = `${lines.length} ${unit} ${span} ${low} ${high}`;
  useEffect(() => {
    if (!box.current || width < 80) return;
    plot.current = new uPlot(optionsOf({ count: lines.length, unit, span, low, high, width }), [[]], box.current);
    plot.current.setData(dataOf(lines));
    return () => {
      plot.current?.destroy();
      plot.current = null;
    };
    // The lines themselves are given below: a new plot is made for another shape only.
    // eslint-disable-next-line react-hooks/exhaustive-deps
  }, [shape, width, theme]);
  useEffect(() => plot.current?.setData(dataOf(lines)), [lines]);
  return (
    <div className="chart">
      <div ref={box} style={{ minHeight: HEIGHT }} role="img" aria-label={`${title}, last ${span} s`} />
    </div>
  );
}

function dataOf(lines: readonly Line[]): uPlot.AlignedData {
  const now = lines.reduce((last, { points }) => Math.max(last, points[points.length - 1]?.[0] ?? 0), 0);
  return aligned(lines, now);
}

interface Shape {
  count: number;
  unit: string;
  span: number;
  low: number;
  high: number;
  width: number;
}

function optionsOf({ count, unit, span, low, high, width }: Shape): uPlot.Options {
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour("--quiet"), grid: { stroke: colour("--line"), width: 1 }, font: "11px sans-serif" };
  const range = (_: uPlot, min: number | null, max: number | null): [number, number] => {
    const from = Math.min(low, min ?? 0);
    const to = Math.max(high, max ?? 1);
    // What does not change is a line in the middle, and not its rounding errors.
    const room = Math.max((to - from) * 0.08, Math.abs(to) * 0.02, to === from ? 1 : 0);
    return [from === low ? from : from - room, to === high ? to : to + room];
  };
  return {
    width,
    height: HEIGHT,
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, range: [-span, 0] }, y: { range } },
    axes: [
      { ...axis, size: 30, values: (_, ticks) => ticks.map((t) => `${t} s`) },
      { ...axis, size: 64, values: (_, ticks) => ticks.map((t) => `${Number(t.toFixed(3))} ${unit}`.trim()) },
    ],
    series: [
      {},
      ...Array.from({ length: count }, (_, i) => {
        const { colour: name, dash } = styleOf(i);
        return { stroke: colour(name), dash, width: 1.5, spanGaps: true, points: { show: false } };
      }),
    ],
  };
}
