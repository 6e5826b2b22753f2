import { useVirtualizer } from "@tanstack/react-virtual";
import { useMemo, useRef, useState } from "react";
import { Command } from "../../parts/Act";
import { frameOf } from "../../protocol/batch";
import { quoted } from "../../protocol/command";
import type { OpenedFile } from "../../protocol/messages";
import { count, visible } from "../../protocol/text";
import { useData, useStudio } from "../../window/context";
import { fileOf, rowsOfFile, type TraceFile } from "./reducer";
import { FrameHead, FrameRow } from "./rows";

const ROW = 24;
const NO_MARKS = { seconds: null, marks: [] };

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

/** Its frames, and what is wrong with its lines. */
export function FileList({ file }: { file: TraceFile }) {
  const { store } = useStudio();
  const filter = useData((state) => state.view.filter);
  const rows = useMemo(() => rowsOfFile(file, filter), [file, filter]);
  const scroller = useRef<HTMLDivElement>(null);
  const list = useVirtualizer({
    count: rows.length,
    getScrollElement: () => scroller.current,
    estimateSize: () => ROW,
    overscan: 6,
  });
  const found = file.findings.length + file.moreFindings;
  return (
    <>
      <div className="bar" role="group" aria-label="Opened file">
        <b>{visible(file.name)}</b>
        <span className="number quiet">
          {filter && `${count(rows.length)} of `}
          {file.batch.count < file.frames && `the first ${count(file.batch.count)} of `}
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
      <FrameHead arrows="→ sent by who recorded it, ← received" />
      <div className="scroll" ref={scroller} tabIndex={0} role="region" aria-label="Frames of the file">
        <div style={{ height: list.getTotalSize(), position: "relative" }}>
          {list.getVirtualItems().map((item) => {
            const at = rows[item.index] ?? 0;
            const frame = frameOf(file.batch, at);
            return (
              <FrameRow
                key={item.key}
                frame={frame}
                top={item.start}
                bus={file.known.buses[frame.bus] ?? ""}
                words={file.texts[at]}
                selected={false}
                dim={() => false}
                known={file.known}
                zero={NO_MARKS}
                onSelect={() => undefined}
              />
            );
          })}
        </div>
      </div>
    </>
  );
}
