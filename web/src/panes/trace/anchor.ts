import type { Virtualizer } from "@tanstack/react-virtual";
import { useLayoutEffect, useRef } from "react";
import { ROW } from "./rows";

/** A list that stands still: rows may only be put between those that are there. */
export interface Standing {
  /** Another one: other rows. */
  rows: unknown;
  filter: string;
  /** What names the row wherever it moves to; -1: there is no such row. */
  nameAt: (row: number) => number;
  /** The row of that name, or of the next one that is there. */
  rowOf: (name: number) => number;
}

/** Older frames come late into a list that is paused: the row at its upper edge stays where it is, with all beneath it. */
export function useAnchor(list: Virtualizer<HTMLDivElement, Element>, standing: Standing | null): void {
  const before = useRef<Standing | null>(null);
  useLayoutEffect(() => {
    const old = before.current;
    before.current = standing;
    const box = list.scrollElement;
    const inner = box?.firstElementChild;
    if (!box || !(inner instanceof HTMLElement) || old?.rows === standing?.rows) return;
    if (!standing || !old || standing.filter !== old.filter) {
      inner.style.minHeight = "";
      return;
    }
    const top = Math.floor(box.scrollTop / ROW);
    const name = old.nameAt(top);
    const moved = name < 0 ? 0 : standing.rowOf(name) - top;
    if (!moved) return;
    const offset = box.scrollTop + moved * ROW;
    // A list that does not fill its box could not scroll without room beneath.
    if (moved > 0) inner.style.minHeight = `${offset + box.clientHeight}px`;
    box.scrollTop = offset;
    // Its own event comes later: who asks before would scroll to a row that is in sight.
    list.scrollOffset = box.scrollTop;
  }, [list, standing]);
}
