/** Signals of messages: where they stand in a frame, and what their bits mean. The server tells the layouts. */

export interface Signal {
  name: string;
  /** Its first bit: bit 0 of byte 0 is 0, little endian (CiA 301 §7.1.4). */
  at: number;
  bits: number;
  type: "boolean" | "unsigned" | "signed" | "real";
  /** "6000h:01" */
  object?: string;
  unit?: string;
  /** One count in `unit`. */
  factor?: number;
  /** Names of numbers. */
  values?: { raw: number; name: string }[];
}

export interface Message {
  id: number;
  ext: boolean;
  name: string;
  /** A slot, or "master"; empty: none of the bus. */
  sender: string;
  signals: Signal[];
}

/** The answer of /api/v1/signals. */
export interface SignalsAnswer {
  buses: { bus: string; messages: Message[] }[];
}

/** Messages by `messageKey`. */
export type Layouts = ReadonlyMap<string, Message>;

/** "field/185"; an extended identifier has eight digits. */
export const messageKey = (bus: string, id: number, extended: boolean): string =>
  `${bus}/${id
    .toString(16)
    .toUpperCase()
    .padStart(extended ? 8 : 3, "0")}`;

/** "field/185 16": the message and the first bit. */
export const signalKey = (message: string, signal: Signal): string => `${message} ${signal.at}`;

export function layoutsOf({ buses }: SignalsAnswer): Layouts {
  const all = buses.flatMap(({ bus, messages }) =>
    messages.map((message): [string, Message] => [messageKey(bus, message.id, message.ext), message]),
  );
  return new Map(all);
}

export interface FoundSignal {
  key: string;
  /** Of its message. */
  message: string;
  of: Message;
  signal: Signal;
}

/** The signal of a key; null: the machine has none there. */
export function signalOf(layouts: Layouts, key: string): FoundSignal | null {
  const blank = key.lastIndexOf(" ");
  const message = key.slice(0, blank);
  const of = layouts.get(message);
  const signal = of?.signals.find((entry) => entry.at === Number(key.slice(blank + 1)));
  return of && signal ? { key, message, of, signal } : null;
}

/** The bits as an unsigned number; null: the frame is too short for them. */
function bitsOf(data: Uint8Array, at: number, bits: number): bigint | null {
  if (at + bits > data.length * 8) return null;
  let value = 0n;
  const last = (at + bits - 1) >> 3;
  for (let byte = last; byte >= at >> 3; byte--) value = (value << 8n) | BigInt(data[byte] ?? 0);
  return BigInt.asUintN(bits, value >> BigInt(at & 7));
}

function realOf(raw: bigint, bits: number): number {
  const view = new DataView(new ArrayBuffer(8));
  view.setBigUint64(0, raw << BigInt(64 - bits));
  return bits === 32 ? view.getFloat32(0) : view.getFloat64(0);
}

/** The number on the wire; null: the frame is too short, or this is no number. */
function rawOf(data: Uint8Array, { at, bits, type }: Signal): number | bigint | null {
  if (type === "real" && bits !== 32 && bits !== 64) return null;
  const raw = bitsOf(data, at, bits);
  if (raw === null) return null;
  if (type === "real") return realOf(raw, bits);
  const value = type === "signed" ? BigInt.asIntN(bits, raw) : raw;
  return bits > 53 ? value : Number(value);
}

/** As it is plotted: in its unit. */
export function valueOf(data: Uint8Array, signal: Signal): number | null {
  const raw = rawOf(data, signal);
  return raw === null ? null : Number(raw) * (signal.factor ?? 1);
}

/** "12.5 rpm", "stands (0)"; empty: not in this frame. */
export function valueWords(data: Uint8Array, signal: Signal): string {
  const raw = rawOf(data, signal);
  if (raw === null) return "";
  const named = signal.values?.find((entry) => entry.raw === Number(raw));
  if (named) return `${named.name} (${raw})`;
  const value = signal.factor === undefined ? raw : Number((Number(raw) * signal.factor).toPrecision(12));
  const text =
    typeof value === "number" && !Number.isInteger(value) ? String(Number(value.toPrecision(7))) : String(value);
  return signal.unit ? `${text} ${signal.unit}` : text;
}
