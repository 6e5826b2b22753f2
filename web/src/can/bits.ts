/** The exact bits of a classic frame on the wire (ISO 11898-1:2015 clause 10; docs/protocols/can-frames.md). */

export interface WireFrame {
  id: number;
  extended: boolean;
  remote: boolean;
  data: Uint8Array;
}

export type Field =
  | "SOF"
  | "ID"
  | "ID A"
  | "ID B"
  | "SRR"
  | "RTR"
  | "IDE"
  | "r1"
  | "r0"
  | "DLC"
  | "data"
  | "CRC"
  | "CRC del"
  | "ACK"
  | "ACK del"
  | "EOF"
  | "IFS";

export interface Bit {
  /** 0 dominant, 1 recessive */
  value: 0 | 1;
  field: Field;
  /** Inserted after five equal bits; the receiver takes it out. */
  stuff: boolean;
  /** Of "data": the number of the byte. */
  byte?: number;
}

export const fieldMeaning: Record<Field, string> = {
  SOF: "Start of frame. One dominant bit; every node synchronises on its edge.",
  ID: "Identifier, 11 bits. The lower number wins the arbitration.",
  "ID A": "Upper 11 bits of the 29-bit identifier.",
  "ID B": "Lower 18 bits of the 29-bit identifier.",
  SRR: "Substitute remote request. Recessive, in the place of RTR of a base frame.",
  RTR: "Remote transmission request. Dominant: data frame; recessive: remote frame.",
  IDE: "Identifier extension. Dominant: 11-bit identifier; recessive: 29-bit identifier.",
  r1: "Reserved. Sent dominant.",
  r0: "Reserved (FDF in CAN FD). Dominant: a classic frame.",
  DLC: "Data length code: number of data bytes, 0 to 8.",
  data: "Data bytes, most significant bit first.",
  CRC: "CRC-15 over all bits before it without stuff bits. Polynomial 4599h.",
  "CRC del": "CRC delimiter. Recessive.",
  ACK: "Acknowledge slot. The sender sends recessive; every node that received the frame well sends dominant.",
  "ACK del": "Acknowledge delimiter. Recessive.",
  EOF: "End of frame. Seven recessive bits.",
  IFS: "Intermission. Three recessive bits before the next frame may begin.",
};

export const CRC_POLYNOMIAL = 0x4599;

export function crc15(bits: readonly (0 | 1)[]): number {
  let crc = 0;
  for (const bit of bits) {
    const invert = ((crc >> 14) & 1) ^ bit;
    crc = (crc << 1) & 0x7fff;
    if (invert) crc ^= CRC_POLYNOMIAL;
  }
  return crc;
}

function put(bits: Bit[], field: Field, value: number, width: number, byte?: number): void {
  for (let i = width - 1; i >= 0; i--) {
    const bit: Bit = { value: ((value >>> i) & 1) as 0 | 1, field, stuff: false };
    if (byte !== undefined) bit.byte = byte;
    bits.push(bit);
  }
}

/** SOF to the last data bit, without stuff bits. */
function head(frame: WireFrame): Bit[] {
  const bits: Bit[] = [];
  put(bits, "SOF", 0, 1);
  if (frame.extended) {
    put(bits, "ID A", frame.id >>> 18, 11);
    put(bits, "SRR", 1, 1);
    put(bits, "IDE", 1, 1);
    put(bits, "ID B", frame.id & 0x3ffff, 18);
    put(bits, "RTR", frame.remote ? 1 : 0, 1);
    put(bits, "r1", 0, 1);
  } else {
    put(bits, "ID", frame.id, 11);
    put(bits, "RTR", frame.remote ? 1 : 0, 1);
    put(bits, "IDE", 0, 1);
  }
  put(bits, "r0", 0, 1);
  put(bits, "DLC", frame.data.length, 4);
  if (!frame.remote) frame.data.forEach((byte, i) => put(bits, "data", byte, 8, i));
  return bits;
}

/** A stuff bit belongs to the field of the bit before it. */
function stuffed(bits: readonly Bit[]): Bit[] {
  const wire: Bit[] = [];
  let run = 0;
  let last = -1;
  for (const bit of bits) {
    wire.push(bit);
    run = bit.value === last ? run + 1 : 1;
    last = bit.value;
    if (run < 5) continue;
    const opposite = (1 - bit.value) as 0 | 1;
    wire.push({ ...bit, value: opposite, stuff: true });
    last = opposite;
    run = 1;
  }
  return wire;
}

/** SOF to intermission as other nodes see it: the acknowledge slot is dominant, as of a frame that was received. */
export function wireBits(frame: WireFrame): Bit[] {
  const bits = head(frame);
  put(bits, "CRC", crc15(bits.map((bit) => bit.value)), 15);
  const wire = stuffed(bits);
  put(wire, "CRC del", 1, 1);
  put(wire, "ACK", 0, 1);
  put(wire, "ACK del", 1, 1);
  put(wire, "EOF", 0x7f, 7);
  put(wire, "IFS", 7, 3);
  return wire;
}

export function crcOf(frame: WireFrame): number {
  return crc15(head(frame).map((bit) => bit.value));
}

export interface FieldRun {
  field: Field;
  byte?: number;
  bits: Bit[];
  /** Position of its first bit on the wire, SOF is 0. */
  at: number;
}

/** The bits grouped by field, data by byte. */
export function fieldRuns(wire: readonly Bit[]): FieldRun[] {
  const runs: FieldRun[] = [];
  wire.forEach((bit, at) => {
    const last = runs[runs.length - 1];
    if (last && last.field === bit.field && last.byte === bit.byte) {
      last.bits.push(bit);
      return;
    }
    const run: FieldRun = { field: bit.field, bits: [bit], at };
    if (bit.byte !== undefined) run.byte = bit.byte;
    runs.push(run);
  });
  return runs;
}

export function fieldValue(run: FieldRun): number {
  return run.bits.filter((bit) => !bit.stuff).reduce((value, bit) => value * 2 + bit.value, 0);
}
