import { Act, Answer, Command, useLastOf } from "../../parts/Act";
import { commandLine } from "../../protocol/command";
import type { Slot } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { barrier } from "../../store/barrier";
import { act, useData, useStudio } from "../../window/context";
import { WatchButton } from "../plots/Watch";
import { NamedValues, NoteEditor, NoteTables } from "./NoteEditor";
import { idsNamed, limitsOf, wrongFor, type ObjectRow } from "./reducer";

export function ObjectInspector({ slot, object }: { slot: Slot; object: string }) {
  const key = slotKey(slot);
  const owner = `dictionary:${key}`;
  const [row, draft, devices] = useData((state) => {
    const { objects, draft, devices } = state.dictionary;
    return [objects[key]?.find((entry) => entry.key === object), draft, devices] as const;
  });
  const last = useLastOf(owner);
  // That of another object, or of all, is not told here.
  const mine = last?.values.object === object ? last : undefined;
  const writes = draft !== "" && wrongFor(row?.type ?? "", draft) === "";
  const target = { bus: slot.bus, node: slot.name, object };
  return (
    <section>
      <h2>
        {object} {visible(row?.name ?? "")}
      </h2>
      {row?.note?.text && <p className="reason">{visible(row.note.text)}</p>}
      {row && <RowFacts row={row} />}
      {row && <NoteTables row={row} />}
      <div className="row">
        <WatchButton slot={key} object={object} />
      </div>
      <Act verb="sdo read" values={target} owner={owner} label="Read" />
      <Editor row={row} />
      {writes && <Devices slot={slot} />}
      {writes && devices === "" && (
        <Act verb="sdo write" values={{ ...target, value: draft }} owner={owner} label="Write" primary />
      )}
      {writes && devices !== "" && <WriteSeveral slot={slot} object={object} value={draft} devices={devices} />}
      <SeriesAnswer />
      <Answer sent={mine} />
      <NoteEditor slot={slot} object={object} />
    </section>
  );
}

/** The field for a new value as the object's type wants it. */
function Editor({ row }: { row: ObjectRow | undefined }) {
  const { store } = useStudio();
  const draft = useData((state) => state.dictionary.draft);
  const set = (text: string) => store.dispatch({ type: "dictionary/draft", draft: text });
  if (row?.type === "BOOLEAN") {
    const held = /^(1|true)$/.test(row.value) ? "1" : "0";
    const wanted = draft === "" ? held : draft;
    return (
      <label className="row">
        <input type="checkbox" checked={wanted === "1"} onChange={(event) => set(event.target.checked ? "1" : "0")} />
        New value: {wanted}
      </label>
    );
  }
  const limits = limitsOf(row?.type ?? "");
  const wrong = wrongFor(row?.type ?? "", draft);
  return (
    <>
      <label className="line">
        New value
        <input
          value={draft}
          placeholder={row?.value ?? ""}
          aria-invalid={wrong !== ""}
          aria-describedby={limits ? "value-limits" : undefined}
          onChange={(event) => set(event.target.value)}
        />
      </label>
      {row?.note && <NamedValues note={row.note} draft={draft} onPick={set} />}
      {limits && (
        <p id="value-limits" className={wrong ? "bad-text" : "hint"}>
          {wrong || `${String(limits[0])} to ${String(limits[1])}, or hexadecimal: 0x1F4`}
        </p>
      )}
    </>
  );
}

function RowFacts({ row }: { row: ObjectRow }) {
  const number = /^-?\d+$/.test(row.value) ? Number(row.value) : null;
  return (
    <dl>
      <div>
        <dt>Value</dt>
        <dd className="number">
          {visible(row.value)}
          {number !== null && number >= 0 && ` = ${number.toString(16).toUpperCase()}h`}
        </dd>
      </div>
      {row.meaning && (
        <div>
          <dt>Meaning</dt>
          <dd>{visible(row.meaning)}</dd>
        </div>
      )}
      <div>
        <dt>Type</dt>
        <dd>{row.type}</dd>
      </div>
      <div>
        <dt>Bytes</dt>
        <dd className="number data">{row.bytes.replace(/\s/g, "").replace(/(..)(?=.)/g, "$1 ")}</dd>
      </div>
      {row.usual && (
        <div>
          <dt>Default</dt>
          <dd className="number">{visible(row.usual)}</dd>
        </div>
      )}
      {row.configured && (
        <div>
          <dt>Configured</dt>
          <dd className="number">{visible(row.configured)}</dd>
        </div>
      )}
      {row.abort && (
        <div>
          <dt>Abort</dt>
          <dd className="bad-text">{visible(row.abort)}</dd>
        </div>
      )}
    </dl>
  );
}

/** For whom the new value is. */
function Devices({ slot }: { slot: Slot }) {
  const { store } = useStudio();
  const [devices, slots] = useData((state) => [state.dictionary.devices, state.data.slots] as const);
  const alike = slots.filter((entry) => entry.bus === slot.bus && entry.type !== null && entry.type === slot.type);
  const set = (text: string) => store.dispatch({ type: "dictionary/devices", devices: text });
  return (
    <>
      <label className="line">
        Devices
        <input
          value={devices}
          placeholder={`${visible(slot.name)} only; or node-IDs: 1-10, 12`}
          onChange={(event) => set(event.target.value)}
        />
      </label>
      {alike.length > 1 && devices === "" && (
        <button type="button" className="small" onClick={() => set(alike.map((entry) => entry.id).join(", "))}>
          All {alike.length} of this type
        </button>
      )}
    </>
  );
}

let seriesCount = 0;

function WriteSeveral(props: { slot: Slot; object: string; value: string; devices: string }) {
  const { slot, object, value, devices } = props;
  const studio = useStudio();
  const [slots, verbs, file, why] = useData(
    (state) => [state.data.slots, state.data.verbs, state.data.machine.file, barrier(state, "sdo write")] as const,
  );
  const mine = slots.filter((entry) => entry.bus === slot.bus);
  const ids = idsNamed(
    devices,
    mine.map((entry) => entry.id),
  );
  if (!ids?.length) return <p className="hint">Node-IDs of this bus, such as 1-10, 12.</p>;
  const command = commandLine("sdo write", { bus: slot.bus, node: "NODE", object, value }, verbs, file);
  const loop = `for n in ${ids.join(" ")}; do ${command.replace("write NODE", 'write "$n"')}; done`;
  const write = () => {
    const owner = `series ${++seriesCount}`;
    const asks = ids.map((id) => ({
      verb: "sdo write",
      values: { bus: slot.bus, node: String(id), object, value },
      owner: `${owner} ${slot.bus}/${id}`,
    }));
    studio.store.dispatch({ type: "dictionary/series", series: { owner, object, total: ids.length } });
    act(studio, asks);
  };
  return (
    <div className="act">
      <button type="button" className="primary" disabled={why !== null} title={why ?? ""} onClick={write}>
        Write to {ids.length} {ids.length === 1 ? "device" : "devices"}
      </button>
      <Command command={loop} />
      {why && <p className="hint">{why}</p>}
    </div>
  );
}

function SeriesAnswer() {
  const [series, requests] = useData((state) => [state.dictionary.series, state.requests] as const);
  if (!series) return null;
  const mine = requests.filter((sent) => sent.owner.startsWith(`${series.owner} `));
  const done = mine.filter((sent) => sent.done);
  const failed = done.filter((sent) => sent.status !== 0);
  const over = done.length === series.total;
  const tone = !over ? "busy" : failed.length ? "bad" : "good";
  return (
    <div className={`answer ${tone}`} role="status">
      <p>
        {over ? (failed.length ? "✕ " : "✓ ") : ""}
        {series.object}: {done.length - failed.length} of {series.total} written
      </p>
      {failed.map((sent) => (
        <p key={sent.id}>
          Node {sent.values.node}: {visible(sent.error)}
        </p>
      ))}
    </div>
  );
}
