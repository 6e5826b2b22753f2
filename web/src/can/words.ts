/** What a frame is, from its identifier and data alone. The server's own words, where it gave them, come first. */

import { hex } from "../protocol/text";

export type Service =
  | "NMT"
  | "SYNC"
  | "EMCY"
  | "TIME"
  | "PDO1"
  | "PDO2"
  | "PDO3"
  | "PDO4"
  | "SDO"
  | "abort"
  | "heartbeat"
  | "LSS"
  | "RAND"
  | "error"
  | "other";

export interface Meaning {
  service: Service;
  /** 0: of no node */
  node: number;
  /** "1018h:04" of an SDO frame that names its object */
  object?: string;
  text: string;
}

const nmtCommands: Record<number, string> = {
  1: "start",
  2: "stop",
  128: "enter pre-operational",
  129: "reset node",
  130: "reset communication",
};

const nmtStates: Record<number, string> = { 0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational" };

const lssServices: Record<number, string> = {
  0x04: "switch state global",
  0x11: "configure node-ID",
  0x13: "configure bit timing",
  0x15: "activate bit timing",
  0x17: "store configuration",
  0x40: "switch state selective: vendor-ID",
  0x41: "switch state selective: product code",
  0x42: "switch state selective: revision number",
  0x43: "switch state selective: serial number",
  0x44: "switch state selective: done",
  0x46: "identify remote slave: vendor-ID",
  0x47: "identify remote slave: product code",
  0x48: "identify remote slave: revision low",
  0x49: "identify remote slave: revision high",
  0x4a: "identify remote slave: serial low",
  0x4b: "identify remote slave: serial high",
  0x4c: "identify non-configured slaves",
  0x4f: "identify slave",
  0x50: "identify non-configured slave",
  0x51: "Fastscan",
  0x5a: "inquire vendor-ID",
  0x5b: "inquire product code",
  0x5c: "inquire revision number",
  0x5d: "inquire serial number",
  0x5e: "inquire node-ID",
};

export const abortTexts: Record<number, string> = {
  0x05030000: "toggle bit not alternated",
  0x05040000: "SDO protocol timed out",
  0x05040001: "command specifier not valid or unknown",
  0x05040005: "out of memory",
  0x06010000: "unsupported access to an object",
  0x06010001: "attempt to read a write-only object",
  0x06010002: "attempt to write a read-only object",
  0x06020000: "object does not exist",
  0x06040041: "object cannot be mapped to the PDO",
  0x06040042: "mapped objects exceed the PDO length",
  0x06040043: "general parameter incompatibility",
  0x06060000: "access failed due to a hardware error",
  0x06070010: "data type does not match, length of service parameter does not match",
  0x06070012: "length of service parameter too high",
  0x06070013: "length of service parameter too low",
  0x06090011: "sub-index does not exist",
  0x06090030: "value range exceeded",
  0x06090031: "value too high",
  0x06090032: "value too low",
  0x08000000: "general error",
  0x08000020: "data cannot be transferred or stored",
  0x08000021: "data cannot be transferred or stored because of local control",
  0x08000022: "data cannot be transferred or stored in the present device state",
  0x08000024: "no data available",
};

/** The words of an abort in the order of their weight: the object, why, and what else they say. Null: these are no such words. */
export function abortParts(text: string): { object: string; reason: string; rest: string } | null {
  const match = /^(SDO \w+ node \d+.*?): (abort [0-9A-F]{4}h:[0-9A-F]{2}), ([0-9A-F]{8}h)(?:, )?(.*)$/.exec(text);
  if (!match) return null;
  const [, who = "", object = "", code = "", reason = ""] = match;
  return reason ? { object, reason, rest: `${code}, ${who}` } : { object, reason: code, rest: who };
}

function u32(data: Uint8Array, at: number): number {
  const byte = (i: number) => data[at + i] ?? 0;
  return (byte(0) | (byte(1) << 8) | (byte(2) << 16) | (byte(3) << 24)) >>> 0;
}

function objectOf(data: Uint8Array): string {
  const index = (data[1] ?? 0) | ((data[2] ?? 0) << 8);
  const sub = (data[3] ?? 0).toString(16).toUpperCase().padStart(2, "0");
  return `${hex(index, 4)}:${sub}`;
}

function sdo(node: number, data: Uint8Array, fromServer: boolean): Meaning {
  const command = (data[0] ?? 0) >> 5;
  const who = fromServer ? `SDO of node ${node}` : `SDO to node ${node}`;
  // Exactly 80h: a segment of a block transfer may begin with 81h to FFh.
  if (data[0] === 0x80) {
    const code = u32(data, 4);
    const why = abortTexts[code];
    const object = objectOf(data);
    return { service: "abort", node, object, text: `${who}: abort ${object}, ${hex(code, 8)}${why ? `, ${why}` : ""}` };
  }
  const object = objectOf(data);
  const initiates = fromServer ? command === 2 || command === 3 : command === 1 || command === 2;
  if (!initiates) return { service: "SDO", node, text: `${who}: ${segment(command)}` };
  const reads = command === 2;
  const words = fromServer
    ? reads
      ? `value of ${object}`
      : `${object} written`
    : `${reads ? "read" : "write"} ${object}`;
  return { service: "SDO", node, object, text: `${who}: ${words}` };
}

function segment(command: number): string {
  return command >= 5 ? "block transfer" : "segment";
}

function lss(data: Uint8Array, fromMaster: boolean): Meaning {
  const command = data[0] ?? 0;
  const name = lssServices[command] ?? `command ${hex(command, 2)}`;
  const detail = command === 0x51 && fromMaster ? fastscan(data) : "";
  return { service: "LSS", node: 0, text: `LSS ${fromMaster ? "" : "answer: "}${name}${detail}` };
}

const lssParts = ["vendor-ID", "product code", "revision number", "serial number"];

function fastscan(data: Uint8Array): string {
  const bitCheck = data[5] ?? 0;
  if (bitCheck === 0x80) return ": is any device without a node-ID there?";
  return `: ${lssParts[data[6] ?? 0] ?? "?"} ${hex(u32(data, 1), 8)}, bit ${bitCheck} and above`;
}

function rand(id: number, data: Uint8Array): Meaning {
  const kind = id >>> 18;
  const chunk = hex((id >>> 2) & 0xffff, 4);
  const text =
    kind === 0x7d4
      ? `RAND: a device has the chunk ${chunk}`
      : kind === 0x7e4
        ? `RAND: a device has the last chunk ${chunk}`
        : `RAND request, phase ${data[1] ?? 0}, mask ${hex(((data[2] ?? 0) << 8) | (data[3] ?? 0), 4)}`;
  return { service: "RAND", node: 0, text };
}

/** `isNode`: whether the machine has this node; a COB-ID of a PDO need not be that of the predefined connection set. */
export function meaningOf(
  id: number,
  extended: boolean,
  remote: boolean,
  data: Uint8Array,
  isNode: (node: number) => boolean = () => true,
): Meaning {
  if (extended) {
    const kind = id >>> 18;
    if (kind === 0x7d4 || kind === 0x7e4 || kind === 0x7e5) return rand(id, data);
    return { service: "other", node: 0, text: "extended frame" };
  }
  const node = id & 0x7f;
  const base = id & 0x780;
  if (id === 0x000) {
    const target = data[1] ?? 0;
    const command = nmtCommands[data[0] ?? -1] ?? "unknown command";
    return { service: "NMT", node: target, text: `NMT: ${command}, ${target ? `node ${target}` : "all nodes"}` };
  }
  if (id === 0x080) return { service: "SYNC", node: 0, text: "SYNC" };
  if (id === 0x100) return { service: "TIME", node: 0, text: "TIME" };
  if (id === 0x7e5) return lss(data, true);
  if (id === 0x7e4) return lss(data, false);
  if (node === 0) return { service: "other", node: 0, text: "" };
  if (base === 0x080) return emergency(node, data);
  if (base >= 0x180 && base < 0x580) return pdo(base, node, isNode(node));
  if (base === 0x580) return sdo(node, data, true);
  if (base === 0x600) return sdo(node, data, false);
  if (base === 0x700) return errorControl(node, remote, data);
  return { service: "other", node: 0, text: "" };
}

const errorKinds: [number, string][] = [
  [0x01, "single bit"],
  [0x02, "form"],
  [0x04, "stuff"],
  [0x08, "dominant bit seen recessive"],
  [0x10, "recessive bit seen dominant"],
];

/** Where in the frame (linux/can/error.h). */
const errorPlaces: Record<number, string> = {
  0x03: "start of frame",
  0x02: "identifier",
  0x06: "identifier",
  0x07: "identifier",
  0x0f: "identifier",
  0x0e: "identifier",
  0x04: "RTR",
  0x0c: "RTR",
  0x05: "IDE",
  0x09: "reserved bit",
  0x0d: "reserved bit",
  0x0b: "DLC",
  0x0a: "data",
  0x08: "CRC",
  0x18: "CRC delimiter",
  0x19: "ACK slot",
  0x1b: "ACK delimiter",
  0x1a: "end of frame",
  0x12: "intermission",
};

export interface BusError {
  /** "stuff"; empty: nobody told */
  kind: string;
  place: string;
  /** Who reports it was sending. */
  sending: boolean;
  /** TEC and REC of who reports it; null: not told. */
  counters: [number, number] | null;
}

export function busErrorOf(id: number, data: Uint8Array): BusError {
  const protocol = (id & 0x08) !== 0;
  const bits = protocol ? (data[2] ?? 0) : 0;
  const kinds = errorKinds.filter(([bit]) => bits & bit).map(([, words]) => words);
  if (id & 0x20) kinds.unshift("no acknowledge");
  const place = protocol ? (errorPlaces[data[3] ?? 0] ?? "") : "";
  if (!kinds.length && place === "CRC") kinds.push("CRC");
  const told = (id & 0x200) !== 0 || data[6] || data[7];
  const counters: [number, number] | null = told ? [data[6] ?? 0, data[7] ?? 0] : null;
  return { kind: kinds.join(", "), place, sending: (bits & 0x80) !== 0, counters };
}

function errorMeaning(id: number, data: Uint8Array): Meaning {
  const { kind, place } = busErrorOf(id, data);
  const where = place && kind !== place ? ` in ${place}` : "";
  return { service: "error", node: 0, text: `error frame${kind && `: ${kind}`}${where}` };
}

interface SomeFrame {
  id: number;
  extended: boolean;
  remote: boolean;
  error: boolean;
  data: Uint8Array;
}

/** The same of a frame or of a report of an error. */
export function meaningOfFrame(frame: SomeFrame, isNode?: (node: number) => boolean): Meaning {
  const { id, extended, remote, error, data } = frame;
  return error ? errorMeaning(id, data) : meaningOf(id, extended, remote, data, isNode);
}

function emergency(node: number, data: Uint8Array): Meaning {
  const code = (data[0] ?? 0) | ((data[1] ?? 0) << 8);
  const text = code === 0 ? `EMCY of node ${node}: no error any more` : `EMCY of node ${node}: ${hex(code, 4)}`;
  return { service: "EMCY", node, text };
}

function pdo(base: number, node: number, isThere: boolean): Meaning {
  const number = ((base - 0x180) >> 8) + 1;
  const kind = base & 0x080 ? "TPDO" : "RPDO";
  const service = `PDO${number}` as Service;
  if (!isThere) return { service, node: 0, text: `PDO with COB-ID ${hex(base + node, 3)}` };
  return { service, node, text: `${kind} ${number} of node ${node}` };
}

function errorControl(node: number, remote: boolean, data: Uint8Array): Meaning {
  if (remote) return { service: "heartbeat", node, text: `Node guarding request to node ${node}` };
  const state = nmtStates[(data[0] ?? 0) & 0x7f] ?? "unknown state";
  return {
    service: "heartbeat",
    node,
    text: `${state === "boot-up" ? "Boot-up" : "Heartbeat"} of node ${node}: ${state}`,
  };
}

/** The clause that describes this kind of message. */
export const clauses: Record<Service, string> = {
  NMT: "CiA 301 §7.2.8.3",
  SYNC: "CiA 301 §7.2.5",
  EMCY: "CiA 301 §7.2.7",
  TIME: "CiA 301 §7.2.6",
  PDO1: "CiA 301 §7.2.2",
  PDO2: "CiA 301 §7.2.2",
  PDO3: "CiA 301 §7.2.2",
  PDO4: "CiA 301 §7.2.2",
  SDO: "CiA 301 §7.2.4",
  abort: "CiA 301 §7.2.4.3.17",
  heartbeat: "CiA 301 §7.2.8.3.2",
  LSS: "CiA 305 §6",
  RAND: "paper 1, docs/rand.md",
  error: "ISO 11898-1, error signalling",
  other: "",
};
