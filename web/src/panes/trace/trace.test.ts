import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../../store/reducer";
import { batch, snapshot } from "../../store/samples";
import type { State } from "../../store/state";
import { ringCommand, ringPath } from "./export";
import { fileOf, frameAt, MOST_FRAMES, rowOf, rowsOfFile } from "./reducer";

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

describe("a file that is opened", () => {
  const row = (n: number, bus: string, id: number, data: string, text: string) => ({
    ...{ n, t_s: n / 10, bus, id, ext: false, rtr: false, data, text },
  });
  const file = fileOf({
    ...{ name: "run.log", format: "candump", buses: ["can0", "can1"], frames: 9, more_findings: 2 },
    rows: [row(0, "can0", 0x705, "7F", "heartbeat of node 5"), row(1, "can1", 0x601, "4018100400000000", "SDO read")],
    findings: ["run.log:3:1: error: no frame"],
  });

  it("has its own buses, and is filtered by the server's words and by the bytes", () => {
    expect(file.batch.count).toBe(2);
    expect(file.frames).toBe(9);
    expect(rowsOfFile(file, "")).toEqual([0, 1]);
    expect(rowsOfFile(file, "can1")).toEqual([1]);
    expect(rowsOfFile(file, "heartbeat 705#7f")).toEqual([0]);
    expect(rowsOfFile(file, "601#40181004")).toEqual([1]);
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
    expect(ringCommand("http://127.0.0.1:8302", "it's", "/run/a b.token")).toBe(
      `curl -H "Authorization: Bearer $(cat '/run/a b.token')" -o run.log ` +
        `'http://127.0.0.1:8302/api/v1/trace?format=candump&filter=it%27s'`,
    );
    expect(ringCommand("http://127.0.0.1:8302", "", "")).toContain("Bearer TOKEN");
  });
});
