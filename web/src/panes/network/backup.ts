/** A DCF that a person chose, packed. */
export interface ChosenDcf {
  name: string;
  dcf: string;
}

/** With its arguments a message has 65,536 bytes at most. */
export const MOST_DIGITS = 60_000;

/** What one device gave. */
export interface SavedDevice {
  bus: string;
  node: number;
  name: string;
  read: number;
  refused: number;
  /** Packed; empty: there is none, and `problem` says why. */
  dcf: string;
  problem: string;
}

export interface Comparison {
  result: string;
  compared: number;
  written: number;
  differences: { object: string; name: string; has: string; wants: string }[];
  refused: { object: string; name: string; why: string }[];
}

type Json = Record<string, unknown>;
const isJson = (value: unknown): value is Json => typeof value === "object" && value !== null;
const textOf = (value: unknown): string => (typeof value === "string" ? value : "");
const numberOf = (value: unknown): number => (typeof value === "number" ? value : 0);
const listOf = (value: unknown): Json[] => (Array.isArray(value) ? value.filter(isJson) : []);

export function savedOf(reply: unknown): SavedDevice[] {
  if (!isJson(reply)) return [];
  return listOf(reply.backups).map((json) => ({
    bus: textOf(json.bus),
    node: numberOf(json.node),
    name: textOf(json.slot) || `node ${numberOf(json.node)}`,
    read: numberOf(json.read),
    refused: numberOf(json.refused),
    dcf: textOf(json.dcf),
    problem: textOf(json.problem),
  }));
}

/** Null: the reply is of something else. */
export function comparisonOf(reply: unknown): Comparison | null {
  if (!isJson(reply) || typeof reply.result !== "string" || !Array.isArray(reply.differences)) return null;
  return {
    result: reply.result,
    compared: numberOf(reply.compared),
    written: numberOf(reply.written),
    differences: listOf(reply.differences).map((json) => ({
      object: objectOf(json.object),
      name: textOf(json.name),
      has: "has" in json ? textOf(json.has) : "cannot be read",
      wants: textOf(json.wants),
    })),
    refused: listOf(reply.refused).map((json) => ({
      object: objectOf(json.object),
      name: textOf(json.name),
      why: textOf(json.why),
    })),
  };
}

/** "0x1017:00" -> "1017h:00" */
function objectOf(value: unknown): string {
  return textOf(value).replace(/^0x([0-9a-f]{4}):/i, (_, index: string) => `${index.toUpperCase()}h:`);
}
