/** Where things stand in the drawing. A bus line is folded into as many rows as the width asks for. */

/** `width` is the least: the boxes of a row share what the drawing has. */
export const BOX = { width: 104, height: 38, gap: 8 };
const LEFT = 14;
const ROW = 2 * BOX.height + 46;
const TITLE = 22;
const MOST_WIDTH = 160;

export interface Place {
  x: number;
  y: number;
}

export interface BusLayout {
  /** y of each row of the line */
  lines: number[];
  places: Place[];
  /** Of found devices that have no slot yet. */
  pool: Place;
  top: number;
  height: number;
  perRow: number;
  boxWidth: number;
}

/** Boxes stand above and below the line by turns. */
export function busLayout(slots: number, unnamed: number, width: number, top: number): BusLayout {
  const columns = Math.max(1, Math.floor((width - 2 * LEFT + BOX.gap) / (BOX.width + BOX.gap)));
  const perRow = columns * 2;
  const boxWidth = Math.min(MOST_WIDTH, Math.floor((width - 2 * LEFT + BOX.gap) / columns) - BOX.gap);
  const rows = Math.max(1, Math.ceil(slots / perRow));
  const first = top + TITLE + BOX.height + 12;
  const lines = Array.from({ length: rows }, (_, row) => first + row * ROW);
  const places = Array.from({ length: slots }, (_, i) => {
    const row = Math.floor(i / perRow);
    const column = Math.floor((i % perRow) / 2);
    const y = (lines[row] ?? first) + (i % 2 ? 12 : -12 - BOX.height);
    return { x: LEFT + column * (boxWidth + BOX.gap), y };
  });
  const under = (lines[rows - 1] ?? first) + 12 + BOX.height + 14;
  const poolRows = unnamed ? Math.ceil(unnamed / Math.floor((width - 2 * LEFT) / POOL_STEP)) : 0;
  const height = under - top + (poolRows ? 18 + poolRows * POOL_STEP : 0) + 10;
  return { lines, places, pool: { x: LEFT, y: under + 18 }, top, height, perRow, boxWidth };
}

const POOL_STEP = 20;

export function poolPlace(pool: Place, i: number, width: number): Place {
  const perRow = Math.max(1, Math.floor((width - 2 * LEFT) / POOL_STEP));
  return { x: pool.x + (i % perRow) * POOL_STEP, y: pool.y + Math.floor(i / perRow) * POOL_STEP };
}
