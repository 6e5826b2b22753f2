import { describe, expect, it } from "vitest";
import { healthWords, isUnwell, restWords } from "../../parts/health";
import { decodeBatch, frameOf } from "../../protocol/batch";
import { firstState, reducer } from "../../store/reducer";
import { batch, snapshot } from "../../store/samples";
import type { State } from "../../store/state";
import { candumpLog, exported, fileCommand, ringCommand, ringPath, whole } from "./export";
import { fileOf, frameAt, listedOf, markChange, meaningIn, MOST_FRAMES, rowFrom, rowOf, type Piece } from "./reducer";

const begun = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
const add = (state: State, first: number, frames: string) =>
  reducer(state, { type: "batch", batch: batch(first, frames) });

describe("the trace", () => {
  it("joins small batches, and finds frames by row and by number", () => {
    let state = add(begun, 100, "701#05 702#05");
    state = add(state, 102, "703#05");
    expect(state.trace.pieces).toHaveLength(1);
    expect(frameAt(state.trace.pieces, 2)?.id).toBe(0x703);
    state = add(state, 200, "704#05");
    expect(state.trace.pieces).toHaveLength(2);
    expect(frameAt(state.trace.pieces, 3)?.n).toBe(200);
    expect(rowOf(state.trace.pieces, 200)).toBe(3);
    expect(rowOf(state.trace.pieces, 150)).toBe(-1);
    expect([0, 102, 103, 200, 201].map((n) => rowFrom(state.trace.pieces, n))).toEqual([0, 2, 3, 3, 4]);
    state = reducer(state, { type: "view", change: { filter: "703#" } });
    expect([100, 102, 103].map((n) => rowFrom(state.trace.pieces, n))).toEqual([0, 0, 1]);
  });

  it("takes nothing twice", () => {
    let state = add(begun, 0, "701#05 702#05");
    state = add(state, 0, "701#05 702#05");
    expect(state.trace.kept).toBe(2);
  });

  it("filters by all words, what is there and what comes", () => {
    let state = add(begun, 0, "701#05 605#4018100400000000 585#8018100400000206");
    state = reducer(state, { type: "view", change: { filter: "1018h ABORT" } });
    expect(state.trace.shown).toBe(1);
    state = add(state, 3, "585#8018100400000206 702#05");
    expect(state.trace.shown).toBe(2);
    expect(frameAt(state.trace.pieces, 1)?.n).toBe(3);
    state = reducer(state, { type: "view", change: { filter: "701#05" } });
    expect(state.trace.shown).toBe(1);
    state = reducer(state, { type: "view", change: { filter: "" } });
    expect(state.trace.shown).toBe(5);
  });

  it("loses nothing while it is paused", () => {
    let state = add(begun, 0, "701#05");
    state = reducer(state, { type: "trace/pause", paused: true });
    state = add(state, 1, "702#05 703#05");
    expect(state.trace.paused?.shown).toBe(1);
    state = reducer(state, { type: "trace/pause", paused: false });
    expect(state.trace.shown).toBe(3);
  });

  it("keeps a paused list's end where it was when older frames come late", () => {
    let state = add(begun, 10, "701#05 702#05");
    state = reducer(state, { type: "trace/pause", paused: true });
    state = add(state, 12, "703#05");
    const row = (n: number) => ({ n, t_s: 0, bus: "field", id: 0x704, ext: false, rtr: false, data: "05", text: "" });
    const rows = [8, 12, 13].map(row);
    const message = { type: "frames" as const, id: "f1", first: 0, last: 14, rows, matched: 3 };
    state = reducer(state, { type: "message", message, now: 0 });
    const numbers = (pieces: readonly Piece[]) =>
      pieces.flatMap(({ batch }) => Array.from({ length: batch.count }, (_, i) => batch.first + i));
    expect(numbers(state.trace.paused?.pieces ?? [])).toEqual([8, 10, 11]);
    expect(state.trace.paused?.shown).toBe(3);
    expect(numbers(state.trace.pieces)).toEqual([8, 10, 11, 12, 13]);
    state = reducer(state, { type: "view", change: { filter: "703#" } });
    state = reducer(state, { type: "message", message: { ...message, rows: [9, 12].map(row) }, now: 0 });
    expect(state.trace.paused?.shown).toBe(0);
    expect(numbers(state.trace.paused?.pieces ?? [])).toEqual([8, 9, 10, 11]);
  });

  it("shows what is asked for in a list that was paused while it was empty", () => {
    let state = reducer(begun, { type: "trace/pause", paused: true });
    const rows = [{ n: 3, t_s: 0, bus: "field", id: 0x704, ext: false, rtr: false, data: "05", text: "" }];
    const message = { type: "frames" as const, id: "f1", first: 0, last: 4, rows, matched: 1 };
    state = reducer(state, { type: "message", message, now: 0 });
    expect(state.trace.paused?.shown).toBe(1);
  });

  it("puts rows of the server's ring where they belong", () => {
    let state = add(begun, 10, "701#05 702#05");
    const row = (n: number) => ({
      n,
      t_s: n / 1000,
      bus: "field",
      id: 0x703,
      ext: false,
      rtr: false,
      data: "05",
      text: `w${n}`,
    });
    const message = { type: "frames" as const, id: "f1", first: 0, last: 12, rows: [8, 9, 10].map(row), matched: 3 };
    state = reducer(state, { type: "message", message, now: 0 });
    expect([0, 1, 2, 3].map((i) => frameAt(state.trace.pieces, i)?.n)).toEqual([8, 9, 10, 11]);
    expect(state.trace.texts.get(8)).toBe("w8");
  });

  it("counts by identifier, with the period", () => {
    const state = add(add(begun, 0, "701#05 702#05 701#05"), 3, "701#04");
    const entry = [...state.trace.latest.values()].find(({ frame }) => frame.id === 0x701);
    expect(entry).toMatchObject({ count: 3, service: "heartbeat" });
    expect(entry?.period).toBeCloseTo(0.001, 9);
    expect(entry?.frame.data[0]).toBe(4);
  });

  it("keeps no more than it says", () => {
    let state = begun;
    const many = "701#05 ".repeat(2000);
    for (let i = 0; i < 60; i++) state = add(state, i * 2000, many);
    expect(state.trace.kept).toBeLessThanOrEqual(MOST_FRAMES);
    expect(frameAt(state.trace.pieces, state.trace.shown - 1)?.n).toBe(119_999);
  });
});

describe("errors on a bus", () => {
  const row = (n: number, id: number, data: string, more: object) => ({
    ...{ n, t_s: n / 10, bus: "field", id, ext: false, rtr: false, data, text: "the server's words" },
    ...more,
  });
  const rows = [
    row(0, 0x288, "0000840A00001000", { error: true as const }),
    row(1, 0x2a8, "0000801900008000", { error: true as const }),
    row(2, 0x185, "0102030405060708", { cut: true as const }),
  ];
  const message = { type: "frames" as const, id: "old", first: 0, last: 2, rows, matched: 3 };
  const state = reducer(begun, { type: "message", message, now: 0 });
  const known = listedOf(state).known;
  const frames = exported(state.trace.pieces, known);

  it("are rows that no service takes for its frames", () => {
    expect(frames.map((frame) => meaningIn(frame, known).service)).toEqual(["error", "error", "PDO1"]);
    const words = frames.map((frame) => meaningIn(frame, known).text);
    expect(words.slice(0, 2)).toEqual(["error frame: stuff in data", "error frame: no acknowledge in ACK slot"]);
    expect([...state.trace.latest.values()].map(({ service }) => service)).toContain("error");
  });

  it("are saved as candump writes them, and frames that are cut are not", () => {
    expect(candumpLog(whole(frames), known)).toBe(
      "(0000000000.000000) field 20000288#0000840A00001000\n(0000000000.100000) field 200002A8#0000801900008000\n",
    );
  });

  it("are told by a binary batch", () => {
    const buffer = new ArrayBuffer(24 + 10 + 8);
    const view = new DataView(buffer);
    view.setUint16(0, 0x0101);
    view.setUint16(2, 1, true);
    view.setUint32(28, 0x20000288, true);
    view.setUint8(33, 0x18);
    const decoded = decodeBatch(buffer);
    expect(decoded && frameOf(decoded, 0)).toMatchObject({ id: 0x288, error: true, cut: true, extended: false });
  });

  it("are told apart from a bus that rests", () => {
    const shut = { state: "unknown", reason: "another master is on this bus" };
    expect(restWords([shut, shut])).toBe("another master is on this bus");
    expect(restWords([shut, { ...shut, reason: "gateway 3 does not answer" }])).toBe("");
    expect(restWords([shut, { ...shut, state: "operational" }])).toBe("");
    expect(restWords([{ state: "unknown" }])).toBe("");
    expect(restWords([])).toBe("");
  });

  it("are counted and plotted by bus", () => {
    const bus = { bus: "field", frames_per_s: 1, load: 0, errors_per_s: 4, errors: 9, state: "passive" as const };
    const rates = { type: "rates" as const, buses: [bus], ring: { first: 0, next: 0 }, left_out: 0 };
    const plots = reducer(begun, { type: "message", message: rates, now: 2 }).plots;
    expect(plots.errors.field).toEqual([[2, 4]]);
    expect(healthWords({ ...bus, tec: 130, rec: 0 })).toBe("9 error frames, error-passive, TEC 130, REC 0");
    expect(healthWords({ bus: "x", frames_per_s: 0, load: 0 })).toBe("no error frames");
    expect([bus, { ...bus, errors_per_s: 0, state: "active" as const }].map(isUnwell)).toEqual([true, false]);
  });
});

describe("a file that is opened", () => {
  const row = (n: number, bus: string, id: number, data: string, text: string) => ({
    ...{ n, t_s: n / 10, bus, id, ext: false, rtr: false, data, text },
  });
  const file = fileOf({
    ...{ name: "run.log", format: "candump", buses: ["can0", "can1"], frames: 9, more_findings: 2 },
    rows: [row(0, "can0", 0x705, "7F", "heartbeat of node 5"), row(1, "can1", 0x601, "4018100400000000", "SDO read")],
    findings: ["run.log:3:1: error: no frame"],
  });

  const opened = reducer(reducer(add(begun, 0, "701#05"), { type: "view", change: { pane: "trace" } }), {
    type: "trace/file",
    file,
  });
  const listed = (filter: string) => {
    const { list } = listedOf(reducer(opened, { type: "view", change: { filter } }));
    const pieces = list.paused?.pieces ?? [];
    return Array.from({ length: list.paused?.shown ?? 0 }, (_, i) => frameAt(pieces, i)?.n);
  };

  it("has its own buses, and is filtered by the server's words and by the bytes", () => {
    expect(file.frames).toBe(9);
    expect(listed("")).toEqual([0, 1]);
    expect(listed("can1")).toEqual([1]);
    expect(listed("heartbeat 705#7f")).toEqual([0]);
    expect(listed("601#40181004")).toEqual([1]);
    // A filter that was there before the file.
    const before = reducer(begun, { type: "view", change: { filter: "705#" } });
    expect(reducer(before, { type: "trace/file", file }).trace.file?.list.paused?.shown).toBe(1);
  });

  it("has its own choice and markers, and the address keeps those of the machine's frames", () => {
    let state = reducer(opened, { type: "view", change: { frame: 0, marks: [0], zero: 0 } });
    state = reducer(state, { type: "trace/pick", change: { frame: 1, ...markChange({ marks: [], zero: null }, 1) } });
    expect(listedOf(state).picked).toEqual({ frame: 1, marks: [1], zero: 1 });
    expect([...listedOf(state).list.marked]).toEqual([[1, 0.1]]);
    expect(state.view).toMatchObject({ frame: 0, marks: [0], zero: 0 });
    // In another pane it is the machine's frame that is chosen.
    state = reducer(state, { type: "view", change: { pane: "plots" } });
    expect(listedOf(state).picked.frame).toBe(0);
    expect(reducer(opened, { type: "trace/file", file: null }).trace.file).toBeNull();
  });

  it("folds its transfers by itself", () => {
    const state = reducer(opened, { type: "trace/open", first: 1, open: true });
    expect([...listedOf(state).list.opened]).toEqual([1]);
    expect(state.trace.opened.size).toBe(0);
  });

  it("is saved by what is listed, and written in other formats by the command line", () => {
    const { list, known } = listedOf(reducer(opened, { type: "view", change: { filter: "601#" } }));
    expect(candumpLog(exported(list.pieces, known), known)).toBe("(0000000000.100000) can1 601#4018100400000000\n");
    expect(fileCommand("a b.log.gz")).toBe("berth trace 'a b.log.gz' -o 'a b.pcapng'");
  });

  it("stands instead of the machine's frames until it is closed, and these go on", () => {
    let state = reducer(add(begun, 0, "701#05"), { type: "trace/file", file });
    state = add(state, 1, "702#05");
    expect(state.trace.file?.name).toBe("run.log");
    expect(state.trace.kept).toBe(2);
    state = reducer(state, { type: "trace/file", file: null });
    expect(state.trace.file).toBeNull();
    expect(state.trace.kept).toBe(2);
  });
});

describe("the whole ring", () => {
  it("is asked for by an address and by a command that a shell takes", () => {
    expect(ringPath("pcapng", "")).toBe("/api/v1/trace?format=pcapng");
    expect(ringPath("asc", "sdo 605#")).toBe("/api/v1/trace?format=asc&filter=sdo%20605%23");
    expect(ringCommand("it's", "/m/a b.toml", "/run/b.token")).toBe(
      "berth trace --ring --filter 'it'\\''s' -o run.log -m '/m/a b.toml'",
    );
    expect(ringCommand("", "", "/run/a b.sock.token.view")).toBe(
      "berth trace --ring -o run.log --control '/run/a b.sock'",
    );
    expect(ringCommand("", "", "")).toContain("--control SOCKET");
  });
});
