/** The messages of the API, version 1, as the server sends them and takes them. */

export interface Machine {
  name: string;
  simulated: boolean;
  /** "GROUP/NAME" at its MQTT broker; empty: it is at none, and the server does not answer "fleet". */
  fleet?: string;
  file: string;
}

export interface Bus {
  name: string;
  bit_rate: number;
  port: string;
  role: string;
  master_id: number | null;
  beneath: { bus: string; slot: string } | null;
}

/** The error that a device told last, and that is not gone. */
export interface Emcy {
  at_s: number;
  /** "0x2310". */
  code: string;
  text: string;
  /** Error register, "0x03". */
  register: string;
  /** Equal ones, one after the other. */
  count: number;
}

export interface Slot {
  bus: string;
  id: number;
  name: string;
  /** Vendor-ID and product code, "0x0000000100000042"; null when not known. */
  type: string | null;
  /** Revision and serial number, "0x0001000100000007"; null when no device sits there. */
  r_sn: string | null;
  state: string;
  since_s: number;
  reason?: string;
  /** The letter of CiA 302-2 with which the boot-up ended. */
  boot?: string;
  /** NMT state, as its device told last. */
  nmt?: string;
  /** When it told that; not told again with each heartbeat. */
  heard_s?: number;
  emcy?: Emcy;
}

export interface Event {
  at_s: number;
  bus: string;
  kind: string;
  text: string;
  slot?: string;
  /** Of a question: the slots that it is about, and the LSS addresses of the devices. */
  slots?: string[];
  devices?: string[];
  /** Of a question: shall its slot's device save its parameters, and be reset? */
  offers_save?: true;
}

export type Form = "word" | "option" | "flag" | "common" | "own";

export interface Parameter {
  name: string;
  help: string;
  required: boolean;
  form: Form;
  value: string;
  /** How the command line spells it, where that is not its name: "--save". */
  spelled?: string;
  /** With it a verb changes something that else only asks. */
  changes?: true;
}

export interface Verb {
  name: string;
  help: string;
  changes: boolean;
  /** That it needs. */
  role: Role;
  parameters: Parameter[];
}

export interface Lock {
  /** Whether a bus of this machine is a real one. */
  real: boolean;
  unlocked_until_s: number | null;
}

/** The time of a simulated world. */
export interface WorldTime {
  paused: boolean;
  /** World time beside the clock's. */
  speed: number;
  time_s: number;
}

/** Each may do what those before it may. */
export const roles = ["view", "operate", "configure"] as const;
export type Role = (typeof roles)[number];

export interface Snapshot {
  type: "snapshot";
  seq: number;
  machine: Machine;
  buses: Bus[];
  slots: Slot[];
  events: Event[];
  /** That are open. */
  questions: Event[];
  time_s: number;
  verbs: Verb[];
  lock: Lock;
  role: Role;
  /** Another for each start of the server: frames are numbered anew. */
  start?: string;
  /** On the server's computer: where the token of this role stands; empty: nowhere. */
  token_file?: string;
  /** Null: the machine is not simulated. */
  world?: WorldTime | null;
}

export interface Change {
  type: "change";
  seq: number;
  time_s: number;
  slots?: Slot[];
  events?: Event[];
  /** All that are open, when they changed. */
  questions?: Event[];
  lock?: Lock;
  world?: WorldTime | null;
  /** What `sdo write` of any client answered. */
  written?: unknown[];
}

export interface Reply {
  type: "reply";
  id: string;
  status: number;
  reply: unknown;
  lines: string[];
  error: string;
}

export interface FrameRow {
  n: number;
  t_s: number;
  bus: string;
  id: number;
  ext: boolean;
  rtr: boolean;
  data: string;
  text: string;
  /** Of a remote frame: the length that it asks for. */
  dlc?: number;
  /** Sent by who recorded it. */
  own?: true;
  /** No frame: a report of an error. */
  error?: true;
  /** The first eight bytes of a longer FD frame. */
  cut?: true;
}

/** The answer to a trace file that was sent. */
export interface OpenedFile {
  name: string;
  format: string;
  buses: string[];
  /** In the file; `rows` has the first of them. */
  frames: number;
  rows: FrameRow[];
  /** "run.log:12:3: error: …" */
  findings: string[];
  more_findings: number;
}

export interface Frames {
  type: "frames";
  id: string;
  first: number;
  last: number;
  rows: FrameRow[];
  matched: number;
}

export interface BusRates {
  bus: string;
  frames_per_s: number;
  load: number;
  errors_per_s?: number;
  /** Error frames since the start. */
  errors?: number;
  /** Of Berth's own port there, where it tells it. */
  state?: "active" | "warning" | "passive" | "bus-off" | "down";
  tec?: number;
  rec?: number;
}

export interface Rates {
  type: "rates";
  buses: BusRates[];
  ring: { first: number; next: number };
  left_out: number;
  world?: WorldTime | null;
}

export type ServerMessage = Snapshot | Change | Reply | Frames | Rates;

export type ClientMessage =
  | { type: "request"; id: string; verb: string; arguments: Record<string, string> }
  /** Without `from` the newest rows come. */
  | { type: "frames"; id: string; from?: number; count: number; filter?: string }
  | { type: "live"; frames: boolean }
  | { type: "unlock"; minutes: number }
  | { type: "lock" };

const known = new Set(["snapshot", "change", "reply", "frames", "rates"]);

/** Null for anything that is not a message of the contract: the page ignores what a newer server may say. */
export function parseMessage(text: string): ServerMessage | null {
  let value: unknown;
  try {
    value = JSON.parse(text);
  } catch {
    return null;
  }
  if (typeof value !== "object" || value === null) return null;
  const type = (value as { type?: unknown }).type;
  return typeof type === "string" && known.has(type) ? (value as ServerMessage) : null;
}
