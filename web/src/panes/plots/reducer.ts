import type { Batch } from "../../protocol/batch";
import { ERROR, EXTENDED, REMOTE } from "../../protocol/batch";
import type { Rates } from "../../protocol/messages";
import { isHeard } from "../../store/beneath";
import type { Action, Sent, State } from "../../store/state";
import { scaled, type Note } from "../dictionary/note";
import { rowsOf, type ObjectRow } from "../dictionary/reducer";

/** Seconds and a value. */
export type Point = readonly [number, number];

export interface Plots {
  /** By the name of the bus; seconds of this page's clock. */
  load: Readonly<Record<string, readonly Point[]>>;
  frames: Readonly<Record<string, readonly Point[]>>;
  /** Error frames a second. */
  errors: Readonly<Record<string, readonly Point[]>>;
  /** By "bus index/node-ID": when a heartbeat came, in bus time, and ms since the one before. */
  beats: ReadonlyMap<string, readonly Point[]>;
  /** By the watched object ("field/12 6041h:00"); seconds of this page's clock. */
  values: Readonly<Record<string, readonly Point[]>>;
}

/** What the last reading of a watched object said. */
export interface Watched {
  text: string;
  error: string;
}

export interface PlotsState extends Plots {
  /** What is drawn while paused. The rest grows on. */
  paused: Plots | null;
  /** When the last heartbeat of a node came. */
  lastBeat: ReadonlyMap<string, number>;
  /** Number of the frame that comes next, unless frames are missed. */
  next: number;
  watched: Readonly<Record<string, Watched>>;
  /** Seconds between the beginnings of two rounds. */
  every: number;
  /** Readings one after the other that failed. */
  failures: number;
}

export type PlotsAction =
  { type: "plots/pause"; paused: boolean } | { type: "plots/every"; seconds: number } | { type: "plots/again" };

export const LEAST_EVERY_S = 0.5;
const MOST_EVERY_S = 3600;
export const MOST_FAILURES = 3;
/** 15 minutes of `rates`. */
const MOST_POINTS = 2400;

export const firstPlots: PlotsState = {
  load: {},
  frames: {},
  errors: {},
  beats: new Map(),
  values: {},
  paused: null,
  lastBeat: new Map(),
  next: -1,
  watched: {},
  every: 1,
  failures: 0,
};

export function plotsReducer(plots: PlotsState, action: Action, state: State): PlotsState {
  switch (action.type) {
    case "batch":
      return withBeats(plots, action.batch);
    case "message":
      if (action.message.type === "rates") return withRates(plots, action.message, action.now, state);
      return action.message.type === "reply" ? withReply(plots, action.message.id, action.now, state) : plots;
    case "plots/pause":
      return { ...plots, paused: action.paused ? shownOf(plots) : null };
    case "plots/every":
      return { ...plots, every: Math.min(MOST_EVERY_S, Math.max(LEAST_EVERY_S, action.seconds || LEAST_EVERY_S)) };
    case "plots/again":
      return { ...plots, failures: 0 };
    default:
      return plots;
  }
}

const shownOf = ({ load, frames, errors, beats, values }: Plots): Plots => ({ load, frames, errors, beats, values });

function added(points: readonly Point[] | undefined, point: Point): readonly Point[] {
  const kept = points && points.length >= MOST_POINTS ? points.slice(1 - MOST_POINTS) : (points ?? []);
  return [...kept, point];
}

/** Of a bus that Berth does not hear there is nothing to draw. */
function withRates(plots: PlotsState, rates: Rates, now: number, { data }: State): PlotsState {
  const load = { ...plots.load };
  const frames = { ...plots.frames };
  const errors = { ...plots.errors };
  for (const each of rates.buses) {
    if (!isHeard(data.buses.find(({ name }) => name === each.bus))) continue;
    load[each.bus] = added(load[each.bus], [now, each.load * 100]);
    frames[each.bus] = added(frames[each.bus], [now, each.frames_per_s]);
    errors[each.bus] = added(errors[each.bus], [now, each.errors_per_s ?? 0]);
  }
  return { ...plots, load, frames, errors };
}

/** Heartbeats (CiA 301 §7.2.8.3.2). Over frames that the page missed no interval is taken. */
function withBeats(plots: PlotsState, batch: Batch): PlotsState {
  const from = Math.max(0, plots.next - batch.first);
  if (from >= batch.count) return plots;
  const missed = batch.first > plots.next;
  const lastBeat = new Map(missed ? [] : plots.lastBeat);
  const fresh = new Map<string, Point[]>();
  for (let i = from; i < batch.count; i++) {
    const id = batch.ids[i] ?? 0;
    const beats = id > 0x700 && id < 0x780 && ((batch.flags[i] ?? 0) & (EXTENDED | REMOTE | ERROR)) === 0;
    if (!beats || batch.lengths[i] !== 1) continue;
    const key = `${batch.buses[i] ?? 0}/${id & 0x7f}`;
    const seconds = batch.seconds[i] ?? 0;
    const before = lastBeat.get(key);
    // A boot-up begins anew.
    const boots = (batch.data[i * 8] ?? 0) === 0;
    if (before !== undefined && !boots)
      fresh.set(key, [...(fresh.get(key) ?? []), [seconds, (seconds - before) * 1000]]);
    lastBeat.set(key, seconds);
  }
  const next = batch.first + batch.count;
  if (!fresh.size) return { ...plots, lastBeat, next };
  const beats = new Map(plots.beats);
  for (const [key, points] of fresh) beats.set(key, [...(beats.get(key) ?? []), ...points].slice(-MOST_POINTS));
  return { ...plots, lastBeat, beats, next };
}

/** "field/12 6041h:00": the slot's key may have blanks, the object has none. */
export const watchKey = (slot: string, object: string): string => `${slot} ${object}`;

export function watchParts(key: string): { slot: string; object: string } {
  const at = key.lastIndexOf(" ");
  return { slot: key.slice(0, at), object: key.slice(at + 1) };
}

export const watchOwner = (key: string): string => `watch:${key}`;

function numberOf(text: string): number | null {
  if (text === "true" || text === "false") return Number(text === "true");
  const value = Number(text);
  return text.trim() !== "" && Number.isFinite(value) ? value : null;
}

function withReply(plots: PlotsState, id: string, now: number, state: State): PlotsState {
  const sent = state.requests.find((entry) => entry.id === id);
  if (!sent?.owner.startsWith("watch:")) return plots;
  const key = sent.owner.slice("watch:".length);
  const [row] = sent.status === 0 ? rowsOf(sent.reply) : [];
  const error = errorOf(sent, row?.abort);
  const text = row?.meaning || row?.value || row?.bytes || "";
  const watched = { ...plots.watched, [key]: { text, error } };
  if (error) return { ...plots, watched, failures: plots.failures + 1 };
  const value = numberOf(row?.value ?? "");
  const values = value === null ? plots.values : { ...plots.values, [key]: added(plots.values[key], [now, value]) };
  return { ...plots, watched, values, failures: 0 };
}

const errorOf = (sent: Sent, abort = ""): string => (sent.status === 0 ? abort : sent.error || "no answer");

/** Who is read next. One round begins when the one before is over, and no sooner than `every` seconds after its beginning. */
export function createTurns(): (nowS: number, list: readonly string[], every: number) => string | null {
  let at = 0;
  let begun = -Infinity;
  return (nowS, list, every) => {
    if (at >= list.length) {
      if (nowS - begun < every) return null;
      at = 0;
    }
    if (at === 0) begun = nowS;
    return list[at++] ?? null;
  };
}

export interface Figures {
  count: number;
  mean: number;
  least: number;
  most: number;
  /** Standard deviation. */
  spread: number;
}

export function figuresOf(points: readonly Point[]): Figures | null {
  if (!points.length) return null;
  const values = points.map(([, value]) => value);
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const square = values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length;
  const least = values.reduce((a, b) => Math.min(a, b));
  const most = values.reduce((a, b) => Math.max(a, b));
  return { count: values.length, mean, least, most, spread: Math.sqrt(square) };
}

/** What is known of a watched object. */
export function noteOfWatched(objects: Readonly<Record<string, readonly ObjectRow[]>>, key: string): Note | null {
  const { slot, object } = watchParts(key);
  return objects[slot]?.find((row) => row.key === object)?.note ?? null;
}

/** Counts as the units of their note. */
export const inUnits = (points: readonly Point[], note: Note | null): readonly Point[] =>
  note?.unit ? points.map(([at, count]) => [at, scaled(count, note)]) : points;

/** Watched objects of one unit: they have a plot of their own. */
export interface Group {
  unit: string;
  keys: readonly string[];
}

/** In the order of the watch list. */
export function groupsOf(watch: readonly string[], noteOf: (key: string) => Note | null): Group[] {
  const groups = new Map<string, string[]>();
  for (const key of watch) {
    const unit = noteOf(key)?.unit ?? "";
    groups.set(unit, [...(groups.get(unit) ?? []), key]);
  }
  return [...groups].map(([unit, keys]) => ({ unit, keys }));
}

/** All that is drawn, a row a point. */
export function plotRows(
  plots: Plots,
  buses: readonly string[],
  noteOf: (key: string) => Note | null = () => null,
): (string | number)[][] {
  const rows: (string | number)[][] = [["series", "unit", "clock", "time_s", "value"]];
  const add = (name: string, unit: string, clock: string, points: readonly Point[]) => {
    for (const [at, value] of points) rows.push([name, unit, clock, at.toFixed(6), value]);
  };
  for (const [bus, points] of Object.entries(plots.load)) add(`load ${bus}`, "%", "page", points);
  for (const [bus, points] of Object.entries(plots.frames)) add(`frames/s ${bus}`, "1/s", "page", points);
  for (const [bus, points] of Object.entries(plots.errors)) add(`error frames/s ${bus}`, "1/s", "page", points);
  for (const [key, points] of plots.beats) {
    const [bus = "", node = ""] = key.split("/");
    add(`heartbeat interval ${buses[Number(bus)] ?? ""}/${node}`, "ms", "bus", points);
  }
  for (const [key, points] of Object.entries(plots.values)) {
    const note = noteOf(key);
    add(key, note?.unit ?? "", "page", inUnits(points, note));
  }
  return rows;
}
