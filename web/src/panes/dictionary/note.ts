/** What is known of an object (docs/commands.md, Notes). Numbers of values and bits are decimal. */
export interface Note {
  text: string;
  /** Empty: not known. */
  unit: string;
  /** One count is so many units. */
  scale: number;
  values: Readonly<Record<string, string>>;
  bits: Readonly<Record<string, string>>;
}

export const noNote: Note = { text: "", unit: "", scale: 1, values: {}, bits: {} };

const isJson = (value: unknown): value is Record<string, unknown> => typeof value === "object" && value !== null;
const textOf = (value: unknown): string => (typeof value === "string" ? value : "");

function names(value: unknown): Record<string, string> {
  if (!isJson(value)) return {};
  return Object.fromEntries(Object.entries(value).map(([number, name]) => [number, textOf(name)]));
}

/** Of a reply of the server; null: it has none. */
export function noteOf(json: unknown): Note | null {
  if (!isJson(json)) return null;
  const scale = typeof json.scale === "number" && json.scale > 0 ? json.scale : 1;
  return {
    text: textOf(json.text),
    unit: textOf(json.unit),
    scale,
    values: names(json.values),
    bits: names(json.bits),
  };
}

/** The number that a value's text is; null: it is none, or has more digits than a bit pattern of 64. */
export function integerOf(text: string): bigint | null {
  return /^-?\d{1,20}$/.test(text) ? BigInt(text) : null;
}

export const bitIsSet = (value: bigint, bit: number): boolean => ((value >> BigInt(bit)) & 1n) === 1n;

/** "23.5 °C"; empty: the note has no unit, or the value is no number. */
export function quantityOf(value: string, note: Note): string {
  if (!note.unit || value.trim() === "" || !Number.isFinite(Number(value))) return "";
  return `${scaled(Number(value), note)} ${note.unit}`;
}

/** A count in units. */
export const scaled = (count: number, note: Note | null | undefined): number =>
  note?.unit ? Number((count * note.scale).toPrecision(10)) : count;

/** The value's name, or the names of its bits that are set. */
export function nameOf(value: string, note: Note): string {
  const number = integerOf(value);
  if (number === null) return "";
  const named = note.values[String(number)];
  if (named !== undefined) return named;
  const set = sorted(note.bits).filter(([bit]) => bitIsSet(number, Number(bit)));
  return set.map(([, name]) => name).join(", ");
}

/** What a value means, in one line. */
export const meaningOf = (value: string, note: Note): string =>
  [quantityOf(value, note), nameOf(value, note)].filter(Boolean).join(", ");

/** By their numbers. */
export function sorted(table: Readonly<Record<string, string>>): [string, string][] {
  return Object.entries(table).sort(([a], [b]) => {
    const [left, right] = [integerOf(a) ?? 0n, integerOf(b) ?? 0n];
    return left < right ? -1 : left > right ? 1 : 0;
  });
}

/** A note as it is edited: all text, a name a line. */
export interface NoteDraft {
  /** Slot and object that it is of; a late answer of another is no longer wanted. */
  of: string;
  /** The file has a note of this object. */
  inFile: boolean;
  file: string;
  text: string;
  unit: string;
  scale: string;
  values: string;
  bits: string;
}

const lines = (table: Readonly<Record<string, string>>): string =>
  sorted(table)
    .map(([number, name]) => `${number} = ${name}`)
    .join("\n");

/** Of the answer of `note read` or `note write`: what the file says, not what is built in. */
export function draftOf(of: string, reply: unknown): NoteDraft {
  const json = isJson(reply) ? reply : {};
  const own = noteOf(json.own);
  const { text, unit, scale, values, bits } = own ?? noNote;
  return {
    of,
    inFile: own !== null,
    file: textOf(json.file),
    text,
    unit,
    scale: scale === 1 ? "" : String(scale),
    values: lines(values),
    bits: lines(bits),
  };
}

/** "3 = fault" a line as the request has it: "3=fault". */
const joined = (text: string): string =>
  text
    .split("\n")
    .map((line) => line.trim().replace(/\s*=\s*/, "="))
    .filter(Boolean)
    .join("\n");

/** What of the request says the note; null: nothing, the note is to be removed. */
export function noteValues(draft: NoteDraft): Record<string, string> | null {
  const all = {
    text: draft.text.trim(),
    unit: draft.unit.trim(),
    scale: draft.scale.trim(),
    values: joined(draft.values),
    bits: joined(draft.bits),
  };
  const said = Object.entries(all).filter(([, value]) => value !== "");
  return said.length ? { anew: "1", ...Object.fromEntries(said) } : null;
}

/** What is wrong with lines of names; empty: nothing. The server judges again. */
export function wrongNames(text: string, bits: boolean): string {
  for (const line of joined(text).split("\n")) {
    const match = /^(-?)(0x[0-9a-f]+|\d+)=./i.exec(line);
    if (line && !match) return `"${line}": write a number, = and a name.`;
    if (bits && match && (match[1] !== "" || Number(match[2]) > 63)) return `"${line}": bits have the numbers 0 to 63.`;
  }
  return "";
}
