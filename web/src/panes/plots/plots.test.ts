import { describe, expect, it } from "vitest";
import type { Rates } from "../../protocol/messages";
import { firstState, reducer } from "../../store/reducer";
import { batch, snapshot } from "../../store/samples";
import type { State } from "../../store/state";
import { fragmentOf, MOST_WATCHED, parseView } from "../../store/view";
import {
  createTurns,
  figuresOf,
  groupsOf,
  inUnits,
  MOST_FAILURES,
  noteOfWatched,
  plotRows,
  watchKey,
  watchOwner,
  watchParts,
} from "./reducer";

const begun = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
const rates = (load: number, frames: number): Rates => ({
  type: "rates",
  buses: [{ bus: "field", frames_per_s: frames, load }],
  ring: { first: 0, next: 9 },
  left_out: 0,
});
const add = (state: State, first: number, frames: string) =>
  reducer(state, { type: "batch", batch: batch(first, frames) });

const key = watchKey("field/10", "6041h:00");
let ids = 0;
function read(state: State, value: unknown, now: number, status = 0, more: object = {}): State {
  const id = `w${++ids}`;
  const sent = reducer(state, { type: "sent", id, verb: "sdo read", values: {}, owner: watchOwner(key) });
  const reply = { index: "0x6041", sub: 0, value, name: "", bytes: "", type: "UNSIGNED16", ...more };
  const message = { type: "reply" as const, id, status, reply, lines: [], error: status ? "no answer" : "" };
  return reducer(sent, { type: "message", now, message });
}

describe("the plots", () => {
  it("have load and frames of each bus", () => {
    let state = reducer(begun, { type: "message", message: rates(0.25, 100), now: 3 });
    state = reducer(state, { type: "message", message: rates(0.5, 200), now: 4 });
    expect(state.plots.load).toEqual({
      field: [
        [3, 25],
        [4, 50],
      ],
    });
    expect(state.plots.frames.field?.[1]).toEqual([4, 200]);
  });

  it("measure heartbeats, not over a boot-up, a guarding request or missed frames", () => {
    let state = add(begun, 0, "70A#05 70B#05 18A#00 70A#05 70A#00 70A#7F");
    const intervals = () => (state.plots.beats.get("0/10") ?? []).map(([, ms]) => Math.round(ms));
    expect(intervals()).toEqual([3, 1]);
    // Again what was there, as after a reconnection, and then what follows.
    state = add(state, 4, "70A#00 70A#7F 70A#7F");
    expect(intervals()).toEqual([3, 1, 1]);
    state = add(state, 50, "70A#05 70A#05");
    expect(intervals()).toEqual([3, 1, 1, 1]);
    expect(state.plots.beats.get("0/11")).toBeUndefined();
  });

  it("stand while paused, and lose nothing", () => {
    let state = reducer(begun, { type: "message", message: rates(0.25, 100), now: 3 });
    state = reducer(state, { type: "plots/pause", paused: true });
    state = reducer(state, { type: "message", message: rates(0.5, 200), now: 4 });
    expect(state.plots.paused?.load.field).toHaveLength(1);
    state = reducer(state, { type: "plots/pause", paused: false });
    expect(state.plots.load.field).toHaveLength(2);
  });

  it("say how regular something is", () => {
    expect(figuresOf([])).toBeNull();
    const points = [9, 10, 11, 10].map((value, i) => [i, value] as const);
    expect(figuresOf(points)).toMatchObject({ count: 4, mean: 10, least: 9, most: 11 });
    expect(figuresOf(points)?.spread).toBeCloseTo(Math.sqrt(0.5), 9);
  });

  it("have watched objects in the unit of their note, one plot for each unit", () => {
    const note = { unit: "°C", scale: 0.1 };
    const state = read(begun, 235, 2, 0, { note, quantity: "23.5 °C" });
    expect(state.plots.watched[key]?.text).toBe("23.5 °C");
    const noteOf = (each: string) => noteOfWatched(state.dictionary.objects, each);
    expect(noteOf(key)).toMatchObject({ unit: "°C", scale: 0.1 });
    expect(inUnits(state.plots.values[key] ?? [], noteOf(key))).toEqual([[2, 23.5]]);
    expect(plotRows(state.plots, [], noteOf)[1]).toEqual([key, "°C", "page", "2.000000", 23.5]);
    expect(groupsOf(["field/11 2000h:00", key, "field/12 2000h:00"], noteOf)).toEqual([
      { unit: "", keys: ["field/11 2000h:00", "field/12 2000h:00"] },
      { unit: "°C", keys: [key] },
    ]);
    // Counts of an object without a note stay counts.
    expect(inUnits([[1, 3]], null)).toEqual([[1, 3]]);
  });

  it("are saved, a row a point", () => {
    let state = add(begun, 0, "70A#05 70A#05");
    state = read(state, 7, 2);
    expect(plotRows(state.plots, ["field"])).toEqual([
      ["series", "unit", "clock", "time_s", "value"],
      ["heartbeat interval field/10", "ms", "bus", "0.001000", 1],
      ["field/10 6041h:00", "", "page", "2.000000", 7],
    ]);
  });
});

describe("the watch list", () => {
  it("is read in turn, a round no sooner than it should be", () => {
    const next = createTurns();
    expect([0, 0.1, 0.2, 0.9, 1.0, 1.1].map((now) => next(now, ["a", "b"], 1))).toEqual([
      "a",
      "b",
      null,
      null,
      "a",
      "b",
    ]);
    // It became shorter, and empty.
    expect(next(2.5, ["c"], 1)).toBe("c");
    expect(next(9, [], 1)).toBeNull();
  });

  it("keeps numbers, and says what else was answered", () => {
    let state = read(begun, 39, 1);
    state = read(state, "Belt", 2);
    expect(state.plots.values[key]).toEqual([[1, 39]]);
    expect(state.plots.watched[key]).toEqual({ text: "Belt", error: "" });
    state = read(state, true, 3);
    expect(state.plots.values[key]?.[1]).toEqual([3, 1]);
    // The dictionary shows it, too.
    expect(state.dictionary.objects["field/10"]?.[0]).toMatchObject({ key: "6041h:00", value: "true" });
  });

  it("stops after errors in a row, and goes on when told", () => {
    let state = begun;
    for (let i = 0; i < MOST_FAILURES; i++) state = read(state, 0, i, 3);
    expect(state.plots).toMatchObject({ failures: MOST_FAILURES, values: {} });
    expect(state.plots.watched[key]?.error).toBe("no answer");
    expect(reducer(state, { type: "plots/again" }).plots.failures).toBe(0);
    expect(read(state, 5, 9).plots.failures).toBe(0);
  });

  it("does not push out what a person asked for", () => {
    let state = reducer(begun, { type: "sent", id: "mine", verb: "scan", values: {}, owner: "network" });
    for (let i = 0; i < 300; i++) state = read(state, i, i);
    expect(state.requests.map((sent) => sent.id)).toContain("mine");
    expect(state.requests).toHaveLength(2);
  });

  it("is read no oftener than twice a second", () => {
    const every = (seconds: number) => reducer(begun, { type: "plots/every", seconds }).plots.every;
    expect([0.1, NaN, -3, 2.5, 1e9].map(every)).toEqual([0.5, 0.5, 0.5, 2.5, 3600]);
  });

  it("is in the address", () => {
    const watch = [watchKey("a b/10", "6041h:00"), watchKey("field/127", "1A00h:08")];
    const view = { ...begun.view, watch };
    expect(parseView(fragmentOf(view))).toEqual(view);
    expect(watchParts(watch[0] ?? "")).toEqual({ slot: "a b/10", object: "6041h:00" });
    expect(parseView("#watch=x&watch=field/1 zz&watch=field/1 6041h:00").watch).toEqual(["field/1 6041h:00"]);
    const many = Array.from({ length: 40 }, (_, i) => `watch=field/${i} 1000h:00`).join("&");
    expect(parseView(`#${many}`).watch).toHaveLength(MOST_WATCHED);
  });
});
