import { useEffect, useRef } from "react";
import { Answer, Command, useLastOf } from "../../parts/Act";
import { download, fileName } from "../../parts/download";
import { commandLine, quoted } from "../../protocol/command";
import type { Slot } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { barrier } from "../../store/barrier";
import { act, useData, useStudio } from "../../window/context";
import { dcfOf } from "./reducer";

/** What the device has now, as a DCF with its date: `upload`, whose answer the page saves. */
export function Backup({ slot }: { slot: Slot }) {
  const studio = useStudio();
  const owner = `backup:${slotKey(slot)}`;
  const last = useLastOf(owner);
  const [verbs, file, why] = useData(
    (state) =>
      [
        state.data.verbs,
        state.data.machine.file,
        barrier(state, "upload", { bus: slot.bus, slot: slot.name }),
      ] as const,
  );
  // Of an answer that was there before, nothing is saved again.
  const saved = useRef(last?.done ? last.id : "");
  useEffect(() => {
    if (!last?.done || last.status !== 0 || saved.current === last.id) return;
    saved.current = last.id;
    const dcf = dcfOf(last.reply);
    if (dcf) download(fileName(slot.name, "dcf", new Date()), dcf, "text/plain");
  }, [last, slot.name]);
  const offered = verbs.some(({ name, parameters }) => name === "upload" && parameters.some((p) => p.name === "dcf"));
  if (!offered) return null;
  const values = { bus: slot.bus, slot: slot.name };
  const command = `${commandLine("upload", values, verbs, file)} -o ${quoted(fileName(slot.name, "dcf", new Date()))}`;
  return (
    <div className="act">
      <button
        type="button"
        disabled={why !== null}
        title={why ?? ""}
        onClick={() => act(studio, [{ verb: "upload", values: { ...values, dcf: "1" }, owner }])}
      >
        Save as DCF
      </button>
      <Command command={command} />
      <p className="hint">
        {why ??
          `Reads the configuration of ${visible(slot.name)}. From then on a replacement gets it, until Berth restarts.`}
      </p>
      <Answer sent={last} />
    </div>
  );
}
