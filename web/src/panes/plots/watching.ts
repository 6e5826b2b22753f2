import { useEffect, useRef } from "react";
import { slotKey } from "../../store/keys";
import { useStudio } from "../../window/context";
import { createTurns, MOST_FAILURES, watchOwner, watchParts } from "./reducer";

const LOOKS_MS = 100;

/** Reads the watched objects in turn, one request under way at a time, as long as a pane that shows them is seen. */
export function useWatching(): void {
  const { store, socket } = useStudio();
  const turns = useRef(createTurns());
  useEffect(() => {
    let asked = "";
    const timer = setInterval(() => {
      const { view, plots, data, connection, requests } = store.get();
      const stopped = plots.paused !== null || plots.failures >= MOST_FAILURES || document.hidden;
      if (stopped || connection.phase !== "open" || !view.watch.length) return;
      if (requests.some((sent) => sent.id === asked && !sent.done)) return;
      const key = turns.current(performance.now() / 1000, view.watch, plots.every);
      const { slot, object } = watchParts(key ?? "");
      const found = data.slots.find((entry) => slotKey(entry) === slot);
      if (!key || !found) return;
      asked = socket.request("sdo read", { bus: found.bus, node: found.name, object }, watchOwner(key));
    }, LOOKS_MS);
    return () => clearInterval(timer);
  }, [store, socket]);
}
