import { useState } from "react";
import { Command } from "../../parts/Act";
import { download, fileName } from "../../parts/download";
import { visible } from "../../protocol/text";
import { useData, useStudio } from "../../window/context";
import { candumpLog, exported, fileCommand, framesCsv, ringCommand, ringFormats, ringPath, whole } from "./export";
import { listedOf } from "./reducer";

/** What is in the list, or only what belongs to the selected slot, as a file. */
export function Exports() {
  const { socket, store } = useStudio();
  const [trouble, setTrouble] = useState("");
  const [filter, machineFile, tokenFile] = useData(
    (state) => [state.view.filter, state.data.machine.file, state.data.tokenFile] as const,
  );
  const file = useData((state) => state.trace.file?.name ?? "");
  const [slot, name] = useData((state) => {
    const chosen = state.data.slots.find((entry) => `${entry.bus}/${entry.id}` === state.view.slot);
    return [chosen ? state.view.slot : "", chosen?.name ?? ""] as const;
  });
  const save = (ending: "log" | "csv", of: string) => {
    const state = store.get();
    const { list, known, file } = listedOf(state);
    const listed = exported(list.paused?.pieces ?? list.pieces, known, of);
    const frames = ending === "log" ? whole(listed) : listed;
    const left = listed.length - frames.length;
    const text = ending === "log" ? candumpLog(frames, known) : framesCsv(frames, known, list.texts);
    const type = ending === "log" ? "text/plain" : "text/csv";
    download(fileName(file?.name ?? state.data.machine.name, ending, new Date()), text, type);
    store.dispatch({
      type: "window",
      change: {
        notice: `${frames.length} frames saved.${left ? ` ${left} FD frames left out: the server's files have them.` : ""}`,
      },
    });
  };
  // The server writes the file: this page holds a part of its ring only.
  const saveRing = async (format: string, ending: string) => {
    setTrouble("");
    try {
      const answer = await socket.fetch(ringPath(format, filter));
      if (!answer.ok) return setTrouble(await answer.text());
      download(fileName(store.get().data.machine.name, ending, new Date()), await answer.blob(), "");
      store.dispatch({ type: "window", change: { notice: "The ring is saved." } });
    } catch {
      setTrouble("The connection was lost before the file was whole.");
    }
  };
  return (
    <details className="menu end">
      <summary>Export</summary>
      <div>
        <button type="button" onClick={() => save("log", "")}>
          What is listed, as candump log
        </button>
        <button type="button" onClick={() => save("csv", "")}>
          What is listed, as CSV
        </button>
        {!file &&
          ringFormats.map(({ format, ending, words }) => (
            <button key={format} type="button" onClick={() => void saveRing(format, ending)}>
              {filter ? "What the filter finds in the whole ring" : "The whole ring"}, as {words}
            </button>
          ))}
        <Command command={file ? fileCommand(file) : ringCommand(filter, machineFile, tokenFile)} />
        {trouble && (
          <span className="bad-text" role="alert">
            {visible(trouble)}
          </span>
        )}
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
