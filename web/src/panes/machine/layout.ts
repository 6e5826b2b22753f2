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
  /** Of devices without a slot: those of which Berth says why are boxes, the others squares beneath. */
  pool: Place;
  squares: Place;
  top: number;
  height: number;
  perRow: number;
  boxWidth: number;
}

/** Boxes stand above and below the line by turns. */
export function busLayout(
  slots: number,
  { boxes, squares }: { boxes: number; squares: number },
  width: number,
  top: number,
): BusLayout {
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
  const squareRows = squares ? Math.ceil(squares / Math.floor((width - 2 * LEFT) / POOL_STEP)) : 0;
  const boxRows = Math.ceil(boxes / columns) * (BOX.height + BOX.gap);
  const pool = { x: LEFT, y: under + 18 };
  const height = under - top + (boxRows || squareRows ? 18 + boxRows + squareRows * POOL_STEP : 0) + 10;
  return { lines, places, pool, squares: { x: LEFT, y: pool.y + boxRows }, top, height, perRow, boxWidth };
}

export function poolBoxPlace({ pool, perRow, boxWidth }: BusLayout, i: number): Place {
  const columns = perRow / 2;
  return {
    x: pool.x + (i % columns) * (boxWidth + BOX.gap),
    y: pool.y + Math.floor(i / columns) * (BOX.height + BOX.gap),
  };
}

/** Where the stubs of a column meet the line: column 0 has the first two slots. */
export function columnPlace(layout: BusLayout, column: number): Place {
  const columns = layout.perRow / 2;
  const x = LEFT + (column % columns) * (layout.boxWidth + BOX.gap) + Math.round(layout.boxWidth / 2);
  return { x, y: layout.lines[Math.floor(column / columns)] ?? layout.top };
}

const POOL_STEP = 20;

export function poolPlace(pool: Place, i: number, width: number): Place {
  const perRow = Math.max(1, Math.floor((width - 2 * LEFT) / POOL_STEP));
  return { x: pool.x + (i % perRow) * POOL_STEP, y: pool.y + Math.floor(i / perRow) * POOL_STEP };
}
