import type { FrameRow } from "./messages";

/** Frames in columns: a batch of 1,000 frames is seven arrays and no objects. */
export interface Batch {
  /** Number of the first frame; the others follow without gaps. */
  first: number;
  count: number;
  seconds: Float64Array;
  ids: Uint32Array;
  /** EXTENDED, REMOTE, SENT, ERROR, CUT */
  flags: Uint8Array;
  buses: Uint8Array;
  lengths: Uint8Array;
  /** Eight bytes a frame. */
  data: Uint8Array;
}

export const EXTENDED = 1;
export const REMOTE = 2;
export const SENT = 4;
/** No frame: a report of an error on the bus, as SocketCAN has it. Classes in the identifier, details in the data. */
export const ERROR = 8;
/** An FD frame of more than eight bytes, of which these are the first. */
export const CUT = 16;

export interface Frame {
  n: number;
  seconds: number;
  id: number;
  extended: boolean;
  remote: boolean;
  sent: boolean;
  error: boolean;
  cut: boolean;
  bus: number;
  data: Uint8Array;
}

export function emptyBatch(first: number, count: number): Batch {
  return {
    first,
    count,
    seconds: new Float64Array(count),
    ids: new Uint32Array(count),
    flags: new Uint8Array(count),
    buses: new Uint8Array(count),
    lengths: new Uint8Array(count),
    data: new Uint8Array(count * 8),
  };
}

const HEAD = 24;
const FRAME_HEAD = 10;

/**
 * A binary message of the socket. Null when it is not one of version 1, or is cut short. As many bytes follow as the
 * length says. The length of a remote frame is what it asks for: no bytes follow.
 */
export function decodeBatch(buffer: ArrayBuffer): Batch | null {
  const view = new DataView(buffer);
  if (view.byteLength < HEAD || view.getUint8(0) !== 1 || view.getUint8(1) !== 1) return null;
  const count = view.getUint16(2, true);
  const batch = emptyBatch(Number(view.getBigUint64(8, true)), count);
  let nanoseconds = Number(view.getBigUint64(16, true));
  let at = HEAD;
  for (let i = 0; i < count; i++) {
    if (at + FRAME_HEAD > view.byteLength) return null;
    nanoseconds += view.getUint32(at, true) * 1000;
    const id = view.getUint32(at + 4, true);
    const lengthByte = view.getUint8(at + 9);
    const length = Math.min(lengthByte & 0x0f, 8);
    batch.seconds[i] = nanoseconds / 1e9;
    batch.ids[i] = id & 0x1fffffff;
    const error = id & 0x20000000 ? ERROR : 0;
    const cut = lengthByte & 0x10 ? CUT : 0;
    batch.flags[i] = ((id >>> 31) & 1) | (((id >>> 30) & 1) << 1) | (((lengthByte >>> 7) & 1) << 2) | error | cut;
    batch.buses[i] = view.getUint8(at + 8);
    batch.lengths[i] = length;
    const bytes = id & 0x40000000 ? 0 : length;
    at += FRAME_HEAD;
    if (at + bytes > view.byteLength) return null;
    batch.data.set(new Uint8Array(buffer, at, bytes), i * 8);
    at += bytes;
  }
  return at === view.byteLength ? batch : null;
}

export function frameOf(batch: Batch, i: number): Frame {
  const flags = batch.flags[i] ?? 0;
  const length = batch.lengths[i] ?? 0;
  return {
    n: batch.first + i,
    seconds: batch.seconds[i] ?? 0,
    id: batch.ids[i] ?? 0,
    extended: (flags & EXTENDED) !== 0,
    remote: (flags & REMOTE) !== 0,
    sent: (flags & SENT) !== 0,
    error: (flags & ERROR) !== 0,
    cut: (flags & CUT) !== 0,
    bus: batch.buses[i] ?? 0,
    data: batch.data.subarray(i * 8, i * 8 + length),
  };
}

/** Rows that the server gave out of its ring, which need not have numbers without gaps: one batch for each run. */
export function batchesOfRows(rows: readonly FrameRow[], busNames: readonly string[]): Batch[] {
  const batches: Batch[] = [];
  let start = 0;
  for (let i = 1; i <= rows.length; i++) {
    if (i < rows.length && rows[i]?.n === (rows[i - 1]?.n ?? 0) + 1) continue;
    const run = rows.slice(start, i);
    const firstRow = run[0];
    if (firstRow) batches.push(batchOfRun(run, firstRow.n, busNames));
    start = i;
  }
  return batches;
}

function batchOfRun(run: readonly FrameRow[], first: number, busNames: readonly string[]): Batch {
  const batch = emptyBatch(first, run.length);
  run.forEach((row, i) => {
    const bytes = bytesOf(row.data);
    batch.seconds[i] = row.t_s;
    batch.ids[i] = row.id;
    const kind = (row.ext ? EXTENDED : 0) | (row.rtr ? REMOTE : 0) | (row.own ? SENT : 0);
    batch.flags[i] = kind | (row.error ? ERROR : 0) | (row.cut ? CUT : 0);
    batch.buses[i] = Math.max(0, busNames.indexOf(row.bus));
    batch.lengths[i] = row.rtr ? (row.dlc ?? 0) : bytes.length;
    batch.data.set(bytes, i * 8);
  });
  return batch;
}

export function bytesOf(hex: string): Uint8Array {
  const clean = hex.replace(/[^0-9a-fA-F]/g, "").slice(0, 16);
  const bytes = new Uint8Array(clean.length >> 1);
  for (let i = 0; i < bytes.length; i++) bytes[i] = parseInt(clean.slice(2 * i, 2 * i + 2), 16);
  return bytes;
}

/** Both as one, when the second follows the first without a gap. */
export function joined(a: Batch, b: Batch): Batch {
  const both = emptyBatch(a.first, a.count + b.count);
  both.seconds.set(a.seconds);
  both.seconds.set(b.seconds, a.count);
  both.ids.set(a.ids);
  both.ids.set(b.ids, a.count);
  both.flags.set(a.flags);
  both.flags.set(b.flags, a.count);
  both.buses.set(a.buses);
  both.buses.set(b.buses, a.count);
  both.lengths.set(a.lengths);
  both.lengths.set(b.lengths, a.count);
  both.data.set(a.data);
  both.data.set(b.data, a.count * 8);
  return both;
}
