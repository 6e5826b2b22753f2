import type { Frame } from "../../protocol/batch";
import { abortParts } from "../../can/words";
import { bytes, hex, visible } from "../../protocol/text";
import { useData } from "../../window/context";
import { listedOf, meaningIn, type Known } from "./reducer";
import { carriedWords, isPdo, PdoWords, useMessageOf } from "./SignalChips";

/** The height of a row in pixels. */
export const ROW = 24;

/** What times count from, and which frames have a marker. */
export interface Zero {
  seconds: number | null;
  marks: readonly number[];
}

export function useZero(): Zero {
  const [seconds, marks] = useData((state) => {
    const { list, picked } = listedOf(state);
    return [picked.zero === null ? null : (list.marked.get(picked.zero) ?? null), picked.marks] as const;
  });
  return { seconds, marks };
}

export function timeWords(seconds: number, zero: Zero): string {
  if (zero.seconds === null) return seconds.toFixed(6);
  const since = seconds - zero.seconds;
  return `${since < 0 ? "−" : "+"}${Math.abs(since).toFixed(6)}`;
}

export function useDim(): (frame: Frame, node: number) => boolean {
  const [slot, buses] = useData((state) => [state.view.slot, listedOf(state).known.buses] as const);
  const selected = slot.lastIndexOf("/");
  const bus = slot.slice(0, selected);
  const id = Number(slot.slice(selected + 1));
  // Errors are of the whole bus.
  return (frame, node) => slot !== "" && !frame.error && !(node === id && buses[frame.bus] === bus);
}

export const arrowsOf = (ofFile: boolean): string =>
  ofFile ? "→ sent by the recorder, ← received" : "→ sent by Berth, ← received";

/** `arrows`: what the signs of the fourth column are. */
export function FrameHead({ arrows }: { arrows: string }) {
  return (
    <div className="frame head">
      <span>Time</span>
      <span>Bus</span>
      <span>Identifier</span>
      <span title={arrows} />
      <span>Data</span>
      <span>Meaning</span>
    </div>
  );
}

/** A report of an error has none. */
export const idWords = (frame: Frame): string => (frame.error ? "error" : hex(frame.id, frame.extended ? 8 : 3));

export function dataWords(frame: Frame): string {
  if (frame.error) return "";
  return frame.remote ? `remote, ${frame.data.length}` : `${bytes(frame.data)}${frame.cut ? " …" : ""}`;
}

interface RowProps {
  frame: Frame;
  top: number;
  bus: string;
  words: string | undefined;
  selected: boolean;
  dim: (frame: Frame, node: number) => boolean;
  known: Known;
  /** What times count from. */
  zero: Zero;
  /** A frame of a transfer that is open. */
  child?: boolean;
  /** The list stands: what is in its rows can be pressed. */
  still: boolean;
  onSelect: (frame: Frame) => void;
}

export function FrameRow({ frame, top, bus, words, selected, dim, known, zero, child, still, onSelect }: RowProps) {
  const meaning = meaningIn(frame, known);
  const marked = zero.marks.includes(frame.n);
  const classes = [`frame service-${meaning.service}`, selected && "selected", child && "child", marked && "marked"];
  if (dim(frame, meaning.node)) classes.push("dim");
  return (
    <div
      className={classes.filter(Boolean).join(" ")}
      style={{ transform: `translateY(${top}px)` }}
      onClick={() => onSelect(frame)}
    >
      <span className="number">
        {marked ? "⚑ " : ""}
        {timeWords(frame.seconds, zero)}
      </span>
      <span>{visible(bus)}</span>
      <span className="number">{idWords(frame)}</span>
      <span>{frame.sent ? "→" : "←"}</span>
      <span className="number data">{dataWords(frame)}</span>
      <MeaningOf frame={frame} known={known} words={words} still={still} />
    </div>
  );
}

interface MeaningProps {
  frame: Frame;
  known: Known;
  /** The server's. */
  words?: string | undefined;
  still: boolean;
}

/** Where room is short, names give way. Values, their units and the reason of an abort stay. */
export function MeaningOf({ frame, known, words, still }: MeaningProps) {
  const message = useMessageOf()(frame, known);
  const text = words ?? meaningIn(frame, known).text;
  // Of other messages the words say all.
  if (message && isPdo(message))
    return (
      <span className="words parts" title={visible(carriedWords(frame, message))}>
        <PdoWords frame={frame} of={message} still={still} />
      </span>
    );
  const abort = abortParts(text);
  if (!abort)
    return (
      <span className="words" title={visible(text)}>
        {visible(text)}
      </span>
    );
  return (
    <span className="words parts" title={visible(text)}>
      <span>{visible(abort.object)}, </span>
      <span className="kept">{visible(abort.reason)}</span>
      <span className="gives">, {visible(abort.rest)}</span>
    </span>
  );
}
