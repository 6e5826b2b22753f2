import { useEffect } from "react";
import { layoutsOf, type SignalsAnswer } from "../../can/signals";
import { useData, useStudio } from "../../window/context";
import { frameNumbered } from "../trace/reducer";

/** Asks the server once where the signals stand. One that does not know has none. */
export function useLayouts(): void {
  const { store, socket } = useStudio();
  const wanted = useData((state) => state.connection.phase === "open" && !state.signals.fresh);
  useEffect(() => {
    if (!wanted) return;
    let gone = false;
    const take = (answer: SignalsAnswer) => {
      if (!gone) store.dispatch({ type: "signals/layouts", layouts: layoutsOf(answer) });
    };
    socket
      .fetch("/api/v1/signals")
      .then(async (answer) => take(answer.ok ? ((await answer.json()) as SignalsAnswer) : { buses: [] }))
      .catch(() => undefined);
    return () => {
      gone = true;
    };
  }, [wanted, store, socket]);
}

const AROUND = 100;

/** Shows a frame of the machine where it stands in the trace; one that this page lacks is asked for. */
export function useGoToFrame(): (n: number) => void {
  const { store, socket } = useStudio();
  return (n) => {
    const { trace, view } = store.get();
    if (trace.file) store.dispatch({ type: "trace/file", file: null });
    if (!trace.paused) store.dispatch({ type: "trace/pause", paused: true });
    const mode = view.mode === "latest" ? "chronological" : view.mode;
    store.dispatch({ type: "view", change: { pane: "trace", frame: n, mode, filter: "" } });
    if (frameNumbered(store.get().trace.pieces, n)) return;
    socket.send({ type: "frames", id: `around ${n}`, from: Math.max(0, n - AROUND), count: 2 * AROUND });
  };
}

/** Shows a time in the plots, which are paused for it. */
export function useGoToTime(): (seconds: number) => void {
  const { store } = useStudio();
  return (seconds) => {
    store.dispatch({ type: "plots/pause", paused: true });
    store.dispatch({ type: "signals/at", seconds });
    store.dispatch({ type: "view", change: { pane: "plots" } });
  };
}
