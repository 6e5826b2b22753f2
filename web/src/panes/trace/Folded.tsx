import { useVirtualizer } from "@tanstack/react-virtual";
import { useEffect, useMemo, useRef, useState, type KeyboardEvent } from "react";
import { hex, visible } from "../../protocol/text";
import { useData, useStudio } from "../../window/context";
import { useHeight, useInSight } from "../../window/inSight";
import { useAnchor } from "./anchor";
import { useListed, useSelect } from "./listed";
import { frameNumbered, listedOf, type Piece } from "./reducer";
import { arrowsOf, FrameHead, FrameRow, ROW, timeWords, useDim, useZero, type Zero } from "./rows";
import {
  firstFrameOf,
  firstOf,
  folded,
  frameOfRow,
  meantBy,
  nameOfRow,
  outcomeOf,
  rowHolding,
  rowNamed,
  steppedRow,
  wordsOf,
  type FoldedRow,
  type Transfer,
} from "./transfers";

const EVERY_MS = 500;

/** The list as it is, twice a second while it is followed: all transfers are put together anew each time. */
function usePieces(): readonly Piece[] {
  const { store } = useStudio();
  const paused = useData((state) => listedOf(state).list.paused?.pieces ?? null);
  const filter = useData((state) => state.trace.filter);
  const [live, setLive] = useState(() => store.get().trace.pieces);
  useEffect(() => {
    setLive(store.get().trace.pieces);
    const timer = setInterval(() => setLive(store.get().trace.pieces), EVERY_MS);
    return () => clearInterval(timer);
  }, [store, filter]);
  return paused ?? live;
}

export function FoldedList() {
  const { store, socket } = useStudio();
  const { list: trace, known, picked, file } = useListed();
  const ofFile = file !== null;
  const filter = useData((state) => state.view.filter);
  const select = useSelect();
  const pieces = usePieces();
  const { opened, texts } = trace;
  const paused = trace.paused !== null;
  const objects = useData((state) => state.dictionary.objects);
  const rows = useMemo(() => folded(pieces, filter, known, opened), [pieces, filter, known, opened]);
  const scroller = useRef<HTMLDivElement>(null);
  const list = useVirtualizer({
    count: rows.length,
    getScrollElement: () => scroller.current,
    estimateSize: () => ROW,
    overscan: 6,
  });
  useEffect(() => {
    if (!paused && rows.length) list.scrollToIndex(rows.length - 1);
  }, [paused, rows, list]);
  const standing = useMemo(
    () =>
      paused
        ? {
            rows,
            filter,
            nameAt: (row: number) => nameOfRow(rows[row]),
            rowOf: (name: number) => rowNamed(rows, name),
          }
        : null,
    [paused, rows, filter],
  );
  useAnchor(list, standing);
  useInSight(list, useHeight(scroller), paused ? rowHolding(rows, picked.frame, opened) : -1);
  const pause = () => {
    if (!store.get().trace.paused) store.dispatch({ type: "trace/pause", paused: true });
  };
  const items = list.getVirtualItems();
  const from = firstOf(rows[items[0]?.index ?? 0]);
  const to = firstOf(rows[items[items.length - 1]?.index ?? 0]);
  // The server's words for what is in sight.
  useEffect(() => {
    if (!paused || ofFile || from < 0 || to < from) return;
    const timer = setTimeout(() => {
      const count = Math.min(2000, to - from + 100);
      socket.send({ type: "frames", id: `words ${from}`, from, count });
    }, 150);
    return () => clearTimeout(timer);
  }, [paused, ofFile, from, to, socket]);
  useAnswers(ofFile ? [] : items.map((item) => rows[item.index]));
  const open = (transfer: Transfer) => {
    const first = transfer.frames[0] ?? -1;
    store.dispatch({ type: "trace/open", first, open: !opened.has(first) });
    const frame = frameNumbered(pieces, transfer.frames[transfer.frames.length - 1] ?? -1);
    if (frame) select(frame);
  };
  const onKey = (event: KeyboardEvent) => {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    const held = rows[rowHolding(rows, picked.frame, opened)];
    const opens = event.key === "ArrowRight" ? true : event.key === "ArrowLeft" ? false : null;
    if (!step && (opens === null || held === undefined)) return;
    event.preventDefault();
    if (!step) {
      const first = held === undefined ? null : firstFrameOf(rows, held);
      if (first !== null) store.dispatch({ type: "trace/open", first, open: opens === true });
      return;
    }
    const row = steppedRow(rows, picked.frame, step, opened);
    const frame = frameNumbered(pieces, frameOfRow(rows[row]) ?? -1);
    if (!frame) return;
    select(frame);
    list.scrollToIndex(row);
  };
  const dim = useDim();
  const zero = useZero();
  const drawn = (row: FoldedRow | undefined, top: number) => {
    if (row === undefined) return null;
    const key = nameOfRow(row);
    if (typeof row === "object" && "frames" in row) {
      const first = frameNumbered(pieces, row.frames[0] ?? -1);
      // The objects are the machine's; a file may be of another.
      const ofDevice = ofFile ? undefined : objects[`${known.buses[row.bus] ?? ""}/${row.node}`];
      const object = ofDevice?.find((each) => each.key === row.object);
      return (
        <TransferRow
          key={key}
          transfer={row}
          top={top}
          bus={known.buses[row.bus] ?? ""}
          words={wordsOf(row, texts)}
          meant={meantBy(row, object)}
          open={opened.has(row.frames[0] ?? -1)}
          selected={!opened.has(row.frames[0] ?? -1) && picked.frame !== null && row.frames.includes(picked.frame)}
          dim={first !== null && dim(first, row.node)}
          zero={zero}
          onOpen={open}
        />
      );
    }
    const child = typeof row === "object";
    const frame = frameNumbered(pieces, child ? row.child : row);
    if (!frame) return null;
    const selected = frame.n === picked.frame;
    const common = { frame, top, dim, known, zero, selected, child, still: paused && !ofFile, onSelect: select };
    return <FrameRow key={key} {...common} bus={known.buses[frame.bus] ?? ""} words={texts.get(frame.n)} />;
  };
  return (
    <>
      <FrameHead arrows={`${arrowsOf(ofFile)}, ▸ a transfer`} />
      <div
        className="scroll"
        ref={scroller}
        tabIndex={0}
        role="region"
        aria-label="Frames, SDO transfers folded"
        onWheel={(event) => event.deltaY < 0 && pause()}
        onKeyDown={onKey}
      >
        <div style={{ height: list.getTotalSize(), position: "relative" }}>
          {items.map((item) => drawn(rows[item.index], item.start))}
        </div>
      </div>
    </>
  );
}

const MOST_ASKED = 32;
const NEAR = 256;
/** How far after its request an answer is looked for. */
const FARTHEST = 4000;

/** The first frame from `n` on that this page does not hold. */
function firstMissing(pieces: readonly Piece[], n: number): number {
  let at = n;
  for (const { batch } of pieces) {
    if (batch.first <= at && at < batch.first + batch.count) at = batch.first + batch.count;
  }
  return at;
}

/** What the filter of the server's ring found has no frames around it: those after a request without an answer are asked for. */
function useAnswers(rows: readonly (FoldedRow | undefined)[]): void {
  const { store, socket } = useStudio();
  const asked = useRef(new Set<number>());
  useEffect(() => {
    const { trace, rates } = store.get();
    let count = 0;
    for (const row of rows) {
      if (typeof row !== "object" || !("frames" in row) || row.state !== "open" || count >= MOST_ASKED) continue;
      const request = row.frames[0] ?? 0;
      const from = firstMissing(trace.pieces, request);
      const over = from >= (rates?.ring.next ?? 0) || from - request > FARTHEST;
      if (over || asked.current.has(from)) continue;
      if (socket.send({ type: "frames", id: `near ${from}`, from, count: NEAR })) asked.current.add(from);
      count++;
    }
  });
}

interface TransferProps {
  transfer: Transfer;
  top: number;
  bus: string;
  words: string;
  /** What the value means; empty: not known. */
  meant: string;
  open: boolean;
  selected: boolean;
  dim: boolean;
  zero: Zero;
  onOpen: (transfer: Transfer) => void;
}

function TransferRow({ transfer, top, bus, words, meant, open, selected, dim, zero, onOpen }: TransferProps) {
  const service = transfer.state === "aborted" ? "abort" : "SDO";
  const { frames, from, to } = transfer;
  const outcome = outcomeOf(transfer);
  const told = `${frames.length} ${frames.length === 1 ? "frame" : "frames"}, ${((to - from) * 1000).toFixed(2)} ms`;
  return (
    <div
      className={`frame transfer service-${service} ${dim ? "dim" : ""} ${selected ? "selected" : ""}`}
      style={{ transform: `translateY(${top}px)` }}
      onClick={() => onOpen(transfer)}
    >
      <span className="number">{timeWords(from, zero)}</span>
      <span>{visible(bus)}</span>
      <span className="number">{hex(0x600 + transfer.node, 3)}</span>
      <button type="button" className="fold" aria-expanded={open} aria-label={`Frames of ${visible(words)}`}>
        {open ? "▾" : "▸"}
      </button>
      <span className="number data" title={outcome}>
        {outcome}
      </span>
      <span className="words parts" title={`${visible(words)}${meant && ` = ${visible(meant)}`}, ${told}`}>
        <span>{visible(words)}</span>
        {meant && <span className="kept">{` = ${visible(meant)}`}</span>}
        <span className="quiet gives">, {told}</span>
      </span>
    </div>
  );
}
