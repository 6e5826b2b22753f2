import type { Verb } from "../../protocol/messages";
import type { Action } from "../../store/state";

/** What is asked of the bus beside listening. */
export const questions = ["listen", "lss", "sdo", "conformance"] as const;
export type Questions = (typeof questions)[number];

export interface DoctorState {
  questions: Questions;
  /** Seconds; empty: as long as the machine file's heartbeat times ask for. */
  seconds: string;
  /** Of an examination: what passed, too. */
  all: boolean;
}

export type DoctorAction = { type: "doctor"; change: Partial<DoctorState> };

export const firstDoctor: DoctorState = { questions: "listen", seconds: "", all: false };

export function doctorReducer(doctor: DoctorState, action: Action): DoctorState {
  return action.type === "doctor" ? { ...doctor, ...action.change } : doctor;
}

/** The request; null: something is still missing. */
export function requestOf(doctor: DoctorState, bus: string, node: string): Record<string, string> | null {
  if (doctor.questions === "conformance") return node && bus ? { bus, conformance: node } : null;
  const values: Record<string, string> = {};
  const seconds = doctor.seconds.trim();
  if (seconds !== "") {
    const n = Number(seconds);
    if (!Number.isInteger(n) || n < 1 || n > 600) return null;
    values.for = seconds;
  }
  if (doctor.questions === "lss") values.active = "1";
  if (doctor.questions === "sdo") values.intrusive = "1";
  return values;
}

/** This server's doctor examines a device, too. */
export function examines(verbs: readonly Verb[]): boolean {
  return verbs.some((verb) => verb.name === "doctor" && verb.parameters.some((p) => p.name === "conformance"));
}

export type Certainty = "certain" | "likely" | "possible";

export interface Finding {
  kind: string;
  certainty: Certainty;
  bus: string;
  node: number | null;
  slot: string;
  what: string;
  evidence: string[];
  todo: string;
  /** What the trace is filtered by to see it; empty: no identifier tells it. */
  filter: string;
}

export interface Check {
  paragraph: string;
  /** "1018h:04"; empty: it is about a service. */
  object: string;
  what: string;
  verdict: string;
  told: string;
}

type Json = Record<string, unknown>;
const isJson = (value: unknown): value is Json => typeof value === "object" && value !== null;
const textOf = (value: unknown): string => (typeof value === "string" ? value : "");
const listOf = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);

const rank: Record<Certainty, number> = { certain: 0, likely: 1, possible: 2 };

/** The surest first; of equally sure ones the order of the doctor. */
export function findingsOf(reply: unknown): Finding[] {
  if (!isJson(reply)) return [];
  const findings = listOf(reply.findings).filter(isJson).map(findingOf);
  return findings.sort((a, b) => rank[a.certainty] - rank[b.certainty]);
}

function findingOf(json: Json): Finding {
  const certainty = json.certainty === "certain" || json.certainty === "likely" ? json.certainty : "possible";
  const node = typeof json.node === "number" ? json.node : null;
  const finding = {
    kind: textOf(json.kind),
    certainty: certainty as Certainty,
    bus: textOf(json.bus),
    node,
    slot: textOf(json.slot),
    what: textOf(json.what),
    evidence: listOf(json.evidence).map(textOf),
    todo: textOf(json.do),
  };
  return { ...finding, filter: filterOf(finding.kind, node, textOf(json.cob_id)) };
}

/** The identifier whose frames the finding speaks of. */
function filterOf(kind: string, node: number | null, cobId: string): string {
  if (cobId) return `${cobId.replace(/^0x/i, "")}#`;
  if (node === null) return "";
  const base = kind === "error-passive" || kind === "overload" ? 0x080 : 0x700;
  return `${(base + node).toString(16).toUpperCase().padStart(3, "0")}#`;
}

/** Failed first, then skipped, then passed. */
export function checksOf(reply: unknown): Check[] {
  if (!isJson(reply)) return [];
  const order = ["failed", "skipped", "passed"];
  const checks = listOf(reply.checks).filter(isJson).map(checkOf);
  return checks.sort((a, b) => order.indexOf(a.verdict) - order.indexOf(b.verdict));
}

function checkOf(json: Json): Check {
  const index = textOf(json.index).replace(/^0x/i, "").toUpperCase();
  const sub = Number(json.sub ?? 0)
    .toString(16)
    .toUpperCase();
  return {
    paragraph: textOf(json.paragraph),
    object: index ? `${index}h:${sub.padStart(2, "0")}` : "",
    what: textOf(json.what),
    verdict: textOf(json.verdict),
    told: textOf(json.told),
  };
}

/** "5.0 s, 812 frames on 1 bus; nothing was asked" */
export function summaryOf(reply: unknown): string {
  if (!isJson(reply)) return "";
  if (Array.isArray(reply.checks)) {
    return `${String(reply.passed)} checks passed, ${String(reply.failed)} failed, ${String(reply.skipped)} skipped`;
  }
  const buses = listOf(reply.buses).filter(isJson);
  if (typeof reply.listened_s !== "number" || !buses.length) return "";
  const frames = buses.reduce((sum, bus) => sum + (typeof bus.frames === "number" ? bus.frames : 0), 0);
  const told = `${reply.listened_s.toFixed(1)} s, ${frames} frames on ${buses.length} ${buses.length === 1 ? "bus" : "buses"}`;
  const silent = listOf(reply.without_port).map(textOf);
  const unheard = silent.length ? `; not heard, because Berth has no port there: ${silent.join(", ")}` : "";
  return `${told}; asked: ${textOf(reply.asked)}${unheard}`;
}
