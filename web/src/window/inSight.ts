import type { Virtualizer } from "@tanstack/react-virtual";
import { useEffect, useState, type RefObject } from "react";

/** The height of a box in pixels, also after it has given room to another. */
export const useHeight = (box: RefObject<HTMLElement | null>): number => useSize(box, "height");
export const useWidth = (box: RefObject<HTMLElement | null>): number => useSize(box, "width");

function useSize(box: RefObject<HTMLElement | null>, which: "width" | "height"): number {
  const [size, setSize] = useState(480);
  useEffect(() => {
    if (!box.current) return;
    const observer = new ResizeObserver(([entry]) => entry && setSize(entry.contentRect[which]));
    observer.observe(box.current);
    return () => observer.disconnect();
  }, [box, which]);
  return size;
}

/** The chosen row stays in sight, also when the inspector takes room from its list; -1: none is chosen. */
export function useInSight(list: Virtualizer<HTMLDivElement, Element>, height: number, row: number): void {
  useEffect(() => {
    if (row >= 0) list.scrollToIndex(row);
  }, [list, height, row]);
}
