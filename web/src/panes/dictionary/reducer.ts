import type { Action, Sent, State } from "../../store/state";
import type { View } from "../../store/view";
import { draftOf, nameOf, noteOf, quantityOf, type Note, type NoteDraft } from "./note";

export interface ObjectRow {
  /** "1018h:04" */
  key: string;
  name: string;
  type: string;
  value: string;
  bytes: string;
  /** Why it could not be read. */
  abort: string;
  /** What is known of the object; null: nothing. */
  note: Note | null;
  /** What the value means, by the description or the notes; empty: not known. */
  meaning: string;
  /** What of it does not come from the note. */
  own: string;
  /** What the description and the slot's file say; empty: nothing. */
  usual: string;
  configured: string;
  /** A setting: it is compared with these. */
  setting: boolean;
  /** A setting that is not as the file wants it, or as it is by default. */
  differs: boolean;
}

export interface DictionaryState {
  search: string;
  differencesOnly: boolean;
  watchedOnly: boolean;
  /** Only what is not as configured, or by default. */
  otherOnly: boolean;
  /** By the key of the slot. */
  objects: Readonly<Record<string, readonly ObjectRow[]>>;
  /** By the slot's key, then the object's: what it was before the last reading. */
  before: Readonly<Record<string, Readonly<Record<string, string>>>>;
  draft: string;
  /** Node-IDs that the draft is for: "1-10, 12"; empty: the selected one. */
  devices: string;
  /** The last writing to several devices. */
  series: Series | null;
  /** The note that is edited. */
  note: NoteDraft | null;
}

export interface Series {
  owner: string;
  object: string;
  total: number;
}

export type DictionaryAction =
  | { type: "dictionary/search"; search: string }
  | { type: "dictionary/changed"; only: boolean }
  | { type: "dictionary/watched"; only: boolean }
  | { type: "dictionary/other"; only: boolean }
  | { type: "dictionary/draft"; draft: string }
  | { type: "dictionary/devices"; devices: string }
  | { type: "dictionary/note"; change: Partial<NoteDraft> }
  | { type: "dictionary/series"; series: Series };

export const firstDictionary: DictionaryState = {
  search: "",
  differencesOnly: false,
  watchedOnly: false,
  otherOnly: false,
  objects: {},
  before: {},
  draft: "",
  devices: "",
  series: null,
  note: null,
};

export function dictionaryReducer(dictionary: DictionaryState, action: Action, state: State): DictionaryState {
  switch (action.type) {
    case "dictionary/search":
      return { ...dictionary, search: action.search };
    case "dictionary/changed":
      return { ...dictionary, differencesOnly: action.only };
    case "dictionary/watched":
      return { ...dictionary, watchedOnly: action.only };
    case "dictionary/other":
      return { ...dictionary, otherOnly: action.only };
    case "dictionary/draft":
      return { ...dictionary, draft: action.draft };
    case "dictionary/devices":
      return { ...dictionary, devices: action.devices };
    case "dictionary/series":
      return { ...dictionary, series: action.series };
    case "dictionary/note":
      return dictionary.note ? { ...dictionary, note: { ...dictionary.note, ...action.change } } : dictionary;
    case "view": {
      const moves = action.change.object !== undefined || action.change.slot !== undefined;
      const left = moves ? { ...dictionary, note: null } : dictionary;
      return action.change.object === undefined ? left : { ...left, draft: "", devices: "", series: null };
    }
    case "message":
      if (action.message.type === "change") return withWritten(dictionary, action.message.written ?? []);
      return action.message.type === "reply" ? withReply(dictionary, action.message.id, state) : dictionary;
    default:
      return dictionary;
  }
}

/** `sdo dump` replaces all objects of a slot; `sdo read` and `sdo write` change those that they name. */
function withReply(dictionary: DictionaryState, id: string, state: State): DictionaryState {
  const sent = state.requests.find((entry) => entry.id === id);
  if (sent?.verb.startsWith("note ") && sent.status === 0) return withNote(dictionary, sent, state.view);
  if (!sent?.verb.startsWith("sdo ") || sent.status !== 0) return dictionary;
  const slot = sent.owner.replace(/^(dictionary:|series \d+ )/, "").replace(/^watch:(.*) \S+$/s, "$1");
  if (slot === sent.owner) return dictionary;
  return withRows(dictionary, slot, rowsOf(sent.reply), sent.verb === "sdo dump");
}

/** The owner of a request about the note of an object, and what its draft is of. */
export const noteOwner = (slot: string, object: string): string => `note:${slot} ${object}`;

/** What is known of an object now, in its row and in the editor. */
function withNote(dictionary: DictionaryState, sent: Sent, view: View): DictionaryState {
  if (!sent.owner.startsWith("note:") || !isJson(sent.reply)) return dictionary;
  const [slot = "", object = ""] = [sent.owner.slice(5, sent.owner.lastIndexOf(" ")), sent.owner.split(" ").at(-1)];
  const known = noteOf(sent.reply.note);
  const rows = dictionary.objects[slot]?.map((row) => (row.key === object ? noted(row, known) : row));
  const objects = rows ? { ...dictionary.objects, [slot]: rows } : dictionary.objects;
  const shown = view.slot === slot && view.object === object;
  return { ...dictionary, objects, note: shown ? draftOf(sent.owner, sent.reply) : dictionary.note };
}

const noted = (row: ObjectRow, note: Note | null): ObjectRow => ({
  ...row,
  note,
  meaning: meaningWith(row.value, row.own, note),
});

/** As the server puts it together: the quantity is the note's, and the object's own words come before its names. */
const meaningWith = (value: string, own: string, note: Note | null): string =>
  [note ? quantityOf(value, note) : "", own || (note ? nameOf(value, note) : "")].filter(Boolean).join(", ");

/** What any client wrote, in the devices of which something is shown. */
function withWritten(dictionary: DictionaryState, written: readonly unknown[]): DictionaryState {
  let next = dictionary;
  for (const reply of written) {
    if (!isJson(reply) || reply.path !== undefined) continue;
    const slot = `${textOf(reply.bus)}/${textOf(reply.node)}`;
    const rows = rowsOf(reply).filter((row) => !row.abort);
    if (slot in next.objects) next = withRows(next, slot, rows, false);
  }
  return next;
}

function withRows(dictionary: DictionaryState, slot: string, rows: ObjectRow[], all: boolean): DictionaryState {
  if (!rows.length) return dictionary;
  const old = dictionary.objects[slot] ?? [];
  const next = all ? rows : merged(old, rows);
  const before = new Map(Object.entries(dictionary.before[slot] ?? {}));
  const oldValues = new Map(old.map((row) => [row.key, row.value]));
  for (const row of rows) {
    const was = oldValues.get(row.key);
    if (was !== undefined && was !== row.value) before.set(row.key, was);
    else if (all) before.delete(row.key);
  }
  return {
    ...dictionary,
    objects: { ...dictionary.objects, [slot]: next },
    before: { ...dictionary.before, [slot]: Object.fromEntries(before) },
  };
}

function merged(old: readonly ObjectRow[], rows: readonly ObjectRow[]): ObjectRow[] {
  const fresh = new Map(rows.map((row) => [row.key, row]));
  const next = old.map((row) => {
    const replacement = fresh.get(row.key);
    fresh.delete(row.key);
    return replacement ? again(row, replacement) : row;
  });
  return [...next, ...fresh.values()];
}

/** `sdo read` and `sdo write` say less than `sdo dump`: what it said of default and file stays. */
function again(row: ObjectRow, fresh: ObjectRow): ObjectRow {
  const { usual, configured, setting } = row;
  const note = fresh.note ?? row.note;
  const own = fresh.own || (fresh.value === row.value ? row.own : "");
  return {
    ...fresh,
    name: fresh.name || row.name,
    type: fresh.type || row.type,
    note,
    own,
    meaning: meaningWith(fresh.value, own, note),
    usual,
    configured,
    setting,
    differs: setting && fresh.abort === "" && fresh.value !== (configured || usual),
  };
}

/** "1017", "1017h", "0x1018:4", "1018h:04" -> "1018h:04"; null: it is no object. */
export function objectNamed(text: string): string | null {
  const match = /^(?:0x)?([0-9a-f]{4})h?(?::([0-9a-f]{1,2})h?)?$/i.exec(text.trim());
  return match ? `${(match[1] ?? "").toUpperCase()}h:${(match[2] ?? "0").toUpperCase().padStart(2, "0")}` : null;
}

/** "1-3, 12" -> 1, 2, 3, 12: those of `ids` that it names. Null: it says something else. */
export function idsNamed(text: string, ids: readonly number[]): number[] | null {
  const wanted = new Set<number>();
  for (const word of text.split(/[\s,]+/).filter(Boolean)) {
    const match = /^(\d{1,3})(?:(?:-|\.\.)(\d{1,3}))?$/.exec(word);
    if (!match) return null;
    const last = Math.min(127, Number(match[2] ?? match[1]));
    for (let id = Number(match[1]); id <= last; id++) wanted.add(id);
  }
  return ids.filter((id) => wanted.has(id));
}

type Json = Record<string, unknown>;
const isJson = (value: unknown): value is Json => typeof value === "object" && value !== null;
const textOf = (value: unknown): string => (value === undefined || value === null ? "" : String(value));

export function rowsOf(reply: unknown): ObjectRow[] {
  if (!isJson(reply)) return [];
  const list = Array.isArray(reply.objects) ? reply.objects : "index" in reply ? [reply] : [];
  return list.filter(isJson).map(rowOf);
}

function rowOf(object: Json): ObjectRow {
  const index = textOf(object.index).replace(/^0x/i, "").toUpperCase();
  const sub = Number(object.sub ?? 0)
    .toString(16)
    .toUpperCase()
    .padStart(2, "0");
  const value = textOf(object.value ?? object.time);
  const note = noteOf(object.note);
  const meaning = textOf(object.meaning);
  const own = note && meaning === nameOf(value, note) ? "" : meaning;
  return {
    key: `${index}h:${sub}`,
    name: textOf(object.name),
    type: textOf(object.type),
    value,
    bytes: textOf(object.bytes),
    note,
    meaning: [textOf(object.quantity), meaning].filter(Boolean).join(", "),
    own,
    usual: textOf(object.default),
    configured: textOf(object.configured),
    setting: typeof object.differs === "boolean",
    differs: object.differs === true,
    abort: object.abort_code === undefined ? "" : `${textOf(object.abort_code)} ${textOf(object.text)}`.trim(),
  };
}

/** Every word must be in the index, the name or the value. */
export function searched(rows: readonly ObjectRow[], search: string): readonly ObjectRow[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  if (!words.length) return rows;
  return rows.filter((row) => {
    const line = `${row.key} ${row.name} ${row.value} ${row.meaning}`.toLowerCase();
    return words.every((word) => line.includes(word));
  });
}

/** The least and the greatest number of an integer type; null: it is none. */
export function limitsOf(type: string): [bigint, bigint] | null {
  const match = /^(UNSIGNED|INTEGER)(8|16|24|32|40|48|56|64)$/.exec(type);
  if (!match) return null;
  const bits = BigInt(match[2] ?? "8");
  return match[1] === "UNSIGNED" ? [0n, (1n << bits) - 1n] : [-(1n << (bits - 1n)), (1n << (bits - 1n)) - 1n];
}

/** What is wrong with a number for this type; empty: nothing, or it is no plain number and the server judges it. */
export function wrongFor(type: string, text: string): string {
  const limits = limitsOf(type);
  const match = /^([+-]?)(0x[0-9a-f]+|\d+)$/i.exec(text.trim());
  if (!limits || !match) return "";
  const value = BigInt(match[2] ?? "0") * (match[1] === "-" ? -1n : 1n);
  return value < limits[0] || value > limits[1] ? `${type} takes ${limits[0]} to ${limits[1]}.` : "";
}
