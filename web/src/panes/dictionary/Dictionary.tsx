import { useVirtualizer } from "@tanstack/react-virtual";
import { useRef, type KeyboardEvent } from "react";
import { Act, Answer, useLastOf } from "../../parts/Act";
import { Check } from "../../parts/Bar";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio, useView } from "../../window/context";
import { useHeight, useInSight } from "../../window/inSight";
import { watchKey } from "../plots/reducer";
import { useWatching } from "../plots/watching";
import { objectNamed, searched, type ObjectRow } from "./reducer";

export function Dictionary() {
  useWatching();
  const [view] = useView();
  const slot = useData((state) => state.data.slots.find((entry) => slotKey(entry) === view.slot));
  const rows = useData((state) => state.dictionary.objects[view.slot]);
  const last = useLastOf(`dictionary:${view.slot}`);
  if (!slot) return <p className="hint start">Select a slot in the tree to read its objects.</p>;
  if (rows) return <Objects rows={rows} />;
  const values = { bus: slot.bus, node: slot.name };
  return (
    <div className="start">
      <p>
        The objects of <b>{visible(slot.name)}</b> are not read yet. One object: type its index and press Enter.
      </p>
      <Search found={[]} />
      <Act verb="sdo dump" values={values} owner={`dictionary:${view.slot}`} label="Read all objects" primary />
      <Answer sent={last} />
    </div>
  );
}

/** Enter goes to the object that is named, or to the first that is found; one that is not read yet is read. */
function Search({ found }: { found: readonly ObjectRow[] }) {
  const { store, socket } = useStudio();
  const [view, setView] = useView();
  const [search, slot] = useData(
    (state) => [state.dictionary.search, state.data.slots.find((entry) => slotKey(entry) === view.slot)] as const,
  );
  const onKey = (event: KeyboardEvent) => {
    if (event.key !== "Enter" || !slot) return;
    const named = objectNamed(search);
    const first = found.find((row) => row.key === named) ?? found[0];
    const object = first?.key ?? named;
    if (!object) return;
    setView({ object });
    store.dispatch({ type: "window", change: { inspectorOpen: true } });
    if (!first) {
      socket.request("sdo read", { bus: slot.bus, node: slot.name, object }, `dictionary:${view.slot}`);
    }
  };
  return (
    <input
      type="search"
      value={search}
      placeholder="Search: 1017h, heartbeat, value …"
      aria-label="Search objects"
      onChange={(event) => store.dispatch({ type: "dictionary/search", search: event.target.value })}
      onKeyDown={onKey}
    />
  );
}

function Objects({ rows }: { rows: readonly ObjectRow[] }) {
  const { store, socket } = useStudio();
  const [view, setView] = useView();
  const [dictionary, slot] = useData(
    (state) => [state.dictionary, state.data.slots.find((entry) => slotKey(entry) === view.slot)] as const,
  );
  const before = dictionary.before[view.slot] ?? {};
  const all = searched(rows, dictionary.search);
  const watched = new Set(view.watch);
  const isWatched = (row: ObjectRow) => watched.has(watchKey(view.slot, row.key));
  const changed = dictionary.differencesOnly ? all.filter((row) => row.key in before) : all;
  const other = dictionary.otherOnly ? changed.filter((row) => row.differs) : changed;
  const found = dictionary.watchedOnly ? other.filter(isWatched) : other;
  const scroller = useRef<HTMLDivElement>(null);
  const list = useVirtualizer({
    count: found.length,
    getScrollElement: () => scroller.current,
    estimateSize: () => 24,
    overscan: 8,
  });
  const chosen = found.findIndex((row) => row.key === view.object);
  useInSight(list, useHeight(scroller), chosen);
  const onKey = (event: KeyboardEvent) => {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (!step) return;
    event.preventDefault();
    const row = found[chosen + step];
    if (row) setView({ object: row.key });
  };
  const again = () => slot && socket.request("sdo dump", { bus: slot.bus, node: slot.name }, `dictionary:${view.slot}`);
  return (
    <>
      <div className="bar">
        <Search found={found} />
        <Check
          on={dictionary.differencesOnly}
          words="changed only"
          onChange={(only) => store.dispatch({ type: "dictionary/changed", only })}
        />
        <Check
          on={dictionary.otherOnly}
          words="differences only"
          onChange={(only) => store.dispatch({ type: "dictionary/other", only })}
        />
        <Check
          on={dictionary.watchedOnly}
          words="watched only"
          onChange={(only) => store.dispatch({ type: "dictionary/watched", only })}
        />
        <button type="button" onClick={again}>
          Read all objects
        </button>
        <span className="number quiet">
          {found.length} of {rows.length}
        </span>
      </div>
      <div className="object head">
        <span>Object</span>
        <span>Name</span>
        <span>Type</span>
        <span>Value</span>
        <span>Default or file</span>
        <span>Before</span>
      </div>
      <div className="scroll" ref={scroller} tabIndex={0} role="region" aria-label="Objects" onKeyDown={onKey}>
        <div style={{ height: list.getTotalSize(), position: "relative" }}>
          {list.getVirtualItems().map((item) => {
            const row = found[item.index];
            if (!row) return null;
            return (
              <div
                key={item.key}
                className={`object ${row.key === view.object ? "selected" : ""}`}
                style={{ transform: `translateY(${item.start}px)` }}
                onClick={() => setView({ object: row.key })}
              >
                <span className="number">
                  {row.key}
                  {isWatched(row) && <span title="watched"> ◉</span>}
                </span>
                <span>{visible(row.name)}</span>
                <span className="quiet">{row.type}</span>
                <span className={row.abort ? "bad-text" : "number"}>
                  {visible(row.abort || row.value || row.bytes)}
                  {row.meaning && <span className="quiet"> {visible(row.meaning)}</span>}
                </span>
                <span className={row.differs ? "number unlike" : "number quiet"}>
                  {row.differs && "≠ "}
                  {visible(row.configured || row.usual)}
                </span>
                <span className="number">{visible(before[row.key] ?? "")}</span>
              </div>
            );
          })}
        </div>
      </div>
    </>
  );
}
