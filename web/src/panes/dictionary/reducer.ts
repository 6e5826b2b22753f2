import type { Action, State } from "../../store/state";

export interface ObjectRow {
  /** "1018h:04" */
  key: string;
  name: string;
  type: string;
  value: string;
  bytes: string;
  /** Why it could not be read. */
  abort: string;
}

export interface DictionaryState {
  search: string;
  differencesOnly: boolean;
  /** By the key of the slot. */
  objects: Readonly<Record<string, readonly ObjectRow[]>>;
  /** By the slot's key, then the object's: what it was before the last reading. */
  before: Readonly<Record<string, Readonly<Record<string, string>>>>;
  draft: string;
}

export type DictionaryAction =
  | { type: "dictionary/search"; search: string }
  | { type: "dictionary/changed"; only: boolean }
  | { type: "dictionary/draft"; draft: string };

export const firstDictionary: DictionaryState = {
  search: "",
  differencesOnly: false,
  objects: {},
  before: {},
  draft: "",
};

export function dictionaryReducer(dictionary: DictionaryState, action: Action, state: State): DictionaryState {
  switch (action.type) {
    case "dictionary/search":
      return { ...dictionary, search: action.search };
    case "dictionary/changed":
      return { ...dictionary, differencesOnly: action.only };
    case "dictionary/draft":
      return { ...dictionary, draft: action.draft };
    case "view":
      return action.change.object === undefined ? dictionary : { ...dictionary, draft: "" };
    case "message":
      return action.message.type === "reply" ? withReply(dictionary, action.message.id, state) : dictionary;
    default:
      return dictionary;
  }
}

/** `sdo dump` replaces all objects of a slot; `sdo read` and `sdo write` change those that they name. */
function withReply(dictionary: DictionaryState, id: string, state: State): DictionaryState {
  const sent = state.requests.find((entry) => entry.id === id);
  if (!sent?.verb.startsWith("sdo ") || sent.status !== 0) return dictionary;
  const slot = sent.owner.replace(/^dictionary:/, "");
  const rows = rowsOf(sent.reply);
  if (slot === sent.owner || !rows.length) return dictionary;
  const old = dictionary.objects[slot] ?? [];
  const next = sent.verb === "sdo dump" ? rows : merged(old, rows);
  const before = new Map(Object.entries(dictionary.before[slot] ?? {}));
  const oldValues = new Map(old.map((row) => [row.key, row.value]));
  for (const row of rows) {
    const was = oldValues.get(row.key);
    if (was !== undefined && was !== row.value) before.set(row.key, was);
    else if (sent.verb === "sdo dump") before.delete(row.key);
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
    return replacement
      ? { ...replacement, name: replacement.name || row.name, type: replacement.type || row.type }
      : row;
  });
  return [...next, ...fresh.values()];
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
  return {
    key: `${index}h:${sub}`,
    name: textOf(object.name),
    type: textOf(object.type),
    value: textOf(object.value ?? object.time),
    bytes: textOf(object.bytes),
    abort: object.abort_code === undefined ? "" : `${textOf(object.abort_code)} ${textOf(object.text)}`.trim(),
  };
}

/** Every word must be in the index, the name or the value. */
export function searched(rows: readonly ObjectRow[], search: string): readonly ObjectRow[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  if (!words.length) return rows;
  return rows.filter((row) => {
    const line = `${row.key} ${row.name} ${row.value}`.toLowerCase();
    return words.every((word) => line.includes(word));
  });
}
