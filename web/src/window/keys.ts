import { useEffect } from "react";
import { choose } from "../panes/trace/listed";
import { listedOf, markChange } from "../panes/trace/reducer";
import { useStudio } from "./context";
import { usePanes } from "./Panes";

/** Keys of the whole window. docs/studio.md lists them. */
export function useKeys(): void {
  const { store } = useStudio();
  const panes = usePanes();
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "k") {
        event.preventDefault();
        store.dispatch({ type: "window", change: { palette: !store.get().window.palette } });
        return;
      }
      const pane = event.altKey ? panes[Number(event.key) - 1] : undefined;
      if (pane) {
        event.preventDefault();
        store.dispatch({ type: "view", change: { pane: pane.name } });
        return;
      }
      const writing = event.target instanceof HTMLElement && /^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName);
      // A dialog has its own keys.
      const dialog = document.querySelector("dialog[open]") !== null;
      if (writing || dialog || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "?") store.dispatch({ type: "window", change: { help: true } });
      if (event.key === "/") {
        const search = document.querySelector<HTMLInputElement>("#pane input[type=search]");
        if (search) event.preventDefault();
        search?.focus();
      }
      if (event.key === "p" && store.get().view.pane === "trace" && !store.get().trace.file) {
        store.dispatch({ type: "trace/pause", paused: !store.get().trace.paused });
      }
      const { view } = store.get();
      if (event.key === "p" && view.pane === "plots") {
        store.dispatch({ type: "plots/pause", paused: !store.get().plots.paused });
      }
      const { picked } = listedOf(store.get());
      if (event.key === "m" && view.pane === "trace" && picked.frame !== null) {
        choose(store, markChange(picked, picked.frame));
      }
      if (event.key === "Escape") {
        choose(store, { slot: "", device: "", frame: null, object: "" });
      }
    };
    window.addEventListener("keydown", onKey);
    return () => window.removeEventListener("keydown", onKey);
  }, [store, panes]);
}
