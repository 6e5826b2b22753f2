import { download, fileName } from "../../parts/download";
import { visible } from "../../protocol/text";
import { useData, useStudio } from "../../window/context";
import { candumpLog, exported, framesCsv } from "./export";
import { knownOf } from "./reducer";

/** What is in the list, or only what belongs to the selected slot, as a file. */
export function Exports() {
  const { store } = useStudio();
  const [slot, name] = useData((state) => {
    const chosen = state.data.slots.find((entry) => `${entry.bus}/${entry.id}` === state.view.slot);
    return [chosen ? state.view.slot : "", chosen?.name ?? ""] as const;
  });
  const save = (ending: "log" | "csv", of: string) => {
    const state = store.get();
    const { trace } = state;
    const known = knownOf(state);
    const frames = exported(trace.paused?.pieces ?? trace.pieces, known, of);
    const text = ending === "log" ? candumpLog(frames, known) : framesCsv(frames, known, trace.texts);
    const type = ending === "log" ? "text/plain" : "text/csv";
    download(fileName(state.data.machine.name, ending, new Date()), text, type);
    store.dispatch({ type: "window", change: { notice: `${frames.length} frames saved.` } });
  };
  return (
    <details className="menu">
      <summary>Export</summary>
      <div>
        <button type="button" onClick={() => save("log", "")}>
          What is listed, as candump log
        </button>
        <button type="button" onClick={() => save("csv", "")}>
          What is listed, as CSV
        </button>
        {slot && (
          <>
            <button type="button" onClick={() => save("log", slot)}>
              Only {visible(name)}, as candump log
            </button>
            <button type="button" onClick={() => save("csv", slot)}>
              Only {visible(name)}, as CSV
            </button>
          </>
        )}
      </div>
    </details>
  );
}
