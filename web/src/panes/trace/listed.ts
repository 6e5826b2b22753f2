import type { Frame } from "../../protocol/batch";
import { slotKey } from "../../store/keys";
import type { Action, State } from "../../store/state";
import type { Store } from "../../store/store";
import type { View } from "../../store/view";
import { useData, useStudio } from "../../window/context";
import { listedOf, meaningIn, type Listed, type Picked } from "./reducer";

/** What the pane shows: the machine's frames, or those of a file that is open. */
export function useListed(): Listed {
  const [list, known, picked, file] = useData((state) => {
    const { list, known, picked, file } = listedOf(state);
    return [list, known, picked, file] as const;
  });
  return { list, known, picked, file };
}

const picks = new Set<string>(["frame", "marks", "zero"]);

/** What is chosen goes into the address. Of a file only what belongs to the machine does: a link does not bring the file. */
export function choose(store: Store<State, Action>, change: Partial<View>): void {
  if (!listedOf(store.get()).file) return store.dispatch({ type: "view", change });
  const parts = (own: boolean) => Object.fromEntries(Object.entries(change).filter(([key]) => picks.has(key) === own));
  const picked: Partial<Picked> = parts(true);
  const rest: Partial<View> = parts(false);
  if (Object.keys(picked).length) store.dispatch({ type: "trace/pick", change: picked });
  if (Object.keys(rest).length) store.dispatch({ type: "view", change: rest });
}

/** Shows the error frames of a bus. A file that is open goes: these are the machine's. */
export function useErrorFrames(): (bus: string) => void {
  const { store } = useStudio();
  return (bus) => {
    store.dispatch({ type: "trace/file", file: null });
    const change = { pane: "trace", mode: "chronological", filter: `${bus} error frame` } as const;
    store.dispatch({ type: "view", change });
  };
}

/** Chooses a frame, its slot and its object; a list that follows is paused. */
export function useSelect(): (frame: Frame) => void {
  const { store } = useStudio();
  return (frame) => {
    const { list, known } = listedOf(store.get());
    const { node, object } = meaningIn(frame, known);
    const bus = known.buses[frame.bus];
    const slot = store.get().data.slots.find((entry) => entry.bus === bus && entry.id === node);
    const chosen = slot && object ? object : "";
    choose(store, { frame: frame.n, object: chosen, ...(slot ? { slot: slotKey(slot) } : {}) });
    if (!list.paused) store.dispatch({ type: "trace/pause", paused: true });
  };
}
