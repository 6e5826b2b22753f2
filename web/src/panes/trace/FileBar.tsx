import { useState } from "react";
import { Command } from "../../parts/Act";
import { quoted } from "../../protocol/command";
import type { OpenedFile } from "../../protocol/messages";
import { count, visible } from "../../protocol/text";
import { useData, useStudio } from "../../window/context";
import { fileOf, type TraceFile } from "./reducer";

/** A log of this computer, read by the server as `berth trace` reads it. */
export function OpenFile() {
  const { socket, store } = useStudio();
  const [trouble, setTrouble] = useState("");
  const open = async (picked: File) => {
    setTrouble("");
    try {
      const path = `/api/v1/read?name=${encodeURIComponent(picked.name)}`;
      const answer = await socket.fetch(path, { method: "POST", body: picked });
      if (!answer.ok) return setTrouble((await answer.text()).replace(/^\d+: /, ""));
      store.dispatch({ type: "trace/file", file: fileOf((await answer.json()) as OpenedFile) });
    } catch {
      setTrouble(`${picked.name} was not sent: no connection, or it is longer than 16 MiB.`);
    }
  };
  return (
    <>
      <label className="pick">
        Open a log
        <input
          type="file"
          className="unseen"
          aria-label="Open a log"
          onChange={(event) => {
            const picked = event.target.files?.[0];
            event.target.value = "";
            if (picked) void open(picked);
          }}
        />
      </label>
      {trouble && (
        <span className="bad-text" role="alert">
          {visible(trouble)}
        </span>
      )}
    </>
  );
}

/** What the file is, how much of it is listed, and what is wrong with its lines. */
export function FileBar({ file }: { file: TraceFile }) {
  const { store } = useStudio();
  const filter = useData((state) => state.view.filter);
  const { kept, shown } = file.list;
  const found = file.findings.length + file.moreFindings;
  return (
    <div className="bar" role="group" aria-label="Opened file">
      <b>{visible(file.name)}</b>
      <span className="number quiet">
        {filter && `${count(shown)} of `}
        {kept < file.frames && `the first ${count(kept)} of `}
        {count(file.frames)} frames, {file.format}
      </span>
      {found > 0 && (
        <details className="menu">
          <summary className="bad-text">
            {count(found)} {found === 1 ? "remark" : "remarks"}
          </summary>
          <div>
            {file.findings.map((finding, i) => (
              <p key={i}>{visible(finding)}</p>
            ))}
            {file.moreFindings > 0 && <p>{count(file.moreFindings)} more</p>}
          </div>
        </details>
      )}
      <Command command={`berth trace ${quoted(file.name)}`} />
      <button type="button" onClick={() => store.dispatch({ type: "trace/file", file: null })}>
        Close the file
      </button>
    </div>
  );
}
