import type { Action, State } from "../../store/state";

/** A slot of another machine, as it publishes it. */
export interface FleetSlot {
  name: string;
  state: string;
  reason: string;
  emcy: string;
  configuration: string;
  program: string;
  needs: boolean;
}

/** A machine at the broker, as `berth fleet --json` has it. */
export interface FleetMachine {
  group: string;
  name: string;
  online: boolean;
  inDoubt: boolean;
  isBerth: boolean;
  operational: boolean;
  needs: boolean;
  version: string;
  /** Address of its Studio, as it says itself; empty: it has none. */
  studio: string;
  sinceMs: number;
  busTrouble: string[];
  slots: FleetSlot[];
}

export interface FleetState {
  /** By `machineKey`. */
  machines: Readonly<Record<string, FleetMachine>>;
  /** What to ask with next. */
  changes: number;
  /** There is more that was not sent yet. */
  more: boolean;
  /** Null: no answer yet. */
  connected: boolean | null;
  trouble: string;
  search: string;
  /** The machine whose slots are shown; empty: none. */
  open: string;
}

export type FleetAction = { type: "fleet/search"; search: string } | { type: "fleet/open"; open: string };

export const firstFleet: FleetState = {
  machines: {},
  changes: 0,
  more: false,
  connected: null,
  trouble: "",
  search: "",
  open: "",
};

export const machineKey = ({ group, name }: Pick<FleetMachine, "group" | "name">): string => `${group}/${name}`;

export function fleetReducer(state: FleetState, action: Action, { requests }: Pick<State, "requests">): FleetState {
  if (action.type === "fleet/search") return { ...state, search: action.search };
  if (action.type === "fleet/open") return { ...state, open: action.open };
  if (action.type !== "message" || action.message.type !== "reply") return state;
  const { id, status, reply, error } = action.message;
  if (requests.find((sent) => sent.id === id)?.verb !== "fleet") return state;
  return status === 0 ? withAnswer(state, reply) : { ...state, more: false, connected: false, trouble: error };
}

function withAnswer(state: FleetState, reply: unknown): FleetState {
  if (!isJson(reply) || typeof reply.changes !== "number") return state;
  const next = {
    ...state,
    changes: reply.changes,
    more: reply.more === true,
    connected: reply.connected === true,
    trouble: textOf(reply.trouble),
  };
  if (!Array.isArray(reply.machines)) return next;
  const news = reply.machines.filter(isJson).map(machineOf);
  const before = reply.whole === true ? {} : state.machines;
  return { ...next, machines: { ...before, ...Object.fromEntries(news.map((each) => [machineKey(each), each])) } };
}

type Json = Record<string, unknown>;
const isJson = (value: unknown): value is Json => typeof value === "object" && value !== null;
const textOf = (value: unknown): string => (typeof value === "string" ? value : "");
const listOf = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);

function machineOf(json: Json): FleetMachine {
  return {
    group: textOf(json.group),
    name: textOf(json.machine),
    online: json.online === true,
    inDoubt: json.in_doubt === true,
    isBerth: json.is_berth === true,
    operational: json.operational === true,
    needs: json.needs_somebody === true,
    version: textOf(json.version),
    studio: textOf(json.studio),
    sinceMs: typeof json.since_ms === "number" ? json.since_ms : 0,
    busTrouble: listOf(json.bus_trouble).map(textOf),
    slots: listOf(json.slots).filter(isJson).map(slotOf),
  };
}

function slotOf(json: Json): FleetSlot {
  return {
    name: textOf(json.name),
    state: textOf(json.state),
    reason: textOf(json.reason),
    emcy: textOf(json.emcy),
    configuration: textOf(json.configuration),
    program: textOf(json.program),
    needs: json.needs_somebody === true,
  };
}

const byName = new Intl.Collator("en", { numeric: true });

/** Those that need somebody first, then by name: "line 2" before "line 10". */
export function ordered(machines: Readonly<Record<string, FleetMachine>>): FleetMachine[] {
  return Object.values(machines).sort(
    (a, b) => Number(b.needs) - Number(a.needs) || byName.compare(a.name, b.name) || byName.compare(a.group, b.group),
  );
}

/** Of several slots the mark of the worst one says how the machine is. */
const worst = ["failed", "duplicate", "wrong type", "question", "power cycle needed", "absent", "empty"];

/** In a word, and by the shape that a slot of that state has. */
export function stateOf(machine: FleetMachine): { word: string; mark: string } {
  if (!machine.online) return { word: "offline", mark: "absent" };
  if (machine.inDoubt) return { word: "in doubt", mark: "unknown" };
  if (!machine.isBerth) return { word: "online", mark: "present" };
  if (machine.busTrouble.length) return { word: machine.busTrouble.join(", "), mark: "failed" };
  if (machine.operational) return { word: "operational", mark: "operational" };
  const states = machine.slots.filter((slot) => slot.needs).map((slot) => slot.state);
  const bad = worst.find((state) => states.includes(state));
  return { word: "not operational", mark: bad ?? states[0] ?? "unknown" };
}

/** "3 of 4 slots operational" */
export function slotsWords({ slots }: FleetMachine): string {
  if (!slots.length) return "";
  const good = slots.filter((slot) => slot.state === "operational").length;
  return `${good} of ${slots.length} ${slots.length === 1 ? "slot" : "slots"} operational`;
}

/** "2 of 3 machines need somebody" */
export function headline(machines: readonly FleetMachine[]): string {
  const needing = machines.filter((machine) => machine.needs).length;
  const all = machines.length === 1 ? "1 machine" : `${machines.length} machines`;
  return needing ? `${needing} of ${all} ${needing === 1 ? "needs" : "need"} somebody` : `${all}, none needs somebody`;
}

/** "3 min": the largest unit alone, as `berth fleet` has it. */
export function ageWords(nowMs: number, sinceMs: number): string {
  const seconds = Math.max(0, Math.floor((nowMs - sinceMs) / 1000));
  if (seconds < 60) return `${seconds} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  if (seconds < 48 * 3600) return `${Math.floor(seconds / 3600)} h`;
  return `${Math.floor(seconds / 86_400)} d`;
}

/** Each word is in the machine's name, version or state, or in one of its slots that need somebody. */
export function found(machines: readonly FleetMachine[], search: string): FleetMachine[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  if (!words.length) return [...machines];
  return machines.filter((machine) => {
    const needy = machine.slots.filter((slot) => slot.needs);
    const slots = needy.map(({ name, state, reason, emcy }) => `${name} ${state} ${reason} ${emcy}`);
    const { group, name, version } = machine;
    const all = [group, name, version, stateOf(machine).word, ...slots].join("\n").toLowerCase();
    return words.every((word) => all.includes(word));
  });
}

const isLoopback = (host: string): boolean => /^(localhost|.*\.localhost|127(\.\d+){3}|\[::1\])$/.test(host);

/**
 * Where a press on a machine leads; null: nowhere. The address comes from another machine: only a page is opened, and
 * one of loopback only from there, because elsewhere it would be another computer's.
 */
export function studioLink(address: string, pageHost: string): string | null {
  let url;
  try {
    url = new URL(address);
  } catch {
    return null;
  }
  if (!/^https?:$/.test(url.protocol) || url.username || url.password) return null;
  if (isLoopback(url.hostname) && !isLoopback(pageHost)) return null;
  return url.origin + url.pathname;
}
