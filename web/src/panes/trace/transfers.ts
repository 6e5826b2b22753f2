import { abortTexts } from "../../can/words";
import type { Batch, Frame } from "../../protocol/batch";
import { ERROR, EXTENDED, frameOf, REMOTE } from "../../protocol/batch";
import { bytes, hex } from "../../protocol/text";
import { meaningOf } from "../dictionary/note";
import { limitsOf, type ObjectRow } from "../dictionary/reducer";
import { matcher, type Known, type Piece } from "./reducer";

/** A transfer of the default SDO channel of a node (CiA 301 §7.2.4): a request and all that belongs to it. */
export interface Transfer {
  bus: number;
  node: number;
  /** Numbers of its frames. */
  frames: number[];
  /** "1018h:04"; empty: its request is not here */
  object: string;
  kind: "read" | "write";
  how: "expedited" | "segmented" | "block";
  state: "open" | "done" | "aborted";
  abort: number;
  /** The value as far as its frames are here; of a block transfer none is taken together. */
  data: number[];
  /** Whether a download's last bytes are sent: the next answer ends it. */
  last: boolean;
  from: number;
  to: number;
  /** Whether the filter lets one of its frames through. */
  hit: boolean;
}

/** A row of the folded list: the number of a frame, a transfer, or a frame of a transfer that is open. */
export type FoldedRow = number | Transfer | { child: number };

const MOST_BYTES = 64;
/** Who stays silent for so long answers nothing more. */
const LONGEST_PAUSE_S = 10;

function begins(command: number, first: number): boolean {
  if (command === 1 || command === 2) return true;
  // Block upload and download: only their initiate.
  return (command === 5 && (first & 3) === 0) || (command === 6 && (first & 1) === 0);
}

function begun(frame: Frame): Transfer {
  const { data } = frame;
  const first = data[0] ?? 0;
  const command = first >> 5;
  const index = (data[1] ?? 0) | ((data[2] ?? 0) << 8);
  const object = `${hex(index, 4)}:${(data[3] ?? 0).toString(16).toUpperCase().padStart(2, "0")}`;
  const kind = command === 1 || command === 6 ? "write" : "read";
  const how = command >= 5 ? "block" : command === 1 && first & 2 ? "expedited" : "segmented";
  const made: Transfer = {
    bus: frame.bus,
    node: frame.id & 0x7f,
    frames: [],
    object,
    kind,
    how,
    state: "open",
    abort: 0,
    data: [],
    last: how === "expedited",
    from: frame.seconds,
    to: frame.seconds,
    hit: false,
  };
  if (how === "expedited") keep(made, expedited(data));
  return made;
}

/** What is not known of a transfer whose request is not here. */
function headless(first: number): Partial<Transfer> {
  return { kind: "read", how: "segmented", last: false, data: [], ...(first === 0x80 ? {} : { object: "" }) };
}

/** The value in a frame that carries all of it. */
function expedited(data: Uint8Array): Uint8Array {
  const first = data[0] ?? 0;
  return data.subarray(4, first & 1 ? 8 - ((first >> 2) & 3) : 8);
}

function segment(data: Uint8Array): Uint8Array {
  return data.subarray(1, 8 - (((data[0] ?? 0) >> 1) & 7));
}

function keep(transfer: Transfer, data: Uint8Array): void {
  if (transfer.data.length < MOST_BYTES) transfer.data.push(...data);
}

/** A frame of a transfer after its request. */
function goesOn(transfer: Transfer, { data }: Frame, ofServer: boolean): void {
  const first = data[0] ?? 0;
  const command = first >> 5;
  if (first === 0x80) {
    transfer.state = "aborted";
    transfer.abort = ((data[4] ?? 0) | ((data[5] ?? 0) << 8) | ((data[6] ?? 0) << 16) | ((data[7] ?? 0) << 24)) >>> 0;
  } else if (transfer.how === "block") {
    block(transfer, data, ofServer);
  } else if (ofServer && command === 2) {
    if ((first & 2) === 0) return;
    transfer.how = "expedited";
    keep(transfer, expedited(data));
    transfer.state = "done";
  } else if (ofServer && (command === 3 || command === 1)) {
    if (transfer.last) transfer.state = "done";
  } else if (command === 0) {
    keep(transfer, segment(data));
    // The last segment of a download is answered, that of an upload ends it.
    if (first & 1 && ofServer) transfer.state = "done";
    else if (first & 1) transfer.last = true;
  }
}

function block(transfer: Transfer, data: Uint8Array, ofServer: boolean): void {
  const first = data[0] ?? 0;
  if (transfer.kind === "read") {
    if (ofServer && first >> 5 === 2 && transfer.frames.length === 1) {
      // A server without block transfer, or with little to say, answers as without.
      transfer.how = first & 2 ? "expedited" : "segmented";
      if (first & 2) {
        keep(transfer, expedited(data));
        transfer.state = "done";
      }
    } else if (!ofServer && first === 0xa1) {
      transfer.state = "done";
    }
  } else if (ofServer && first === 0xa1) {
    transfer.state = "done";
  }
}

/** Takes frames one after the other, and says to which transfer each belongs. */
class Channels {
  private readonly open = new Map<number, Transfer>();
  readonly all: Transfer[] = [];

  take(frame: Frame, hit: boolean): { transfer: Transfer; isNew: boolean } {
    const key = frame.bus * 128 + (frame.id & 0x7f);
    const ofServer = (frame.id & 0x780) === 0x580;
    let transfer = this.open.get(key);
    if (transfer && frame.seconds - transfer.to > LONGEST_PAUSE_S) transfer = undefined;
    const first = frame.data[0] ?? 0;
    // Data of a block download may look like any request.
    const inBlock = transfer?.how === "block" && transfer.kind === "write" && transfer.frames.length > 1;
    const isNew = !transfer || (!ofServer && !inBlock && begins(first >> 5, first));
    if (!transfer || isNew) {
      const whole = !ofServer && begins(first >> 5, first);
      transfer = whole ? begun(frame) : { ...begun(frame), ...headless(first) };
      if (!whole) goesOn(transfer, frame, ofServer);
      this.all.push(transfer);
    } else {
      goesOn(transfer, frame, ofServer);
    }
    transfer.frames.push(frame.n);
    transfer.to = frame.seconds;
    transfer.hit ||= hit;
    if (transfer.state === "open") this.open.set(key, transfer);
    else this.open.delete(key);
    return { transfer, isNew };
  }
}

const isSdo = (batch: Batch, i: number): boolean => {
  const id = batch.ids[i] ?? 0;
  return id > 0x580 && id < 0x680 && id !== 0x600 && ((batch.flags[i] ?? 0) & (EXTENDED | REMOTE | ERROR)) === 0;
};

/** The list with each SDO transfer as one row, where its request stands. Those in `opened` show their frames, too. */
export function folded(
  pieces: readonly Piece[],
  filter: string,
  known: Known,
  opened: ReadonlySet<number>,
): FoldedRow[] {
  const channels = new Channels();
  const rows: (number | Transfer)[] = [];
  for (const { batch, rows: passed } of pieces) {
    let at = 0;
    for (let i = 0; i < batch.count; i++) {
      const hit = passed === null || passed[at] === i;
      if (hit) at++;
      if (!isSdo(batch, i)) {
        if (hit) rows.push(batch.first + i);
        continue;
      }
      const { transfer, isNew } = channels.take(frameOf(batch, i), hit);
      if (isNew) rows.push(transfer);
    }
  }
  const matches = matcher(filter);
  const shown = rows.filter((row) => typeof row === "number" || row.hit || matches?.(transferLine(row, known)));
  if (!opened.size) return shown;
  return shown.flatMap((row): FoldedRow[] => {
    if (typeof row === "number" || !opened.has(row.frames[0] ?? -1)) return [row];
    return [row, ...row.frames.map((child) => ({ child }))];
  });
}

/** The number of the first frame of a row; -1: there is no row. */
export function firstOf(row: FoldedRow | undefined): number {
  if (row === undefined) return -1;
  if (typeof row === "number") return row;
  return "child" in row ? row.child : (row.frames[0] ?? -1);
}

/** What tells a row from all others of its list: an open transfer and its first frame have the same number. */
export function nameOfRow(row: FoldedRow | undefined): number {
  return firstOf(row) + (typeof row === "object" && "child" in row ? 0.5 : 0);
}

/** The row of that name; else the transfer that its frame belongs to by now, or the next row. */
export function rowNamed(rows: readonly FoldedRow[], name: number): number {
  const same = rows.findIndex((row) => nameOfRow(row) === name);
  if (same >= 0) return same;
  const frame = Math.floor(name);
  const whole = rows.findIndex((row) => typeof row === "object" && "frames" in row && row.frames.includes(frame));
  if (whole >= 0) return whole;
  const next = rows.findIndex((row) => firstOf(row) >= frame);
  return next < 0 ? rows.length : next;
}

/** The frame that a row selects: of a transfer its last one. */
export function frameOfRow(row: FoldedRow | undefined): number | null {
  if (row === undefined || typeof row === "number") return row ?? null;
  return "child" in row ? row.child : (row.frames[row.frames.length - 1] ?? null);
}

/** An open transfer is stood for by its frames. */
function holds(row: FoldedRow | undefined, frame: number, opened: ReadonlySet<number>): boolean {
  if (typeof row !== "object" || "child" in row) return frameOfRow(row) === frame;
  return !opened.has(row.frames[0] ?? -1) && row.frames.includes(frame);
}

/** The row of a frame; -1: there is none. */
export function rowHolding(rows: readonly FoldedRow[], frame: number | null, opened: ReadonlySet<number>): number {
  return frame === null ? -1 : rows.findLastIndex((row) => holds(row, frame, opened));
}

/** The row that is one up (-1) or down (1), the last one when nothing is selected; -1: there is none. */
export function steppedRow(
  rows: readonly FoldedRow[],
  frame: number | null,
  step: number,
  opened: ReadonlySet<number>,
): number {
  const at = rowHolding(rows, frame, opened);
  if (at < 0) return rows.length - 1;
  const isHead = (row: FoldedRow | undefined) =>
    typeof row === "object" && "frames" in row && opened.has(row.frames[0] ?? -1);
  const next = at + step;
  const wanted = isHead(rows[next]) ? next + step : next;
  return wanted >= 0 && wanted < rows.length ? wanted : -1;
}

/** The first frame of the transfer that a row is, or is a frame of; null: it is of none. */
export function firstFrameOf(rows: readonly FoldedRow[], row: FoldedRow): number | null {
  if (typeof row === "number") return null;
  if ("frames" in row) return row.frames[0] ?? null;
  const whole = rows.find(
    (entry) => typeof entry === "object" && "frames" in entry && entry.frames.includes(row.child),
  );
  return typeof whole === "object" && "frames" in whole ? (whole.frames[0] ?? null) : null;
}

const transferLine = (transfer: Transfer, known: Known): string =>
  `${known.buses[transfer.bus] ?? ""} ${transferWords(transfer)}`;

/** The value as the page can tell it without the object's type. */
function valueOf(data: readonly number[]): string {
  const value = Uint8Array.from(data);
  const text = data.length > 4 && data.every((byte) => byte >= 0x20 && byte < 0x7f);
  if (text) return `"${String.fromCharCode(...data)}"`;
  const number = data.length <= 4 ? data.reduceRight((sum, byte) => sum * 256 + byte, 0) : 0;
  return data.length > 1 && data.length <= 4 ? `${bytes(value)} (${hex(number)})` : bytes(value);
}

/** How it ended. */
export function outcomeOf({ state, abort, data, kind }: Transfer): string {
  if (state === "aborted") return `abort ${hex(abort, 8)}`;
  if (state === "open") return "no answer here";
  return valueOf(data) || (kind === "write" ? "written" : "read");
}

/** What the value means by the object's note, where the dictionary knows its type; empty: nothing is known. */
export function meantBy({ data, state }: Transfer, row: ObjectRow | undefined): string {
  const limits = limitsOf(row?.type ?? "");
  if (!row?.note || !limits || state !== "done") return "";
  const bits = BigInt(row.type.replace(/\D/g, ""));
  if (BigInt(data.length) * 8n !== bits) return "";
  const raw = data.reduceRight((sum, byte) => (sum << 8n) | BigInt(byte), 0n);
  const value = limits[0] < 0n ? BigInt.asIntN(Number(bits), raw) : raw;
  return meaningOf(String(value), row.note);
}

const askedWords = ({ kind, object, node }: Transfer): string =>
  `SDO ${kind} ${object || "(its request is not here)"}, node ${node}`;

export const transferWords = (transfer: Transfer): string => `${askedWords(transfer)}: ${outcomeOf(transfer)}`;

/** What was asked, with the names of the server's words where these are here; of an abort also why. */
export function wordsOf(transfer: Transfer, texts: ReadonlyMap<number, string>): string {
  const asked = texts.get(transfer.frames[0] ?? -1) ?? askedWords(transfer);
  if (transfer.state !== "aborted") return asked;
  const answer = texts.get(transfer.frames[transfer.frames.length - 1] ?? -1) ?? "";
  const why = abortTexts[transfer.abort] ?? answer.split(", ").slice(2).join(", ");
  return why ? `${why}: ${asked}` : asked;
}
