import type { Event, Slot, Verb } from "../../protocol/messages";
import type { Action } from "../../store/state";
import type { ChosenDcf } from "./backup";

export interface NetworkState {
  /** The verb whose form is shown. */
  verb: string;
  values: Readonly<Record<string, string>>;
  /** The DCF that devices are compared with. */
  chosen: ChosenDcf | null;
  /** Why the file that was chosen is none. */
  dcfProblem: string;
}

export type NetworkAction =
  | { type: "network/verb"; verb: string }
  | { type: "network/value"; name: string; value: string }
  | { type: "network/dcf"; chosen: ChosenDcf | null; problem: string };

/** Not a verb: the story of the boot-ups. */
export const BOOT_LOG = "boot log";
/** Nor this: three verbs about one DCF. */
export const BACKUP = "backup and restore";

export const firstNetwork: NetworkState = { verb: BOOT_LOG, values: {}, chosen: null, dcfProblem: "" };

export function networkReducer(network: NetworkState, action: Action): NetworkState {
  if (action.type === "network/verb") return { ...network, verb: action.verb, values: {} };
  if (action.type === "network/value") {
    return { ...network, values: { ...network.values, [action.name]: action.value } };
  }
  if (action.type === "network/dcf") return { ...network, chosen: action.chosen, dcfProblem: action.problem };
  return network;
}

/** Verbs that another pane does better; and `boot`, which a Berth that runs the machine always refuses. */
const elsewhere =
  /^(report|sdo (read|write|dump|probe)|sim |world |history|replace|forget|upload|doctor|backup |boot$)/;

export function groupsOf(verbs: readonly Verb[]): { title: string; verbs: Verb[] }[] {
  const mine = verbs.filter((verb) => !elsewhere.test(verb.name));
  const groups = new Map<string, Verb[]>();
  for (const verb of mine) {
    const title = titleOf(verb.name);
    groups.set(title, [...(groups.get(title) ?? []), verb]);
  }
  return [...groups].map(([title, list]) => ({ title, verbs: list }));
}

function titleOf(name: string): string {
  if (name.startsWith("lss ")) return "LSS";
  if (name.startsWith("program ")) return "Programs";
  if (name.startsWith("sdo ")) return "SDO channels";
  if (/^(scan|bind|configure|nmt|locate)$/.test(name)) return "Bus";
  return "Device";
}

/** What a form still misses, or an empty list. */
export function missingOf(verb: Verb, values: Readonly<Record<string, string>>): string[] {
  return verb.parameters.filter((p) => p.required && !values[p.name]).map((p) => p.name);
}

export interface BootStory {
  slot: Slot;
  lines: Event[];
}

/** Each slot's events from its last beginning on. */
export function bootStories(slots: readonly Slot[], events: readonly Event[]): BootStory[] {
  return slots.map((slot) => {
    const mine = events.filter((event) => event.bus === slot.bus && event.slot === slot.name);
    const start = mine.findLastIndex((event) => /^(binding|absent|empty)/.test(event.text));
    return { slot, lines: mine.slice(Math.max(0, start)) };
  });
}
