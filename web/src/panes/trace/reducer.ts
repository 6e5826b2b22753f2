import { meaningOfFrame, type Meaning, type Service } from "../../can/words";
import { batchesOfRows, ERROR, EXTENDED, frameOf, joined, REMOTE, type Batch, type Frame } from "../../protocol/batch";
import type { FrameRow, OpenedFile } from "../../protocol/messages";
import { bytes, hex } from "../../protocol/text";
import type { Action, State } from "../../store/state";
import { MOST_MARKS, type View } from "../../store/view";

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

/** The list as it was when it was paused. Older frames that come late join it; newer ones never do. */
export interface PausedList {
  pieces: readonly Piece[];
  shown: number;
  /** The number of the first frame that is newer than the pause; without end where the list was empty. */
  end: number;
}

export interface TraceState {
  pieces: readonly Piece[];
  /** Frames in `pieces`, and those that the filter lets through. */
  kept: number;
  shown: number;
  /** What is drawn while paused. Nothing is lost, `pieces` grows on. */
  paused: PausedList | null;
  filter: string;
  latest: ReadonlyMap<string, Latest>;
  /** The server's words by the number of the frame. */
  texts: ReadonlyMap<number, string>;
  /** Rows of the server's whole ring that the filter lets through; null: not asked. */
  matched: number | null;
  /** Id of the question that `matched` waits for. */
  asked: string;
  /** Times of the frames with a marker, where the page knows them. */
  marked: ReadonlyMap<number, number>;
  /** Transfers that show their frames, by the number of the first. */
  opened: ReadonlySet<number>;
  /** A file that is shown instead of the machine's frames. */
  file: TraceFile | null;
}

/** What is chosen in a list of frames. That of the machine's frames is in the address. */
export type Picked = Pick<View, "frame" | "marks" | "zero">;

export interface TraceFile {
  name: string;
  format: string;
  /** In the file; `list` has the first of them. */
  frames: number;
  findings: readonly string[];
  moreFindings: number;
  /** Its frames: a list that is paused, since nothing comes. */
  list: TraceState;
  known: Known;
  picked: Picked;
}

export type TraceAction =
  | { type: "trace/pause"; paused: boolean }
  | { type: "trace/toggle" }
  | { type: "trace/clear" }
  | { type: "trace/asked"; id: string }
  | { type: "trace/file"; file: TraceFile | null }
  | { type: "trace/pick"; change: Partial<Picked> }
  | { type: "trace/open"; first: number; open: boolean };

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
  marked: new Map(),
  opened: new Set(),
  file: null,
};

export function traceReducer(trace: TraceState, action: Action, state: State): TraceState {
  switch (action.type) {
    case "batch":
      return withBatch(trace, action.batch, knownOf(state));
    case "view":
      return withMarks(refilteredAll(trace, state), state.view.marks);
    case "message":
      return withMarks(messageReducer(trace, action.message, state), state.view.marks);
    case "trace/pause":
      return paused(trace, action.paused);
    case "trace/toggle":
      return paused(trace, trace.paused === null);
    case "trace/clear":
      return { ...firstTrace, filter: trace.filter, marked: trace.marked, file: trace.file };
    case "trace/file":
    case "trace/pick":
      return { ...trace, file: fileReducer(trace, action) };
    case "trace/asked":
      return { ...trace, asked: action.id };
    case "trace/open":
      return inShown(trace, (list) => ({ ...list, opened: withOpened(list.opened, action.first, action.open) }));
    default:
      return trace;
  }
}

const paused = (trace: TraceState, now: boolean): TraceState => ({
  ...trace,
  paused: now ? { pieces: trace.pieces, shown: trace.shown, end: endOf(trace.pieces) } : null,
});

function endOf(pieces: readonly Piece[]): number {
  const last = pieces[pieces.length - 1]?.batch;
  return last ? last.first + last.count : Infinity;
}

function refilteredAll(trace: TraceState, state: State): TraceState {
  const { filter } = state.view;
  if (filter === trace.filter) return trace;
  const { file } = trace;
  const again = file && { ...file, list: refiltered(file.list, filter, file.known) };
  return { ...refiltered(trace, filter, knownOf(state)), file: again };
}

/** Changes the list that the pane shows: the file's while one is open. */
function inShown(trace: TraceState, change: (list: TraceState) => TraceState): TraceState {
  const { file } = trace;
  return file ? { ...trace, file: { ...file, list: change(file.list) } } : change(trace);
}

function fileReducer(
  { file, filter }: TraceState,
  action: Extract<TraceAction, { type: "trace/file" | "trace/pick" }>,
): TraceFile | null {
  if (action.type === "trace/file")
    return action.file && { ...action.file, list: refiltered(action.file.list, filter, action.file.known) };
  if (!file) return null;
  const picked = { ...file.picked, ...action.change };
  return { ...file, picked, list: withMarks(file.list, picked.marks) };
}

function withOpened(opened: ReadonlySet<number>, first: number, open: boolean): ReadonlySet<number> {
  const next = new Set(opened);
  if (open) next.add(first);
  else next.delete(first);
  return next;
}

/** Times of new markers, while their frames are here. */
function withMarks(trace: TraceState, marks: readonly number[]): TraceState {
  const fresh = marks.filter((n) => !trace.marked.has(n));
  const found = fresh.flatMap((n): [number, number][] => {
    const frame = frameNumbered(trace.pieces, n);
    return frame ? [[n, frame.seconds]] : [];
  });
  return found.length ? { ...trace, marked: new Map([...trace.marked, ...found]) } : trace;
}

/** A marker on a frame, or none any more. The first one is where times count from. */
export function markChange(view: Pick<View, "marks" | "zero">, n: number): Partial<Picked> {
  if (view.marks.includes(n)) {
    const marks = view.marks.filter((mark) => mark !== n);
    return { marks, zero: view.zero === n ? null : view.zero };
  }
  if (view.marks.length >= MOST_MARKS) return {};
  const marks = [...view.marks, n].sort((a, b) => a - b);
  return { marks, zero: view.zero ?? n };
}

/** What words about frames rest on: the buses in their order, and which nodes the machine has. */
export interface Known {
  buses: readonly string[];
  isNode: (bus: number, node: number) => boolean;
}

let knownFor: { slots: unknown; buses: unknown; known: Known } | null = null;

export function knownOf({ data }: State): Known {
  if (knownFor?.slots === data.slots && knownFor.buses === data.buses) return knownFor.known;
  const nodes = new Set(data.slots.map((slot) => `${slot.bus}/${slot.id}`));
  for (const bus of data.buses) if (bus.master_id !== null) nodes.add(`${bus.name}/${bus.master_id}`);
  const buses = data.buses.map((bus) => bus.name);
  const known = { buses, isNode: (bus: number, node: number) => nodes.has(`${buses[bus] ?? ""}/${node}`) };
  knownFor = { slots: data.slots, buses: data.buses, known };
  return known;
}

export function meaningIn(frame: Frame, known: Known): Meaning {
  return meaningOfFrame(frame, (node) => known.isNode(frame.bus, node));
}

function messageReducer(trace: TraceState, message: Extract<Action, { type: "message" }>["message"], state: State) {
  if (message.type !== "frames") return trace;
  const texts = withTexts(trace.texts, message.rows);
  if (message.id.startsWith("words")) return { ...trace, texts };
  const matched = message.id === trace.asked && trace.filter ? message.matched : trace.matched;
  return withOlder({ ...trace, texts, matched }, batchesOfRows(message.rows, knownOf(state).buses), knownOf(state));
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

export function lineOf(frame: Frame, known: Known): string {
  const meaning = meaningIn(frame, known);
  const id = frame.id
    .toString(16)
    .toUpperCase()
    .padStart(frame.extended ? 8 : 3, "0");
  return `${known.buses[frame.bus] ?? ""} ${id}#${bytes(frame.data).replace(/ /g, "")} ${hex(frame.id)} ${meaning.text}`;
}

function pieceOf(batch: Batch, filter: string, known: Known, texts: ReadonlyMap<number, string>): Piece {
  const matches = matcher(filter);
  if (!matches) return { batch, rows: null, count: batch.count };
  const rows: number[] = [];
  for (let i = 0; i < batch.count; i++) {
    const text = texts.get(batch.first + i) ?? "";
    if (matches(lineOf(frameOf(batch, i), known) + text)) rows.push(i);
  }
  return { batch, rows: Uint32Array.from(rows), count: rows.length };
}

function withBatch(trace: TraceState, batch: Batch, known: Known): TraceState {
  if (batch.count === 0) return trace;
  const last = trace.pieces[trace.pieces.length - 1];
  // What was sent again, after a reconnection or out of the ring, is there already.
  if (last && batch.first < last.batch.first + last.batch.count) return trace;
  const follows = last && last.batch.first + last.batch.count === batch.first;
  const small = follows && last.batch.count + batch.count <= SMALL_BATCH;
  const whole = small ? joined(last.batch, batch) : batch;
  const before = small ? trace.pieces.slice(0, -1) : trace.pieces;
  const pieces = [...before, pieceOf(whole, trace.filter, known, trace.texts)];
  return { ...trace, ...limited(pieces), latest: withLatest(trace.latest, batch) };
}

function limited(pieces: Piece[]): Pick<TraceState, "pieces" | "kept" | "shown"> {
  let kept = pieces.reduce((sum, piece) => sum + piece.batch.count, 0);
  let first = 0;
  while (kept > MOST_FRAMES && first < pieces.length - 1) kept -= pieces[first++]?.batch.count ?? 0;
  const rest = first ? pieces.slice(first) : pieces;
  return { pieces: rest, kept, shown: shownIn(rest) };
}

const shownIn = (pieces: readonly Piece[]) => pieces.reduce((sum, piece) => sum + piece.count, 0);

/** Rows of the ring go where their numbers belong, unless the page has them. */
function withOlder(trace: TraceState, batches: readonly Batch[], known: Known): TraceState {
  const insert = (pieces: readonly Piece[], older: readonly Batch[]) => {
    const fresh = older.flatMap((batch) => missing(pieces, batch));
    const all = [...pieces, ...fresh.map((batch) => pieceOf(batch, trace.filter, known, trace.texts))];
    return { fresh, list: limited(all.sort((a, b) => a.batch.first - b.batch.first)) };
  };
  const live = insert(trace.pieces, batches);
  let { latest } = trace;
  if (latest.size === 0) for (const batch of live.fresh) latest = withLatest(latest, batch);
  const next = { ...trace, ...(live.fresh.length ? live.list : {}), latest };
  const { paused } = trace;
  if (!paused) return next;
  const { fresh, list } = insert(
    paused.pieces,
    batches.flatMap((batch) => before(batch, paused.end)),
  );
  return fresh.length ? { ...next, paused: { ...paused, pieces: list.pieces, shown: list.shown } } : next;
}

/** The part of a batch whose frames have smaller numbers than `end`. */
function before(batch: Batch, end: number): Batch[] {
  const count = Math.min(batch.count, end - batch.first);
  return count > 0 ? [cut(batch, 0, count)] : [];
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
    const key = `${batch.buses[i] ?? 0} ${(batch.flags[i] ?? 0) & (EXTENDED | REMOTE | ERROR)} ${batch.ids[i] ?? 0}`;
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
    const service = meaningOfFrame(frame).service;
    next.set(key, { key, frame, count: (old?.count ?? 0) + count, period, service });
  }
  return next;
}

function refiltered(trace: TraceState, filter: string, known: Known): TraceState {
  const again = (pieces: readonly Piece[]) => pieces.map((p) => pieceOf(p.batch, filter, known, trace.texts));
  const live = limited(again(trace.pieces));
  const paused = trace.paused ? again(trace.paused.pieces) : null;
  return {
    ...trace,
    ...live,
    filter,
    matched: null,
    asked: "",
    paused: trace.paused && paused && { ...trace.paused, pieces: paused, shown: shownIn(paused) },
  };
}

/** What the server read of a file. Which of its nodes are there nobody said: each may be. */
export function fileOf(answer: OpenedFile): TraceFile {
  const { name, format, buses, frames, rows, findings, more_findings } = answer;
  const known = { buses, isNode: () => true };
  const texts = new Map(rows.flatMap((row): [number, string][] => (row.text ? [[row.n, row.text]] : [])));
  const batches = batchesOfRows(rows, buses);
  const pieces = batches.map((batch) => pieceOf(batch, "", known, texts));
  let { latest } = firstTrace;
  for (const batch of batches) latest = withLatest(latest, batch);
  const list = {
    ...firstTrace,
    ...limited(pieces),
    texts,
    latest,
    paused: { pieces, shown: rows.length, end: Infinity },
  };
  const picked = { frame: null, marks: [], zero: null };
  return { name, format, frames, findings, moreFindings: more_findings, list, known, picked };
}

/** The list that the window shows, what its words rest on, and what is chosen in it. */
export interface Listed {
  list: TraceState;
  known: Known;
  picked: Picked;
  /** Null: these are the machine's frames. */
  file: TraceFile | null;
}

export function listedOf(state: State): Listed {
  const { file } = state.trace;
  if (file && state.view.pane === "trace") return { list: file.list, known: file.known, picked: file.picked, file };
  return { list: state.trace, known: knownOf(state), picked: state.view, file: null };
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

/** The first row of the list whose frame is `n` or a later one. */
export function rowFrom(pieces: readonly Piece[], n: number): number {
  let before = 0;
  for (const { batch, rows, count } of pieces) {
    if (n < batch.first + batch.count) {
      const inside = rows ? rows.findIndex((row) => batch.first + row >= n) : Math.max(0, n - batch.first);
      return before + (inside < 0 ? count : inside);
    }
    before += count;
  }
  return before;
}
