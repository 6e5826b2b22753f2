import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../../store/reducer";
import { batch, slot, snapshot } from "../../store/samples";
import type { State } from "../../store/state";
import { rowsOf as objectRows } from "../dictionary/reducer";
import { candumpLog, exported, framesCsv } from "./export";
import { frameAt, knownOf, lineOf } from "./reducer";
import {
  firstFrameOf,
  folded,
  frameOfRow,
  meantBy,
  nameOfRow,
  outcomeOf,
  rowHolding,
  rowNamed,
  steppedRow,
  transferWords,
  wordsOf,
  type Transfer,
} from "./transfers";

const begun = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
const add = (state: State, first: number, frames: string) =>
  reducer(state, { type: "batch", batch: batch(first, frames) });
const rowsOf = (state: State, opened: number[] = []) =>
  folded(state.trace.pieces, state.view.filter, knownOf(state), new Set(opened));
const transfers = (frames: string) =>
  rowsOf(add(begun, 0, frames)).filter((row): row is Transfer => typeof row === "object" && "frames" in row);
const words = (frames: string) => transfers(frames).map(transferWords);

describe("SDO transfers in one row", () => {
  it("takes request and answer together, and leaves other frames where they are", () => {
    const state = add(begun, 10, "70A#05 60A#4017100000000000 70B#05 58A#4B171000F4010000 70A#05");
    const rows = rowsOf(state);
    expect(rows).toMatchObject([10, { frames: [11, 13], state: "done", object: "1017h:00", data: [0xf4, 1] }, 12, 14]);
    expect(rowsOf(state, [11]).slice(1, 4)).toMatchObject([{ frames: [11, 13] }, { child: 11 }, { child: 13 }]);
    expect(rowsOf(state, [99])).toHaveLength(4);
  });

  it("says what a value means where the dictionary knows the object", () => {
    const note = { text: "", unit: "°C", scale: 0.1, values: { "-2": "cold" }, bits: {} };
    const [row] = objectRows({ index: "0x2001", sub: 2, type: "INTEGER16", value: 0, note });
    const [read] = transfers("60A#4001200200000000 58A#4B012002FEFF0000");
    expect(read && meantBy(read, row)).toBe("-0.2 °C, cold");
    expect(read && row && meantBy(read, { ...row, type: "UNSIGNED16" })).toBe("6553.4 °C");
    expect(read && row && meantBy(read, { ...row, type: "UNSIGNED8" }), "two bytes are none").toBe("");
    expect(read && meantBy(read, undefined)).toBe("");
    const [none] = transfers("60A#4001200200000000 58A#8001200211000906");
    expect(none && meantBy(none, row), "an abort has no value").toBe("");
  });

  it("have names by which they are found when other rows come before them", () => {
    const state = add(begun, 10, "70A#05 60A#4017100000000000 70B#05 58A#4B171000F4010000 70A#05");
    const names = rowsOf(state, [11]).map(nameOfRow);
    expect(names).toEqual([10, 11, 11.5, 13.5, 12, 14]);
    const all = rowsOf(
      add(add(begun, 0, "705#05 705#05"), 10, "70A#05 60A#4017100000000000 70B#05 58A#4B171000F4010000 70A#05"),
      [11],
    );
    expect(names.map((name) => rowNamed(all, name))).toEqual([2, 3, 4, 5, 6, 7]);
    // An answer alone becomes a part of its transfer once the request is there.
    expect(rowNamed(rowsOf(state), 13)).toBe(1);
    expect([13.5, 9, 99].map((name) => rowNamed(rowsOf(state), name))).toEqual([1, 0, 4]);
  });

  it("is walked by up and down, an open transfer frame by frame", () => {
    const state = add(begun, 10, "70A#05 60A#4017100000000000 70B#05 58A#4B171000F4010000 70A#05");
    const walk = (opened: number[], from: number | null, step: number) => {
      const set = new Set(opened);
      const rows = rowsOf(state, opened);
      const frames: number[] = [];
      for (let at = from, i = 0; i < 9; i++) {
        const row = steppedRow(rows, at, step, set);
        if (row < 0) return frames;
        at = frameOfRow(rows[row]);
        frames.push(at ?? -1);
      }
      return frames;
    };
    expect(walk([], 10, 1)).toEqual([13, 12, 14]);
    expect(walk([], 14, -1)).toEqual([12, 13, 10]);
    expect(walk([11], 10, 1)).toEqual([11, 13, 12, 14]);
    expect(walk([11], 12, -1)).toEqual([13, 11, 10]);
    expect(walk([], null, -1)[0]).toBe(14);
    const open = rowsOf(state, [11]);
    expect(rowHolding(open, 11, new Set([11]))).toBe(2);
    expect(rowHolding(open, 99, new Set([11]))).toBe(-1);
    expect(open.map((row) => firstFrameOf(open, row))).toEqual([null, 11, 11, 11, null, null]);
  });

  it("takes the segments of an upload and of a download together", () => {
    const upload =
      "60A#4008100000000000 58A#4108100009000000 60A#6000000000000000 58A#0042656C74206F66 60A#7000000000000000 " +
      "58A#1B20620000000000";
    expect(words(upload)).toEqual(['SDO read 1008h:00, node 10: "Belt of b"']);
    const download =
      "60A#2108100009000000 58A#6008100000000000 60A#0042656C74206F66 58A#2000000000000000 60A#1B20620000000000 " +
      "58A#3000000000000000 60A#4017100000000000";
    expect(transfers(download)).toMatchObject([
      { kind: "write", how: "segmented", state: "done", frames: [0, 1, 2, 3, 4, 5] },
      { kind: "read", state: "open" },
    ]);
  });

  it("takes a block upload together, whose segments look like aborts and answers", () => {
    const frames =
      "60A#A40810007F000000 58A#C608100014000000 60A#A300000000000000 58A#0142656C74206F66 58A#0220746865206578 " +
      "58A#83616D706C657300 60A#A2037F0000000000 58A#C538C40000000000 60A#A100000000000000 60A#4017100000000000";
    expect(transfers(frames)).toMatchObject([
      { how: "block", state: "done", object: "1008h:00", frames: [0, 1, 2, 3, 4, 5, 6, 7, 8] },
      { frames: [9], state: "open" },
    ]);
    const block = add(begun, 0, "58A#83616D706C657300");
    const frame = frameAt(block.trace.pieces, 0);
    expect(frame && lineOf(frame, knownOf(block))).not.toMatch(/abort/);
  });

  it("takes a block download together, whose segments look like requests", () => {
    const frames = "60A#C208100009000000 58A#A40810007F000000 60A#0140404040404040 60A#8240400000000000 ";
    const end = "58A#A2027F0000000000 60A#D500000000000000 58A#A100000000000000";
    expect(transfers(frames + end)).toMatchObject([{ how: "block", kind: "write", state: "done" }]);
    // 40h is the 64th segment here, and no read.
    expect(transfers(frames.replace("60A#0140", "60A#4040"))).toHaveLength(1);
  });

  it("says an abort, a missing answer and a missing request", () => {
    expect(words("60A#4018100900000000 58A#8018100911000906")).toEqual(["SDO read 1018h:09, node 10: abort 06090011h"]);
    expect(words("60A#4018100100000000 60A#4018100200000000 58A#4318100211000000")).toEqual([
      "SDO read 1018h:01, node 10: no answer here",
      "SDO read 1018h:02, node 10: 11 00 00 00 (11h)",
    ]);
    expect(words("58A#4318100211000000")).toEqual(["SDO read (its request is not here), node 10: 11 00 00 00 (11h)"]);
    expect(words("60A#2B171000F4010000 58A#6017100000000000")).toEqual(["SDO write 1017h:00, node 10: F4 01 (1F4h)"]);
  });

  it("shows a transfer whole when the filter finds one of its frames, or its own words", () => {
    let state = add(begun, 0, "70A#05 60A#4018100900000000 58A#8018100911000906 60A#4017100000000000");
    state = reducer(state, { type: "view", change: { filter: "abort" } });
    expect(rowsOf(state)).toMatchObject([{ frames: [1, 2] }]);
    state = reducer(state, { type: "view", change: { filter: "1018h:09 06090011h node 10" } });
    expect(rowsOf(state)).toMatchObject([{ frames: [1, 2] }]);
    state = reducer(state, { type: "view", change: { filter: "1019h" } });
    expect(rowsOf(state)).toEqual([]);
  });

  it("takes names from the server's words", () => {
    const [read] = transfers("60A#4017100000000000 58A#4B171000F4010000");
    const texts = new Map([
      [0, "SDO to node 10: read 1017h:00 Producer heartbeat time [belt]"],
      [1, "SDO of node 10: value of 1017h:00"],
    ]);
    expect(read && wordsOf(read, texts)).toBe(texts.get(0));
    expect(read && outcomeOf(read)).toBe("F4 01 (1F4h)");
    const [none] = transfers("60A#4018100900000000 58A#8018100911000906");
    expect(none && wordsOf(none, new Map())).toBe("sub-index does not exist: SDO read 1018h:09, node 10");
    expect(none && outcomeOf(none)).toBe("abort 06090011h");
  });

  it("is put together from 100,000 frames", () => {
    let state = begun;
    const many = "60A#4017100000000000 58A#4B171000F4010000 70A#05 18A#0000 ".repeat(500);
    for (let i = 0; i < 50; i++) state = add(state, i * 2000, many);
    expect(rowsOf(state)).toHaveLength(75_000);
  });
});

describe("markers", () => {
  const change = (state: State, part: Partial<State["view"]>) => reducer(state, { type: "view", change: part });
  it("keep their time when the frames are gone", () => {
    let state = change(add(begun, 5, "701#05"), { marks: [5, 6] });
    expect([...state.trace.marked]).toEqual([[5, 0.005]]);
    state = reducer(state, { type: "trace/clear" });
    expect(state.trace.marked.get(5)).toBe(0.005);
    // One of a link: its frame comes when it is asked for.
    const row = { n: 6, t_s: 0.5, bus: "field", id: 0x703, ext: false, rtr: false, data: "05", text: "w" };
    const message = { type: "frames" as const, id: "mark 6", first: 6, last: 6, rows: [row], matched: 1 };
    state = reducer(state, { type: "message", message, now: 0 });
    expect(state.trace.marked.get(6)).toBe(0.5);
  });
});

describe("what is saved", () => {
  const odd = { type: "message" as const, message: snapshot({ slots: [slot({ id: 1 })] }), now: 0 };
  const state = add(reducer(firstState, odd), 0, "701#05 1E6#0011 181#AABB 1F940000#8000");
  const known = knownOf(state);

  it("is a candump log", () => {
    expect(candumpLog(exported(state.trace.pieces, known), known)).toBe(
      "(0000000000.000000) field 701#05\n(0000000000.001000) field 1E6#0011\n" +
        "(0000000000.002000) field 181#AABB\n(0000000000.003000) field 1F940000#8000\n",
    );
  });

  it("is CSV, of a filter or of a slot", () => {
    const one = exported(state.trace.pieces, known, "field/1").map((frame) => frame.n);
    expect(one).toEqual([0, 2]);
    const filtered = reducer(state, { type: "view", change: { filter: "1E6" } });
    const text = framesCsv(exported(filtered.trace.pieces, known), known, new Map([[1, '=HYPERLINK("x")']]));
    expect(text.split("\r\n")[1]).toBe(`1,0.001000,field,1E6,0,0,0,2,00 11,"'=HYPERLINK(""x"")"`);
  });

  it("names no node that the machine does not have", () => {
    const lines = exported(state.trace.pieces, known).map((frame) => lineOf(frame, known));
    expect(lines[1]).toMatch(/PDO with COB-ID 1E6h$/);
    expect(lines[2]).toMatch(/TPDO 1 of node 1$/);
  });
});
