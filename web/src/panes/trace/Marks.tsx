import { useEffect } from "react";
import { count } from "../../protocol/text";
import { useData, useStudio, useView } from "../../window/context";
import { choose, useListed } from "./listed";
import { markChange } from "./reducer";
import { timeWords, useZero } from "./rows";

/** The frames with a marker: a press goes there, and says what times count from. */
export function Marks() {
  const { socket, store } = useStudio();
  const [view] = useView();
  const { list, picked, file } = useListed();
  const { marked } = list;
  const open = useData((state) => state.connection.phase === "open");
  const zero = useZero();
  const unknown = file ? "" : picked.marks.filter((n) => !marked.has(n)).join(",");
  // A link brings markers of frames that the page never saw.
  useEffect(() => {
    if (!open || !unknown) return;
    for (const n of unknown.split(",")) socket.send({ type: "frames", id: `mark ${n}`, from: Number(n), count: 1 });
  }, [open, unknown, socket]);
  if (!picked.marks.length) return null;
  const go = (n: number) => {
    if (!list.paused) store.dispatch({ type: "trace/pause", paused: true });
    choose(store, { frame: n, ...(view.mode === "latest" ? { mode: "chronological" } : {}) });
  };
  return (
    <div className="bar marks" role="group" aria-label="Markers">
      <label>
        Times from
        <select
          value={picked.zero ?? ""}
          onChange={(event) => choose(store, { zero: event.target.value === "" ? null : Number(event.target.value) })}
        >
          <option value="">the start</option>
          {picked.marks.map((n) => (
            <option key={n} value={n}>
              frame {count(n)}
            </option>
          ))}
        </select>
      </label>
      {picked.marks.map((n) => {
        const seconds = marked.get(n);
        return (
          <span key={n} className="switch">
            <button type="button" aria-pressed={picked.frame === n} onClick={() => go(n)}>
              ⚑ {count(n)}
              <span className="number quiet">
                {seconds === undefined ? " not in the ring" : ` ${timeWords(seconds, zero)} s`}
              </span>
            </button>
            <button
              type="button"
              aria-label={`Take the marker of frame ${count(n)} away`}
              onClick={() => choose(store, markChange(picked, n))}
            >
              ×
            </button>
          </span>
        );
      })}
    </div>
  );
}
