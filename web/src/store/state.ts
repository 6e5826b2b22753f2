import type { Batch } from "../protocol/batch";
import type {
  Bus,
  Event,
  Lock,
  Machine,
  Rates,
  Role,
  ServerMessage,
  Slot,
  Verb,
  WorldTime,
} from "../protocol/messages";
import type { DictionaryAction, DictionaryState } from "../panes/dictionary/reducer";
import type { DoctorAction, DoctorState } from "../panes/doctor/reducer";
import type { FleetAction, FleetState } from "../panes/fleet/reducer";
import type { MachineAction, MachineState } from "../panes/machine/reducer";
import type { NetworkAction, NetworkState } from "../panes/network/reducer";
import type { PlotsAction, PlotsState } from "../panes/plots/reducer";
import type { SignalsAction, SignalsState } from "../panes/plots/signals";
import type { SlotsAction, SlotsState } from "../panes/slots/reducer";
import type { TraceAction, TraceState } from "../panes/trace/reducer";
import type { WorldAction, WorldState } from "../panes/world/reducer";
import type { View } from "./view";

export type Connection =
  | { phase: "no-token" }
  | { phase: "connecting"; attempt: number }
  | { phase: "open" }
  /** A change was missing: the copy is wrong until a new snapshot comes. */
  | { phase: "gap" }
  | { phase: "waiting"; attempt: number; seconds: number }
  | { phase: "refused" };

/** A request that may be sent. */
export interface Ask {
  verb: string;
  values: Record<string, string>;
  /** What the command line has instead of the values: a file's name instead of its content. */
  shown?: Record<string, string>;
  owner: string;
}

/** A request that was sent, and its answer once it is there. */
export interface Sent {
  id: string;
  verb: string;
  values: Record<string, string>;
  /** Who asked: "slots", "dictionary:field/3"; a pane finds its own by it. */
  owner: string;
  done: boolean;
  status: number;
  /** The bus time when its answer came. */
  answeredS: number;
  reply: unknown;
  lines: string[];
  error: string;
}

export interface Data {
  /** -1: no snapshot yet */
  seq: number;
  /** Which start of the server this is. */
  start: string;
  machine: Machine;
  buses: Bus[];
  slots: Slot[];
  events: Event[];
  /** That are open. */
  questions: Event[];
  world: WorldTime | null;
  /** Bus time of the last message. */
  time: number;
  verbs: Verb[];
  lock: Lock;
  role: Role;
  /** On the server's computer: where this page's token stands; empty: nowhere. */
  tokenFile: string;
}

export interface Window {
  palette: boolean;
  help: boolean;
  eventsOpen: boolean;
  treeOpen: boolean;
  inspectorOpen: boolean;
  theme: "system" | "light" | "dark";
  /** Requests that can move a machine and wait for a yes. */
  confirming: readonly Ask[] | null;
  /** What was copied last, to be said to a screen reader. */
  notice: string;
}

export interface State {
  connection: Connection;
  data: Data;
  rates: Rates | null;
  /** Frames a second and load of each bus over the last minute, a point a message. */
  loads: { at: number; loads: number[] }[];
  requests: Sent[];
  view: View;
  window: Window;
  slots: SlotsState;
  trace: TraceState;
  machine: MachineState;
  dictionary: DictionaryState;
  network: NetworkState;
  plots: PlotsState;
  signals: SignalsState;
  doctor: DoctorState;
  world: WorldState;
  fleet: FleetState;
}

export type Action =
  | { type: "connection"; connection: Connection }
  | { type: "message"; message: ServerMessage; now: number }
  | { type: "batch"; batch: Batch }
  | { type: "sent"; id: string; verb: string; values: Record<string, string>; owner: string }
  | { type: "lost"; id: string; error: string }
  | { type: "view"; change: Partial<View> }
  | { type: "window"; change: Partial<Window> }
  | SlotsAction
  | TraceAction
  | MachineAction
  | DictionaryAction
  | NetworkAction
  | PlotsAction
  | SignalsAction
  | DoctorAction
  | WorldAction
  | FleetAction;
