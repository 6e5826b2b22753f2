import { messageKey, signalOf, valueOf, type FoundSignal, type Layouts } from "../../can/signals";
import { ERROR, EXTENDED, REMOTE, type Batch } from "../../protocol/batch";
import type { Action, State } from "../../store/state";
import type { Point } from "./reducer";

/** Values of a signal as its frames brought them. */
export interface SignalLine {
  /** Bus time and value, ascending. */
  points: readonly Point[];
  /** The number of the frame of each point. */
  frames: readonly number[];
}

export type SignalLines = ReadonlyMap<string, SignalLine>;

export interface SignalsState {
  layouts: Layouts;
  /** Whether `layouts` are of the server as it is now. */
  fresh: boolean;
  /** By the signal's key ("field/185 16"). */
  lines: SignalLines;
  /** What is drawn while the plots are paused. */
  paused: SignalLines | null;
  /** Bus time that a person wants to see; null: the newest. */
  at: number | null;
  /** Bus time of the newest frame, and while the plots are paused. */
  now: number;
  pausedNow: number;
  /** Number of the frame that comes next. */
  next: number;
}

export type SignalsAction =
  | { type: "signals/layouts"; layouts: Layouts }
  /** A time in the plot, which is paused for it. */
  | { type: "signals/at"; seconds: number };

export const MOST_SIGNAL_POINTS = 20_000;

export const firstSignals: SignalsState = {
  layouts: new Map(),
  fresh: false,
  lines: new Map(),
  paused: null,
  at: null,
  now: 0,
  pausedNow: 0,
  next: 0,
};

export function signalsReducer(signals: SignalsState, action: Action, state: State): SignalsState {
  switch (action.type) {
    case "batch":
      return withBatch(signals, action.batch, state);
    case "message":
      return action.message.type === "snapshot" ? { ...signals, fresh: false } : signals;
    case "view":
      return withChosen(signals, state);
    case "signals/layouts":
      return withChosen({ ...signals, layouts: action.layouts, fresh: true, lines: new Map() }, state);
    case "plots/pause":
      return action.paused ? paused(signals) : { ...signals, paused: null, at: null };
    case "signals/at":
      return { ...paused(signals), at: action.seconds };
    default:
      return signals;
  }
}

const paused = (signals: SignalsState): SignalsState =>
  signals.paused ? signals : { ...signals, paused: signals.lines, pausedNow: signals.now };

/** Lines of the signals that the view has, the new ones from the frames that this page holds. */
function withChosen(signals: SignalsState, state: State): SignalsState {
  const wanted = state.view.signals;
  const same = wanted.length === signals.lines.size && wanted.every((key) => signals.lines.has(key));
  if (same) return signals;
  const fresh = wanted.filter((key) => !signals.lines.has(key));
  const made = linesOf(
    state.trace.pieces.map((piece) => piece.batch),
    fresh,
    signals.layouts,
    state,
  );
  const lines = new Map(
    wanted.map((key) => [key, signals.lines.get(key) ?? made.get(key) ?? { points: [], frames: [] }]),
  );
  return { ...signals, lines, paused: signals.paused && lines };
}

function withBatch(signals: SignalsState, batch: Batch, state: State): SignalsState {
  const next = Math.max(signals.next, batch.first + batch.count);
  const now = Math.max(signals.now, batch.seconds[batch.count - 1] ?? 0);
  if (!signals.lines.size) return { ...signals, next, now };
  const added = linesOf([batch], [...signals.lines.keys()], signals.layouts, state, signals.next);
  if (!added.size) return { ...signals, next, now };
  const lines = new Map(signals.lines);
  for (const [key, { points, frames }] of added) {
    const before = lines.get(key);
    lines.set(key, {
      points: [...(before?.points ?? []), ...points].slice(-MOST_SIGNAL_POINTS),
      frames: [...(before?.frames ?? []), ...frames].slice(-MOST_SIGNAL_POINTS),
    });
  }
  return { ...signals, lines, next, now };
}

/** What these frames, from number `from` on, say of the signals. */
function linesOf(
  batches: readonly Batch[],
  keys: readonly string[],
  layouts: Layouts,
  state: State,
  from = 0,
): Map<string, { points: Point[]; frames: number[] }> {
  const wanted = new Map<string, FoundSignal[]>();
  for (const key of keys) {
    const found = signalOf(layouts, key);
    if (found) wanted.set(found.message, [...(wanted.get(found.message) ?? []), found]);
  }
  const lines = new Map<string, { points: Point[]; frames: number[] }>();
  if (!wanted.size) return lines;
  const buses = state.data.buses.map((bus) => bus.name);
  const ids = new Set([...wanted.values()].map(([found]) => found?.of.id));
  for (const batch of batches) {
    for (let i = Math.max(0, from - batch.first); i < batch.count; i++) {
      const flags = batch.flags[i] ?? 0;
      if (!ids.has(batch.ids[i]) || flags & (REMOTE | ERROR)) continue;
      const key = messageKey(buses[batch.buses[i] ?? 0] ?? "", batch.ids[i] ?? 0, (flags & EXTENDED) !== 0);
      const data = batch.data.subarray(i * 8, i * 8 + (batch.lengths[i] ?? 0));
      for (const { key: of, signal } of wanted.get(key) ?? []) {
        const value = valueOf(data, signal);
        if (value === null) continue;
        const line = lines.get(of) ?? { points: [], frames: [] };
        line.points.push([batch.seconds[i] ?? 0, value]);
        line.frames.push(batch.first + i);
        lines.set(of, line);
      }
    }
  }
  return lines;
}

/** The frame whose point is nearest to a time, among some lines; null: they have none. */
export function frameNear(lines: readonly SignalLine[], seconds: number): number | null {
  let best: { distance: number; frame: number } | null = null;
  for (const { points, frames } of lines) {
    const at = nearest(points, seconds);
    const distance = Math.abs((points[at]?.[0] ?? Infinity) - seconds);
    const frame = frames[at];
    if (frame !== undefined && (best === null || distance < best.distance)) best = { distance, frame };
  }
  return best?.frame ?? null;
}

function nearest(points: readonly Point[], seconds: number): number {
  let from = 0;
  let to = points.length - 1;
  while (from < to) {
    const middle = (from + to) >> 1;
    if ((points[middle]?.[0] ?? 0) < seconds) from = middle + 1;
    else to = middle;
  }
  const before = Math.abs((points[from - 1]?.[0] ?? -Infinity) - seconds);
  return before < Math.abs((points[from]?.[0] ?? Infinity) - seconds) ? from - 1 : from;
}

/** Of many points the least and the most of each piece of time: as many as a screen shows. */
export function thinned(points: readonly Point[], from: number, to: number, pieces = 600): readonly Point[] {
  const seen = points.filter(([at]) => at >= from && at <= to);
  if (seen.length <= 2 * pieces) return seen;
  const made: Point[] = [];
  for (let i = 0; i < pieces; i++) {
    const piece = seen.slice(Math.floor((i * seen.length) / pieces), Math.floor(((i + 1) * seen.length) / pieces));
    const least = piece.reduce((a, b) => (b[1] < a[1] ? b : a), piece[0] ?? [0, 0]);
    const most = piece.reduce((a, b) => (b[1] > a[1] ? b : a), piece[0] ?? [0, 0]);
    if (least === most) made.push(least);
    else made.push(...(least[0] <= most[0] ? [least, most] : [most, least]));
  }
  return made;
}

/** Where the plots end: now, or so that `at` is in them. */
export const endOf = (now: number, at: number | null, span: number): number =>
  at === null || at >= now - span ? now : Math.min(now, at + span / 2);

/** What is drawn of a line: a value stands until the next, into this piece of time and to its end. */
export function held(points: readonly Point[], from: number, to: number): readonly Point[] {
  const before = points.findLast(([at]) => at < from);
  const inside = thinned(points, from, to);
  const last = inside[inside.length - 1] ?? before;
  return [...(before ? [[from, before[1]] as const] : []), ...inside, ...(last ? [[to, last[1]] as const] : [])];
}

/** All that is drawn, a row a point, as of `plotRows`. */
export function signalRows(signals: SignalsState): (string | number)[][] {
  return [...(signals.paused ?? signals.lines)].flatMap(([key, { points }]) => {
    const found = signalOf(signals.layouts, key);
    const name = found ? `${found.of.sender} ${found.signal.name}`.trim() : key;
    return points.map(([at, value]) => [name, found?.signal.unit ?? "", "bus", at.toFixed(6), value]);
  });
}
