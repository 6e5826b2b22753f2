import { useEffect } from "react";
import { count } from "../../protocol/text";
import { useData, useStudio, useView } from "../../window/context";
import { markChange } from "./reducer";
import { timeWords, useZero } from "./rows";

/** The frames with a marker: a press goes there, and says what times count from. */
export function Marks() {
  const { socket, store } = useStudio();
  const [view, setView] = useView();
  const [marked, open] = useData((state) => [state.trace.marked, state.connection.phase === "open"] as const);
  const zero = useZero();
  const unknown = view.marks.filter((n) => !marked.has(n)).join(",");
  // A link brings markers of frames that the page never saw.
  useEffect(() => {
    if (!open || !unknown) return;
    for (const n of unknown.split(",")) socket.send({ type: "frames", id: `mark ${n}`, from: Number(n), count: 1 });
  }, [open, unknown, socket]);
  if (!view.marks.length) return null;
  const go = (n: number) => {
    if (!store.get().trace.paused) store.dispatch({ type: "trace/pause", paused: true });
    setView({ frame: n, ...(view.mode === "latest" ? { mode: "chronological" } : {}) });
  };
  return (
    <div className="bar marks" role="group" aria-label="Markers">
      <label>
        Times from
        <select
          value={view.zero ?? ""}
          onChange={(event) => setView({ zero: event.target.value === "" ? null : Number(event.target.value) })}
        >
          <option value="">the start</option>
          {view.marks.map((n) => (
            <option key={n} value={n}>
              frame {count(n)}
            </option>
          ))}
        </select>
      </label>
      {view.marks.map((n) => {
        const seconds = marked.get(n);
        return (
          <span key={n} className="switch">
            <button type="button" aria-pressed={view.frame === n} onClick={() => go(n)}>
              ⚑ {count(n)}
              <span className="number quiet">
                {seconds === undefined ? " not in the ring" : ` ${timeWords(seconds, zero)} s`}
              </span>
            </button>
            <button
              type="button"
              aria-label={`Take the marker of frame ${count(n)} away`}
              onClick={() => setView(markChange(view, n))}
            >
              ×
            </button>
          </span>
        );
      })}
    </div>
  );
}
