import type { Frame } from "../../protocol/batch";
import { bytes, hex, visible } from "../../protocol/text";
import { useData } from "../../window/context";
import { meaningIn, type Known } from "./reducer";

/** What times count from, and which frames have a marker. */
export interface Zero {
  seconds: number | null;
  marks: readonly number[];
}

export function useZero(): Zero {
  const [seconds, marks] = useData((state) => {
    const { zero, marks } = state.view;
    return [zero === null ? null : (state.trace.marked.get(zero) ?? null), marks] as const;
  });
  return { seconds, marks };
}

export function timeWords(seconds: number, zero: Zero): string {
  if (zero.seconds === null) return seconds.toFixed(6);
  const since = seconds - zero.seconds;
  return `${since < 0 ? "−" : "+"}${Math.abs(since).toFixed(6)}`;
}

export function useDim(): (frame: Frame, node: number) => boolean {
  const [slot, buses] = useData((state) => [state.view.slot, state.data.buses] as const);
  const selected = slot.lastIndexOf("/");
  const bus = slot.slice(0, selected);
  const id = Number(slot.slice(selected + 1));
  return (frame, node) => slot !== "" && !(node === id && buses[frame.bus]?.name === bus);
}

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
  onSelect: (frame: Frame) => void;
}

export function FrameRow({ frame, top, bus, words, selected, dim, known, zero, child, onSelect }: RowProps) {
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
      <span className="number">{hex(frame.id, frame.extended ? 8 : 3)}</span>
      <span>{frame.sent ? "→" : "←"}</span>
      <span className="number data">{frame.remote ? `remote, ${frame.data.length}` : bytes(frame.data)}</span>
      <span className="words" title={visible(words ?? meaning.text)}>
        {visible(words ?? meaning.text)}
      </span>
    </div>
  );
}
