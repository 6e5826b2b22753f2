import type { Virtualizer } from "@tanstack/react-virtual";
import { useEffect, useState, type RefObject } from "react";

/** The height of a box in pixels, also after it has given room to another. */
export function useHeight(box: RefObject<HTMLElement | null>): number {
  const [height, setHeight] = useState(480);
  useEffect(() => {
    if (!box.current) return;
    const observer = new ResizeObserver(([entry]) => entry && setHeight(entry.contentRect.height));
    observer.observe(box.current);
    return () => observer.disconnect();
  }, [box]);
  return height;
}

/** The chosen row stays in sight, also when the inspector takes room from its list; -1: none is chosen. */
export function useInSight(list: Virtualizer<HTMLDivElement, Element>, height: number, row: number): void {
  useEffect(() => {
    if (row >= 0) list.scrollToIndex(row);
  }, [list, height, row]);
}
