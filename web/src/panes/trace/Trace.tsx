import { useVirtualizer } from "@tanstack/react-virtual";
import { useEffect, useMemo, useRef, useState, type KeyboardEvent } from "react";
import { Pause } from "../../parts/Bar";
import { count, visible } from "../../protocol/text";
import { useData, useStudio, useView } from "../../window/context";
import { useHeight, useInSight } from "../../window/inSight";
import { useLayouts } from "../plots/going";
import { useAnchor } from "./anchor";
import { Exports } from "./Exports";
import { FileBar, OpenFile } from "./FileBar";
import { FoldedList } from "./Folded";
import { choose, useListed, useSelect } from "./listed";
import { Marks } from "./Marks";
import { frameAt, lineOf, listedOf, matcher, meaningIn, rowFrom, rowOf } from "./reducer";
import { arrowsOf, dataWords, FrameHead, FrameRow, idWords, MeaningOf, ROW, useDim, useZero } from "./rows";

export function Trace() {
  const { socket, store } = useStudio();
  const [view] = useView();
  const [filter, open, next] = useData(
    (state) => [state.view.filter, state.connection.phase === "open", state.rates?.ring.next ?? 0] as const,
  );
  const known = next > 0;
  const file = useData((state) => state.trace.file);
  useLayouts();
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
  const of = file?.name ?? "";
  return (
    <>
      <Bar />
      {file && <FileBar file={file} />}
      <Marks />
      {view.mode === "chronological" && <List key={of} />}
      {view.mode === "folded" && <FoldedList key={of} />}
      {view.mode === "latest" && <LatestList key={of} />}
    </>
  );
}

function Bar() {
  const { store } = useStudio();
  const [view, setView] = useView();
  const [paused, file] = useData((state) => [state.trace.paused !== null, state.trace.file !== null] as const);
  return (
    <div className="bar">
      <input
        type="search"
        value={view.filter}
        placeholder="Filter: abort 1018h, 705#, heartbeat …"
        aria-label="Filter frames"
        onChange={(event) => setView({ filter: event.target.value })}
      />
      {!file && <Pause paused={paused} onChange={(now) => store.dispatch({ type: "trace/pause", paused: now })} />}
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
      <div className="line">
        <OpenFile />
        {!file && <Counts />}
      </div>
    </div>
  );
}

function Counts() {
  const [paused, shown, kept, pausedShown, matched, rates, filter] = useData((state) => {
    const { trace } = state;
    const rows = trace.paused?.shown ?? null;
    const { filter } = state.view;
    return [trace.paused !== null, trace.shown, trace.kept, rows, trace.matched, state.rates, filter] as const;
  });
  const perSecond = rates?.buses.reduce((sum, bus) => sum + bus.frames_per_s, 0) ?? 0;
  return (
    <span className="number quiet" aria-live="off">
      {filter ? `${count(pausedShown ?? shown)} of ${count(kept)} here` : `${count(kept)} frames here`}
      {matched !== null && `, ${count(matched)} in the whole ring`}
      {paused && shown > (pausedShown ?? 0) && `, ${count(shown - (pausedShown ?? 0))} new`}
      {` · ${count(perSecond)} frames/s`}
    </span>
  );
}

function List() {
  const { socket, store } = useStudio();
  const { list: trace, known, picked, file } = useListed();
  const select = useSelect();
  const ofFile = file !== null;
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
    if (box) box.scrollTop = following || ofFile ? 0 : box.scrollHeight;
  }, [following, ofFile]);
  const standing = useMemo(
    () =>
      following
        ? null
        : {
            rows: pieces,
            filter: trace.filter,
            nameAt: (row: number) => frameAt(pieces, row)?.n ?? -1,
            rowOf: (n: number) => rowFrom(pieces, n),
          },
    [following, pieces, trace.filter],
  );
  useAnchor(list, standing);
  // Scrolling back pauses: the list must not run away under the eye.
  const onWheel = (event: { deltaY: number }) => {
    if (following && event.deltaY < 0) store.dispatch({ type: "trace/pause", paused: true });
  };
  // While it follows, the newest rows that fit are drawn in place: nothing scrolls, so nothing is laid out anew.
  const height = useHeight(scroller);
  const chosen = following || picked.frame === null ? -1 : rowOf(pieces, picked.frame);
  useInSight(list, height, chosen);
  const newest = Math.min(shown, Math.floor(height / ROW));
  const items = following
    ? Array.from({ length: newest }, (_, i) => ({ key: i, index: shown - newest + i, start: i * ROW }))
    : list.getVirtualItems();
  const firstRow = items[0]?.index ?? 0;
  const lastRow = items[items.length - 1]?.index ?? 0;
  const paused = !following;
  useEffect(() => {
    if (!paused || ofFile) return;
    const timer = setTimeout(() => {
      const from = frameAt(pieces, firstRow);
      const to = frameAt(pieces, lastRow);
      if (!from || !to || to.n - from.n >= 2000) return;
      socket.send({ type: "frames", id: `words ${from.n}`, from: from.n, count: to.n - from.n + 1 });
    }, 150);
    return () => clearTimeout(timer);
  }, [paused, ofFile, firstRow, lastRow, pieces, socket]);
  const onKey = (event: KeyboardEvent) => {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (!step) return;
    event.preventDefault();
    const row = picked.frame === null ? shown - 1 : rowOf(pieces, picked.frame) + step;
    const frame = frameAt(pieces, row);
    if (frame) select(frame);
    if (frame) list.scrollToIndex(row);
  };
  const dim = useDim();
  const zero = useZero();
  return (
    <>
      <FrameHead arrows={arrowsOf(ofFile)} />
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
                key={following ? row.key : frame.n}
                frame={frame}
                top={row.start}
                bus={known.buses[frame.bus] ?? ""}
                words={trace.texts.get(frame.n)}
                selected={frame.n === picked.frame}
                dim={dim}
                known={known}
                zero={zero}
                still={!following && !ofFile}
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
function useLatest() {
  const { store } = useStudio();
  const [latest, setLatest] = useState(() => listedOf(store.get()).list.latest);
  useEffect(() => {
    const timer = setInterval(() => setLatest(listedOf(store.get()).list.latest), LATEST_EVERY_MS);
    return () => clearInterval(timer);
  }, [store]);
  return latest;
}

function LatestList() {
  const { store } = useStudio();
  const filter = useData((state) => state.view.filter);
  const latest = useLatest();
  const [known, ofFile] = useData((state) => [listedOf(state).known, listedOf(state).file !== null] as const);
  const dim = useDim();
  const scroller = useRef<HTMLDivElement>(null);
  const matches = matcher(filter);
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
                onClick={() => choose(store, { frame: frame.n })}
              >
                <span className="number">{count(entry.count)}</span>
                <span>{visible(known.buses[frame.bus] ?? "")}</span>
                <span className="number">{idWords(frame)}</span>
                <span className="number right">{entry.period > 0 ? `${(entry.period * 1000).toFixed(2)} ms` : ""}</span>
                <span className="number data">{dataWords(frame)}</span>
                <MeaningOf frame={frame} known={known} still={!ofFile} />
              </div>
            );
          })}
        </div>
      </div>
    </>
  );
}
