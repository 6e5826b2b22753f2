import { useVirtualizer } from "@tanstack/react-virtual";
import { useEffect, useRef, useState, type KeyboardEvent } from "react";
import { Pause } from "../../parts/Bar";
import type { Frame } from "../../protocol/batch";
import type { Bus } from "../../protocol/messages";
import { bytes, count, hex, visible } from "../../protocol/text";
import { useData, useStudio, useView } from "../../window/context";
import { Exports } from "./Exports";
import { FileList, OpenFile } from "./FileList";
import { FoldedList } from "./Folded";
import { Marks } from "./Marks";
import { frameAt, knownOf, lineOf, matcher, meaningIn, rowOf, type TraceState } from "./reducer";
import { FrameHead, FrameRow, useDim, useZero } from "./rows";

const ROW = 24;

export function Trace() {
  const { socket, store } = useStudio();
  const [view] = useView();
  const [filter, open, next] = useData(
    (state) => [state.view.filter, state.connection.phase === "open", state.rates?.ring.next ?? 0] as const,
  );
  const known = next > 0;
  const file = useData((state) => state.trace.file);
  // What the ring holds from before the pane was opened.
  useEffect(() => {
    if (!open || !known) return;
    const { rates, trace } = store.get();
    if (!rates) return;
    const held = trace.pieces[0]?.batch.first ?? rates.ring.next;
    const from = Math.max(rates.ring.first, held - 1000);
    if (held > from) socket.send({ type: "frames", id: "old", from, count: held - from });
  }, [open, known, socket, store]);
  // The filter runs on the server's whole ring, too.
  useEffect(() => {
    if (!open || !filter) return;
    const timer = setTimeout(() => {
      const id = `filter ${filter}`;
      store.dispatch({ type: "trace/asked", id });
      socket.send({ type: "frames", id, count: 2000, filter });
    }, 200);
    return () => clearTimeout(timer);
  }, [filter, open, socket, store]);
  if (file) {
    return (
      <>
        <Bar />
        <FileList file={file} />
      </>
    );
  }
  return (
    <>
      <Bar />
      <Marks />
      {view.mode === "chronological" && <List />}
      {view.mode === "folded" && <FoldedList />}
      {view.mode === "latest" && <LatestList />}
    </>
  );
}

function Bar() {
  const { store } = useStudio();
  const [view, setView] = useView();
  const [paused, shown, kept, pausedShown, matched, rates] = useData((state) => {
    const { trace } = state;
    const pausedRows = trace.paused?.shown ?? null;
    return [trace.paused !== null, trace.shown, trace.kept, pausedRows, trace.matched, state.rates] as const;
  });
  const perSecond = rates?.buses.reduce((sum, bus) => sum + bus.frames_per_s, 0) ?? 0;
  return (
    <div className="bar">
      <input
        type="search"
        value={view.filter}
        placeholder="Filter: abort 1018h, 705#, heartbeat …"
        aria-label="Filter frames"
        onChange={(event) => setView({ filter: event.target.value })}
      />
      <Pause paused={paused} onChange={(now) => store.dispatch({ type: "trace/pause", paused: now })} />
      <div className="switch" role="group" aria-label="Order">
        <button
          type="button"
          aria-pressed={view.mode === "chronological"}
          onClick={() => setView({ mode: "chronological" })}
        >
          Chronological
        </button>
        <button
          type="button"
          aria-pressed={view.mode === "folded"}
          title="Each SDO transfer is one row"
          onClick={() => setView({ mode: "folded" })}
        >
          SDO folded
        </button>
        <button type="button" aria-pressed={view.mode === "latest"} onClick={() => setView({ mode: "latest" })}>
          Latest of each
        </button>
      </div>
      <Exports />
      <OpenFile />
      <span className="number quiet" aria-live="off">
        {view.filter ? `${count(pausedShown ?? shown)} of ${count(kept)} here` : `${count(kept)} frames here`}
        {matched !== null && `, ${count(matched)} in the whole ring`}
        {paused && shown > (pausedShown ?? 0) && `, ${count(shown - (pausedShown ?? 0))} new`}
        {` · ${count(perSecond)} frames/s`}
      </span>
    </div>
  );
}

function List() {
  const { socket, store } = useStudio();
  const [view, setView] = useView();
  const trace = useData((state) => state.trace);
  const [buses, known] = useData((state) => [state.data.buses, knownOf(state)] as const);
  const pieces = trace.paused?.pieces ?? trace.pieces;
  const shown = trace.paused?.shown ?? trace.shown;
  const scroller = useRef<HTMLDivElement>(null);
  const list = useVirtualizer({
    count: shown,
    getScrollElement: () => scroller.current,
    estimateSize: () => ROW,
    overscan: 6,
  });
  const following = trace.paused === null;
  // A pause begins where the list was followed: at its end.
  useEffect(() => {
    const box = scroller.current;
    if (box) box.scrollTop = following ? 0 : box.scrollHeight;
  }, [following]);
  // Scrolling back pauses: the list must not run away under the eye.
  const onWheel = (event: { deltaY: number }) => {
    if (following && event.deltaY < 0) store.dispatch({ type: "trace/pause", paused: true });
  };
  // While it follows, the newest rows that fit are drawn in place: nothing scrolls, so nothing is laid out anew.
  const [height, setHeight] = useState(480);
  useEffect(() => {
    if (!scroller.current) return;
    const observer = new ResizeObserver(([entry]) => entry && setHeight(entry.contentRect.height));
    observer.observe(scroller.current);
    return () => observer.disconnect();
  }, []);
  // The chosen frame stays in sight, also when the inspector takes room.
  const chosen = following || view.frame === null ? -1 : rowOf(pieces, view.frame);
  useEffect(() => {
    if (chosen >= 0) list.scrollToIndex(chosen);
  }, [chosen, height, list]);
  const newest = Math.min(shown, Math.floor(height / ROW));
  const items = following
    ? Array.from({ length: newest }, (_, i) => ({ key: i, index: shown - newest + i, start: i * ROW }))
    : list.getVirtualItems();
  const firstRow = items[0]?.index ?? 0;
  const lastRow = items[items.length - 1]?.index ?? 0;
  const paused = !following;
  useEffect(() => {
    if (!paused) return;
    const timer = setTimeout(() => {
      const from = frameAt(pieces, firstRow);
      const to = frameAt(pieces, lastRow);
      if (!from || !to || to.n - from.n >= 2000) return;
      socket.send({ type: "frames", id: `words ${from.n}`, from: from.n, count: to.n - from.n + 1 });
    }, 150);
    return () => clearTimeout(timer);
  }, [paused, firstRow, lastRow, pieces, socket]);
  const select = (frame: Frame) => {
    const meaning = meaningIn(frame, known);
    const bus = buses[frame.bus]?.name;
    const slot = store.get().data.slots.find((entry) => entry.bus === bus && entry.id === meaning.node);
    const object = slot && meaning.object ? meaning.object : "";
    setView({ frame: frame.n, object, ...(slot ? { slot: `${slot.bus}/${slot.id}` } : {}) });
    if (following) store.dispatch({ type: "trace/pause", paused: true });
  };
  const onKey = (event: KeyboardEvent) => {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (!step) return;
    event.preventDefault();
    const row = view.frame === null ? shown - 1 : rowOf(pieces, view.frame) + step;
    const frame = frameAt(pieces, row);
    if (frame) select(frame);
    if (frame) list.scrollToIndex(row);
  };
  const dim = useDim();
  const zero = useZero();
  return (
    <>
      <FrameHead arrows="→ sent by Berth, ← received" />
      <div
        className="scroll"
        ref={scroller}
        tabIndex={0}
        aria-label="Frames"
        role="region"
        onWheel={onWheel}
        onKeyDown={onKey}
      >
        <div style={{ height: following ? newest * ROW : list.getTotalSize(), position: "relative" }}>
          {items.map((row) => {
            const frame = frameAt(pieces, row.index);
            if (!frame) return null;
            return (
              <FrameRow
                key={row.key}
                frame={frame}
                top={row.start}
                bus={buses[frame.bus]?.name ?? ""}
                words={trace.texts.get(frame.n)}
                selected={frame.n === view.frame}
                dim={dim}
                known={known}
                zero={zero}
                onSelect={select}
              />
            );
          })}
        </div>
      </div>
    </>
  );
}

const LATEST_EVERY_MS = 250;

/** The table of identifiers, four times a second: faster than that nobody reads numbers. */
function useLatest(): { latest: TraceState["latest"]; buses: Bus[] } {
  const { store } = useStudio();
  const read = () => ({ latest: store.get().trace.latest, buses: store.get().data.buses });
  const [value, setValue] = useState(read);
  useEffect(() => {
    const timer = setInterval(() => {
      const { latest } = store.get().trace;
      setValue((old) => (old.latest === latest ? old : { latest, buses: store.get().data.buses }));
    }, LATEST_EVERY_MS);
    return () => clearInterval(timer);
  }, [store]);
  return value;
}

function LatestList() {
  const [view, setView] = useView();
  const { latest, buses } = useLatest();
  const known = useData(knownOf);
  const dim = useDim();
  const scroller = useRef<HTMLDivElement>(null);
  const matches = matcher(view.filter);
  const rows = [...latest.values()]
    .filter(({ frame }) => !matches || matches(lineOf(frame, known)))
    .sort((a, b) => a.frame.bus - b.frame.bus || a.frame.id - b.frame.id);
  const list = useVirtualizer({
    count: rows.length,
    getScrollElement: () => scroller.current,
    estimateSize: () => ROW,
    overscan: 4,
  });
  return (
    <>
      <div className="frame latest head">
        <span>Frames</span>
        <span>Bus</span>
        <span>Identifier</span>
        <span className="right">Period</span>
        <span>Data</span>
        <span>Meaning</span>
      </div>
      <div className="scroll" ref={scroller} tabIndex={0} aria-label="Latest frame of each identifier" role="region">
        <div style={{ height: list.getTotalSize(), position: "relative" }}>
          {list.getVirtualItems().map((item) => {
            const entry = rows[item.index];
            if (!entry) return null;
            const { frame } = entry;
            const meaning = meaningIn(frame, known);
            return (
              <div
                key={item.key}
                className={`frame latest service-${meaning.service} ${dim(frame, meaning.node) ? "dim" : ""}`}
                style={{ transform: `translateY(${item.start}px)` }}
                onClick={() => setView({ frame: frame.n })}
              >
                <span className="number">{count(entry.count)}</span>
                <span>{visible(buses[frame.bus]?.name ?? "")}</span>
                <span className="number">{hex(frame.id, frame.extended ? 8 : 3)}</span>
                <span className="number right">{entry.period > 0 ? `${(entry.period * 1000).toFixed(2)} ms` : ""}</span>
                <span className="number data">{bytes(frame.data)}</span>
                <span className="words">{meaning.text}</span>
              </div>
            );
          })}
        </div>
      </div>
    </>
  );
}
