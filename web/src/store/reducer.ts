import { dictionaryReducer, firstDictionary } from "../panes/dictionary/reducer";
import { doctorReducer, firstDoctor } from "../panes/doctor/reducer";
import { firstFleet, fleetReducer } from "../panes/fleet/reducer";
import { firstMachine, machineReducer } from "../panes/machine/reducer";
import { firstNetwork, networkReducer } from "../panes/network/reducer";
import { firstPlots, plotsReducer } from "../panes/plots/reducer";
import { firstSignals, signalsReducer } from "../panes/plots/signals";
import { firstSlots, slotsReducer } from "../panes/slots/reducer";
import { firstTrace, traceReducer } from "../panes/trace/reducer";
import { firstWorld, worldReducer } from "../panes/world/reducer";
import type { Change, Event, Rates, ServerMessage, Slot, Snapshot } from "../protocol/messages";
import { slotKey } from "./keys";
import type { Action, Data, Sent, State } from "./state";
import { changedView, firstView } from "./view";

const MOST_EVENTS = 5000;
const MOST_REQUESTS = 200;
const MOST_LOADS = 240;

export const firstState: State = {
  connection: { phase: "no-token" },
  data: {
    seq: -1,
    start: "",
    machine: { name: "", simulated: false, file: "" },
    buses: [],
    slots: [],
    events: [],
    questions: [],
    world: null,
    time: 0,
    verbs: [],
    lock: { real: false, unlocked_until_s: null },
    role: "view",
    tokenFile: "",
  },
  rates: null,
  loads: [],
  requests: [],
  view: firstView,
  window: {
    palette: false,
    help: false,
    eventsOpen: true,
    treeOpen: true,
    inspectorOpen: true,
    theme: "system",
    confirming: null,
    notice: "",
  },
  slots: firstSlots,
  trace: firstTrace,
  machine: firstMachine,
  dictionary: firstDictionary,
  network: firstNetwork,
  plots: firstPlots,
  signals: firstSignals,
  doctor: firstDoctor,
  world: firstWorld,
  fleet: firstFleet,
};

export function reducer(state: State, action: Action): State {
  const next = windowReducer(state, action);
  return {
    ...next,
    slots: slotsReducer(next.slots, action, next),
    trace: traceReducer(next.trace, action, next),
    machine: machineReducer(next.machine, action, next),
    dictionary: dictionaryReducer(next.dictionary, action, next),
    network: networkReducer(next.network, action),
    plots: plotsReducer(next.plots, action, next),
    signals: signalsReducer(next.signals, action, next),
    doctor: doctorReducer(next.doctor, action),
    world: worldReducer(next.world, action, next),
    fleet: fleetReducer(next.fleet, action, next),
  };
}

function windowReducer(state: State, action: Action): State {
  switch (action.type) {
    case "connection":
      return { ...state, connection: action.connection };
    case "message":
      return messageReducer(state, action.message, action.now);
    case "sent":
      return { ...state, requests: [...keptRequests(state.requests, action.owner), pending(action)] };
    case "lost":
      return withAnswer(state, action.id, { status: 3, error: action.error });
    case "view":
      return { ...state, view: changedView(state.view, action.change) };
    case "window":
      return { ...state, window: { ...state.window, ...action.change } };
    default:
      return state;
  }
}

function messageReducer(state: State, message: ServerMessage, now: number): State {
  switch (message.type) {
    case "snapshot":
      return withSnapshot(state, dataOf(message));
    case "change":
      return changed(state, message);
    case "reply": {
      const { status, reply, lines, error } = message;
      return withAnswer(state, message.id, { status, reply, lines, error });
    }
    case "rates":
      return { ...withTime(state, message), rates: message, loads: withLoads(state.loads, message, now) };
    case "frames":
      return state;
  }
}

/** After another start of the server, frames and changes are numbered anew: those of before, and what was measured on frames, go. */
function withSnapshot(state: State, data: Data): State {
  const next = { ...state, connection: { phase: "open" as const }, data };
  if (state.data.seq < 0 || data.start === state.data.start) return next;
  const { trace, plots, fleet, view } = state;
  return {
    ...next,
    rates: null,
    loads: [],
    trace: { ...firstTrace, filter: trace.filter, file: trace.file },
    plots: { ...firstPlots, every: plots.every },
    fleet: { ...firstFleet, search: fleet.search },
    view: { ...view, frame: null, marks: [], zero: null },
  };
}

function dataOf(snapshot: Snapshot): Data {
  const { seq, machine, buses, slots, events, questions, time_s, verbs, lock, role, world = null } = snapshot;
  const tokenFile = snapshot.token_file ?? "";
  return {
    seq,
    start: snapshot.start ?? "",
    machine,
    buses,
    slots,
    events: events.slice(-MOST_EVENTS),
    questions,
    world,
    time: time_s,
    verbs,
    lock,
    role,
    tokenFile,
  };
}

/** A change that is not the next one leaves the copy as it is, and says that it is no good any more. */
function changed(state: State, change: Change): State {
  const { data } = state;
  if (state.connection.phase === "gap") return state;
  if (data.seq < 0 || change.seq !== data.seq + 1) return { ...state, connection: { phase: "gap" } };
  return {
    ...state,
    data: {
      ...data,
      seq: change.seq,
      time: change.time_s,
      slots: mergedSlots(data.slots, change.slots),
      events: mergedEvents(data.events, change.events),
      questions: change.questions ?? data.questions,
      lock: change.lock ?? data.lock,
      world: change.world ?? data.world,
    },
  };
}

/** Time goes on also while nothing changes. */
function withTime(state: State, { world }: Rates): State {
  return world ? { ...state, data: { ...state.data, world, time: world.time_s } } : state;
}

function mergedSlots(slots: Slot[], news: Slot[] | undefined): Slot[] {
  if (!news?.length) return slots;
  const fresh = new Map(news.map((slot) => [slotKey(slot), slot]));
  const merged = slots.map((slot) => {
    const key = slotKey(slot);
    const replacement = fresh.get(key);
    fresh.delete(key);
    return replacement ?? slot;
  });
  return [...merged, ...fresh.values()];
}

function mergedEvents(events: Event[], news: Event[] | undefined): Event[] {
  return news?.length ? [...events, ...news].slice(-MOST_EVENTS) : events;
}

/** Of what is read again and again the last reading only: the others would push out what a person asked for. */
function keptRequests(requests: Sent[], owner: string): Sent[] {
  const kept = /^(watch|look):/.test(owner) ? requests.filter((sent) => sent.owner !== owner || !sent.done) : requests;
  return kept.slice(1 - MOST_REQUESTS);
}

function pending(action: { id: string; verb: string; values: Record<string, string>; owner: string }): Sent {
  const { id, verb, values, owner } = action;
  return { id, verb, values, owner, done: false, status: 0, answeredS: 0, reply: null, lines: [], error: "" };
}

function withAnswer(state: State, id: string, answer: Partial<Sent>): State {
  const answered = { ...answer, done: true, answeredS: state.data.time };
  return { ...state, requests: state.requests.map((sent) => (sent.id === id ? { ...sent, ...answered } : sent)) };
}

function withLoads(loads: State["loads"], rates: Rates, now: number): State["loads"] {
  return [...loads, { at: now, loads: rates.buses.map((bus) => bus.load) }].slice(-MOST_LOADS);
}
