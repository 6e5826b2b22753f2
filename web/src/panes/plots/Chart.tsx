import { useEffect, useLayoutEffect, useRef, useState, type MouseEvent } from "react";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { visible } from "../../protocol/text";
import { useData } from "../../window/context";
import type { Point } from "./reducer";

export interface Line {
  label: string;
  /** Which colour and shape (`styleOf`); else by its place. */
  style?: number;
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

/** A press as near as this to the mark means the mark: frames of the same pixel are not told apart otherwise. */
const MARK_PIXELS = 3;

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
  /** Seconds at the right edge; else the newest point's. */
  end?: number;
  /** Seconds of a line from top to bottom. */
  mark?: number | null;
  /** A value stands until the next. */
  steps?: boolean;
  /** A press into the plot: seconds, those of the mark where it was pressed. */
  onPick?: (seconds: number) => void;
}

/** Lines over the last seconds. The legend is a list beside it, for those who see no colours, and for those who hear it. */
export function Chart({ title, unit, lines, span, least, end, mark, steps = false, onPick }: ChartProps) {
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
  const styles = lines.map(({ style }, i) => style ?? i).join(",");
  const shape = `${styles} ${unit} ${span} ${low} ${high}`;
  // uPlot has its scales a microtask after it was made: before, nothing has a place in it.
  const [drawn, setDrawn] = useState(false);
  useEffect(() => {
    if (!box.current || width < 80) return;
    plot.current = new uPlot(optionsOf({ styles, steps, unit, span, low, high, width }), [[]], box.current);
    plot.current.setData(dataOf(lines, end));
    let here = true;
    queueMicrotask(() => here && setDrawn(true));
    return () => {
      here = false;
      setDrawn(false);
      plot.current?.destroy();
      plot.current = null;
    };
    // The lines themselves are given below: a new plot is made for another shape only.
    // eslint-disable-next-line react-hooks/exhaustive-deps
  }, [shape, width, theme]);
  useEffect(() => plot.current?.setData(dataOf(lines, end)), [lines, end]);
  const now = endOf(lines, end);
  const since = mark === null || mark === undefined ? null : mark - now;
  const pick = (event: MouseEvent<HTMLDivElement>) => {
    const over = plot.current?.over.getBoundingClientRect();
    if (!plot.current || !over || !onPick) return;
    const pressed = event.clientX - over.left;
    const marked = since !== null && Math.abs(plot.current.valToPos(since, "x") - pressed) <= MARK_PIXELS;
    onPick((marked ? since : plot.current.posToVal(pressed, "x")) + now);
  };
  const there = drawn && since !== null && since <= 0 && since >= -span;
  const line = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    if (!line.current || !plot.current || since === null) return;
    line.current.style.left = `${plot.current.over.offsetLeft + plot.current.valToPos(since, "x")}px`;
  });
  return (
    <div className={onPick ? "chart picks" : "chart"} onClick={onPick && pick}>
      <div ref={box} style={{ minHeight: HEIGHT }} role="img" aria-label={`${title}, last ${span} s`} />
      {there && <div className="chart-mark" ref={line} />}
    </div>
  );
}

const endOf = (lines: readonly Line[], end?: number): number =>
  end ?? lines.reduce((last, { points }) => Math.max(last, points[points.length - 1]?.[0] ?? 0), 0);

function dataOf(lines: readonly Line[], end?: number): uPlot.AlignedData {
  return aligned(lines, endOf(lines, end));
}

interface Shape {
  steps: boolean;
  /** "0,1,2": of each line. */
  styles: string;
  unit: string;
  span: number;
  low: number;
  high: number;
  width: number;
}

function optionsOf({ styles, steps, unit, span, low, high, width }: Shape): uPlot.Options {
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour("--quiet"), grid: { stroke: colour("--line"), width: 1 }, font: "11px sans-serif" };
  const stepped = steps ? uPlot.paths.stepped?.({ align: 1 }) : undefined;
  const paths = stepped ? { paths: stepped } : {};
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
      ...styles.split(",").map((i) => {
        const { colour: name, dash } = styleOf(Number(i));
        return { stroke: colour(name), dash, width: 1.5, spanGaps: true, points: { show: false }, ...paths };
      }),
    ],
  };
}
