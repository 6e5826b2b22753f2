import { createContext, useContext, useRef, useSyncExternalStore } from "react";
import { changes } from "../protocol/command";
import { createSocket, browserOutside, type Socket } from "../socket/socket";
import { firstState, reducer } from "../store/reducer";
import type { Verb } from "../protocol/messages";
import type { Action, Ask, State } from "../store/state";
import { createStore, type Store } from "../store/store";
import { parseView, type View } from "../store/view";

/** What components do: read the state, dispatch, send. */
export interface Studio {
  store: Store<State, Action>;
  socket: Socket;
}

export function createStudio(fragment: string): Studio {
  const store = createStore(reducer, reducer(firstState, { type: "view", change: parseView(fragment) }));
  return { store, socket: createSocket(store, browserOutside()) };
}

export const StudioContext = createContext<Studio | null>(null);

export function useStudio(): Studio {
  const studio = useContext(StudioContext);
  if (!studio) throw new Error("outside of StudioContext");
  return studio;
}

/** A part of the state. The component is drawn again when that part is another. */
export function useData<T>(select: (state: State) => T): T {
  const { store } = useStudio();
  const last = useRef<{ state: State; value: T } | null>(null);
  const get = () => {
    const state = store.get();
    if (last.current?.state !== state) {
      const value = select(state);
      const same = last.current && shallowEqual(last.current.value, value);
      last.current = { state, value: same && last.current ? last.current.value : value };
    }
    return last.current.value;
  };
  return useSyncExternalStore(store.subscribe, get, get);
}

function shallowEqual(a: unknown, b: unknown): boolean {
  if (Object.is(a, b)) return true;
  if (!Array.isArray(a) || !Array.isArray(b) || a.length !== b.length) return false;
  return a.every((entry, i) => Object.is(entry, b[i]));
}

export function useView(): [View, (change: Partial<View>) => void] {
  const { store } = useStudio();
  return [useData((state) => state.view), (change) => store.dispatch({ type: "view", change })];
}

/** On a real bus these can move a machine, and are confirmed. */
const moving =
  /^(nmt|boot|bind|replace|restore|backup restore|store|send|sdo write|program (download|start|stop|clear)|lss (set|bit|act|move))/;

/** On a real bus it is confirmed: what moves, and the doctor when he asks. */
function moves({ verb, values }: Ask, verbs: readonly Verb[]): boolean {
  if (moving.test(verb)) return true;
  const entry = verbs.find((candidate) => candidate.name === verb);
  return verb === "doctor" && entry !== undefined && changes(entry, values);
}

/** Sends requests, or asks for a yes before those that can move a real machine. */
export function act(studio: Studio, asks: readonly Ask[]): void {
  const { data } = studio.store.get();
  if (data.lock.real && asks.some((ask) => moves(ask, data.verbs))) {
    studio.store.dispatch({ type: "window", change: { confirming: asks } });
    return;
  }
  sendAll(studio, asks);
}

/** Of a client the server takes eight at once. */
const MOST_AT_ONCE = 4;

/** One after the other, a few at once. */
export function sendAll({ store, socket }: Studio, asks: readonly Ask[]): void {
  const ids = new Set<string>();
  let next = 0;
  let busy = false;
  const open = () => store.get().requests.filter((sent) => ids.has(sent.id) && !sent.done).length;
  const step = () => {
    if (busy) return;
    busy = true;
    while (next < asks.length && open() < MOST_AT_ONCE) {
      const ask = asks[next++];
      if (ask) ids.add(socket.request(ask.verb, ask.values, ask.owner));
    }
    busy = false;
    if (next >= asks.length) forget();
  };
  const forget = store.subscribe(step);
  step();
}
