import { meaningOf, type Service } from "../../can/words";
import { batchesOfRows, frameOf, joined, type Batch, type Frame } from "../../protocol/batch";
import type { FrameRow } from "../../protocol/messages";
import { bytes, hex } from "../../protocol/text";
import type { Action, State } from "../../store/state";

/** Frames that the page keeps; the server's ring has the others. */
export const MOST_FRAMES = 100_000;
const SMALL_BATCH = 512;
const MOST_TEXTS = 8_000;

/** One piece of the list: a batch, and which of its frames the filter lets through. */
export interface Piece {
  batch: Batch;
  /** Positions in the batch; null: all. */
  rows: Uint32Array | null;
  count: number;
}

export interface Latest {
  key: string;
  frame: Frame;
  count: number;
  /** Seconds between the last two. */
  period: number;
  service: Service;
}

export interface TraceState {
  pieces: readonly Piece[];
  /** Frames in `pieces`, and those that the filter lets through. */
  kept: number;
  shown: number;
  /** What is drawn while paused: the list as it was then. Nothing is lost, `pieces` grows on. */
  paused: { pieces: readonly Piece[]; shown: number } | null;
  filter: string;
  latest: ReadonlyMap<string, Latest>;
  /** The server's words by the number of the frame. */
  texts: ReadonlyMap<number, string>;
  /** Rows of the server's whole ring that the filter lets through; null: not asked. */
  matched: number | null;
  /** Id of the question that `matched` waits for. */
  asked: string;
}

export type TraceAction =
  { type: "trace/pause"; paused: boolean } | { type: "trace/clear" } | { type: "trace/asked"; id: string };

export const firstTrace: TraceState = {
  pieces: [],
  kept: 0,
  shown: 0,
  paused: null,
  filter: "",
  latest: new Map(),
  texts: new Map(),
  matched: null,
  asked: "",
};

export function traceReducer(trace: TraceState, action: Action, state: State): TraceState {
  switch (action.type) {
    case "batch":
      return withBatch(trace, action.batch, busNames(state));
    case "view":
      return state.view.filter === trace.filter ? trace : refiltered(trace, state.view.filter, busNames(state));
    case "message":
      return messageReducer(trace, action.message, state);
    case "trace/pause":
      return { ...trace, paused: action.paused ? { pieces: trace.pieces, shown: trace.shown } : null };
    case "trace/clear":
      return { ...firstTrace, filter: trace.filter };
    case "trace/asked":
      return { ...trace, asked: action.id };
    default:
      return trace;
  }
}

const busNames = (state: State): string[] => state.data.buses.map((bus) => bus.name);

function messageReducer(trace: TraceState, message: Extract<Action, { type: "message" }>["message"], state: State) {
  if (message.type !== "frames") return trace;
  const texts = withTexts(trace.texts, message.rows);
  if (message.id.startsWith("words")) return { ...trace, texts };
  const matched = message.id === trace.asked && trace.filter ? message.matched : trace.matched;
  return withOlder({ ...trace, texts, matched }, batchesOfRows(message.rows, busNames(state)), busNames(state));
}

function withTexts(texts: ReadonlyMap<number, string>, rows: readonly FrameRow[]): ReadonlyMap<number, string> {
  const next = texts.size > MOST_TEXTS ? new Map<number, string>() : new Map(texts);
  for (const row of rows) next.set(row.n, row.text);
  return next;
}

/** All words of the filter, as the server's: in the frame's words, its bus, or `id#data`. */
export function matcher(filter: string): ((line: string) => boolean) | null {
  const words = filter.toLowerCase().split(/\s+/).filter(Boolean);
  if (!words.length) return null;
  return (line) => {
    const lower = line.toLowerCase();
    return words.every((word) => lower.includes(word));
  };
}

export function lineOf(frame: Frame, buses: readonly string[]): string {
  const meaning = meaningOf(frame.id, frame.extended, frame.remote, frame.data);
  const id = frame.id
    .toString(16)
    .toUpperCase()
    .padStart(frame.extended ? 8 : 3, "0");
  return `${buses[frame.bus] ?? ""} ${id}#${bytes(frame.data).replace(/ /g, "")} ${hex(frame.id)} ${meaning.text}`;
}

function pieceOf(batch: Batch, filter: string, buses: readonly string[], texts: ReadonlyMap<number, string>): Piece {
  const matches = matcher(filter);
  if (!matches) return { batch, rows: null, count: batch.count };
  const rows: number[] = [];
  for (let i = 0; i < batch.count; i++) {
    const text = texts.get(batch.first + i) ?? "";
    if (matches(lineOf(frameOf(batch, i), buses) + text)) rows.push(i);
  }
  return { batch, rows: Uint32Array.from(rows), count: rows.length };
}

function withBatch(trace: TraceState, batch: Batch, buses: readonly string[]): TraceState {
  if (batch.count === 0) return trace;
  const last = trace.pieces[trace.pieces.length - 1];
  // What was sent again, after a reconnection or out of the ring, is there already.
  if (last && batch.first < last.batch.first + last.batch.count) return trace;
  const follows = last && last.batch.first + last.batch.count === batch.first;
  const small = follows && last.batch.count + batch.count <= SMALL_BATCH;
  const whole = small ? joined(last.batch, batch) : batch;
  const before = small ? trace.pieces.slice(0, -1) : trace.pieces;
  const pieces = [...before, pieceOf(whole, trace.filter, buses, trace.texts)];
  return { ...trace, ...limited(pieces), latest: withLatest(trace.latest, batch) };
}

function limited(pieces: Piece[]): Pick<TraceState, "pieces" | "kept" | "shown"> {
  let kept = pieces.reduce((sum, piece) => sum + piece.batch.count, 0);
  let first = 0;
  while (kept > MOST_FRAMES && first < pieces.length - 1) kept -= pieces[first++]?.batch.count ?? 0;
  const rest = first ? pieces.slice(first) : pieces;
  return { pieces: rest, kept, shown: rest.reduce((sum, piece) => sum + piece.count, 0) };
}

/** Rows of the ring go where their numbers belong, unless the page has them. */
function withOlder(trace: TraceState, batches: readonly Batch[], buses: readonly string[]): TraceState {
  const fresh = batches.flatMap((batch) => missing(trace.pieces, batch));
  if (!fresh.length) return trace;
  const pieces = [...trace.pieces, ...fresh.map((batch) => pieceOf(batch, trace.filter, buses, trace.texts))];
  pieces.sort((a, b) => a.batch.first - b.batch.first);
  let { latest } = trace;
  if (latest.size === 0) for (const batch of fresh) latest = withLatest(latest, batch);
  const next = { ...trace, ...limited(pieces), latest };
  return trace.paused ? { ...next, paused: { pieces: next.pieces, shown: next.shown } } : next;
}

/** The parts of a batch that no piece holds. */
function missing(pieces: readonly Piece[], batch: Batch): Batch[] {
  let parts: [number, number][] = [[batch.first, batch.first + batch.count]];
  for (const { batch: held } of pieces) {
    const end = held.first + held.count;
    parts = parts.flatMap(([from, to]): [number, number][] => {
      if (end <= from || held.first >= to) return [[from, to]];
      const left: [number, number] = [from, Math.min(to, held.first)];
      const right: [number, number] = [Math.max(from, end), to];
      return [left, right].filter(([a, b]) => a < b);
    });
  }
  return parts.map(([from, to]) => cut(batch, from - batch.first, to - batch.first));
}

function cut(batch: Batch, from: number, to: number): Batch {
  if (from === 0 && to === batch.count) return batch;
  return {
    first: batch.first + from,
    count: to - from,
    seconds: batch.seconds.slice(from, to),
    ids: batch.ids.slice(from, to),
    flags: batch.flags.slice(from, to),
    buses: batch.buses.slice(from, to),
    lengths: batch.lengths.slice(from, to),
    data: batch.data.slice(from * 8, to * 8),
  };
}

function withLatest(latest: ReadonlyMap<string, Latest>, batch: Batch): ReadonlyMap<string, Latest> {
  const counts = new Map<string, { last: number; before: number; count: number }>();
  for (let i = 0; i < batch.count; i++) {
    const key = `${batch.buses[i] ?? 0} ${(batch.flags[i] ?? 0) & 3} ${batch.ids[i] ?? 0}`;
    const entry = counts.get(key);
    if (!entry) {
      counts.set(key, { last: i, before: -1, count: 1 });
    } else {
      entry.before = entry.last;
      entry.last = i;
      entry.count++;
    }
  }
  const next = new Map(latest);
  for (const [key, { last, before, count }] of counts) {
    const old = latest.get(key);
    const frame = frameOf(batch, last);
    const previous = before >= 0 ? batch.seconds[before] : old?.frame.seconds;
    const period = previous === undefined ? 0 : frame.seconds - previous;
    const service = meaningOf(frame.id, frame.extended, frame.remote, frame.data).service;
    next.set(key, { key, frame, count: (old?.count ?? 0) + count, period, service });
  }
  return next;
}

function refiltered(trace: TraceState, filter: string, buses: readonly string[]): TraceState {
  const again = (pieces: readonly Piece[]) => pieces.map((p) => pieceOf(p.batch, filter, buses, trace.texts));
  const live = limited(again(trace.pieces));
  const paused = trace.paused ? again(trace.paused.pieces) : null;
  return {
    ...trace,
    ...live,
    filter,
    matched: null,
    asked: "",
    paused: paused && { pieces: paused, shown: paused.reduce((sum, piece) => sum + piece.count, 0) },
  };
}

/** The frame in row `row` of the list, or null. */
export function frameAt(pieces: readonly Piece[], row: number): Frame | null {
  let left = row;
  for (const piece of pieces) {
    if (left < piece.count) return frameOf(piece.batch, piece.rows ? (piece.rows[left] ?? 0) : left);
    left -= piece.count;
  }
  return null;
}

export function frameNumbered(pieces: readonly Piece[], n: number): Frame | null {
  const piece = pieces.find(({ batch }) => n >= batch.first && n < batch.first + batch.count);
  return piece ? frameOf(piece.batch, n - piece.batch.first) : null;
}

/** The row of the list that shows frame `n`, or -1. */
export function rowOf(pieces: readonly Piece[], n: number): number {
  let before = 0;
  for (const { batch, rows, count } of pieces) {
    if (n >= batch.first && n < batch.first + batch.count) {
      const inside = rows ? rows.indexOf(n - batch.first) : n - batch.first;
      return inside < 0 ? -1 : before + inside;
    }
    before += count;
  }
  return -1;
}
