import { describe, expect, it } from "vitest";
import { layoutsOf, signalOf, valueOf, valueWords, type Signal } from "../../can/signals";
import { bytesOf } from "../../protocol/batch";
import { firstState, reducer } from "../../store/reducer";
import { batch, snapshot } from "../../store/samples";
import type { State } from "../../store/state";
import { fragmentOf, MOST_SIGNALS, parseView, signalChange } from "../../store/view";
import { endOf, frameNear, held, MOST_SIGNAL_POINTS, signalRows, thinned } from "./signals";

const speed: Signal = { name: "speed", at: 4, bits: 12, type: "signed", object: "6044h:00", unit: "rpm", factor: 0.5 };
const state8: Signal = {
  ...{ name: "state", at: 16, bits: 8, type: "unsigned" as const },
  values: [{ raw: 0, name: "stands" }],
};
const layouts = layoutsOf({
  buses: [
    {
      bus: "field",
      messages: [
        { id: 0x18a, ext: false, name: "TPDO 1", sender: "belt", signals: [speed, state8] },
        { id: 0x18a, ext: true, name: "other", sender: "x", signals: [state8] },
      ],
    },
  ],
});

describe("a signal", () => {
  it("is a number of its bits, little endian, in its unit", () => {
    // 12 bits from bit 4 on: FFEh is -2 of them, 7D0h is 2000.
    expect(valueOf(bytesOf("E3FF00"), speed)).toBe(-1);
    expect(valueOf(bytesOf("0F7D"), speed)).toBe(1000);
    expect(valueWords(bytesOf("0F7D"), speed)).toBe("1000 rpm");
    expect(valueWords(bytesOf("000000"), state8)).toBe("stands (0)");
    expect(valueWords(bytesOf("000007"), state8)).toBe("7");
    // The frame ends before it.
    expect(valueOf(bytesOf("0000"), state8)).toBeNull();
    expect(valueWords(bytesOf("0000"), state8)).toBe("");
  });

  it("may be a real number, a bit, or of 64 bits", () => {
    const of = (type: Signal["type"], bits: number, at = 0): Signal => ({ name: "", at, bits, type });
    // IEEE 754: 1.5 is 3FC00000h, -2 is C000000000000000h.
    expect(valueOf(bytesOf("0000C03F"), of("real", 32))).toBe(1.5);
    expect(valueOf(bytesOf("00000000000000C0"), of("real", 64))).toBe(-2);
    expect(valueOf(bytesOf("40"), of("boolean", 1, 6))).toBe(1);
    expect(valueWords(bytesOf("FFFFFFFFFFFFFF7F"), of("signed", 64))).toBe("9223372036854775807");
    expect(valueOf(bytesOf("FFFFFFFFFFFFFFFF"), of("signed", 64))).toBe(-1);
  });

  it("is found by message and bit", () => {
    expect(signalOf(layouts, "field/18A 16")?.of.name).toBe("TPDO 1");
    expect(signalOf(layouts, "field/0000018A 16")?.of.name).toBe("other");
    expect(signalOf(layouts, "field/18A 5")).toBeNull();
    expect(signalOf(layouts, "other/18A 16")).toBeNull();
  });
});

const begun = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
const add = (state: State, first: number, frames: string) =>
  reducer(state, { type: "batch", batch: batch(first, frames) });
const choose = (state: State, signals: string[]) => reducer(state, { type: "view", change: { signals } });
const key = "field/18A 4";
const known = reducer(begun, { type: "signals/layouts", layouts });

describe("signals in the plots", () => {
  it("come from the frames: those that are here, and each that follows once", () => {
    let state = choose(add(known, 0, "18A#0F7D00 70A#05 0000018A#0F7D00"), [key]);
    state = add(state, 3, "18A#E3FF00 18A#00");
    // Again what was there, as after a reconnection.
    state = add(state, 3, "18A#E3FF00 18A#00 18A#0F7D00");
    const line = state.signals.lines.get(key);
    expect(line?.points).toEqual([
      [0, 1000],
      [0.003, -1],
      [0.005, 1000],
    ]);
    expect(line?.frames).toEqual([0, 3, 5]);
    expect(choose(state, []).signals.lines.size).toBe(0);
  });

  it("wait for what the server says of them, and are asked for anew with each snapshot", () => {
    let state = add(choose(begun, [key]), 0, "18A#0F7D00");
    expect(state.signals.lines.get(key)?.points).toEqual([]);
    state = reducer(state, { type: "signals/layouts", layouts });
    expect(state.signals.lines.get(key)?.points).toEqual([[0, 1000]]);
    expect(state.signals.fresh).toBe(true);
    expect(reducer(state, { type: "message", message: snapshot(), now: 1 }).signals.fresh).toBe(false);
  });

  it("stand while paused, at a time that a person wants, and lose nothing", () => {
    let state = add(choose(known, [key]), 0, "18A#0F7D00");
    state = reducer(state, { type: "signals/at", seconds: 0 });
    state = add(state, 1, "18A#0F7D00");
    expect(state.signals.paused?.get(key)?.points).toHaveLength(1);
    expect(state.signals.at).toBe(0);
    state = reducer(state, { type: "plots/pause", paused: false });
    expect(state.signals).toMatchObject({ paused: null, at: null });
    expect(state.signals.lines.get(key)?.points).toHaveLength(2);
  });

  it("lead to the frame of a time", () => {
    const line = { points: [1, 2, 4].map((at) => [at, 0] as const), frames: [10, 20, 40] };
    const other = { points: [[2.9, 0] as const], frames: [29] };
    expect([0, 1.4, 1.6, 3.1, 9].map((at) => frameNear([line], at))).toEqual([10, 10, 20, 40, 40]);
    expect(frameNear([line, other], 3)).toBe(29);
    expect(frameNear([{ points: [], frames: [] }], 3)).toBeNull();
    expect([null, 1, 3].map((at) => endOf(4, at, 2))).toEqual([4, 2, 4]);
  });

  it("stand until the next value, into what is seen and to its end", () => {
    const points = [1, 2, 4].map((at) => [at, at * 10] as const);
    expect(held(points, 1.5, 3)).toEqual([
      [1.5, 10],
      [2, 20],
      [3, 20],
    ]);
    expect(held(points, 5, 6)).toEqual([
      [5, 40],
      [6, 40],
    ]);
    expect(held([], 0, 1)).toEqual([]);
    const state = add(known, 0, "70A#05 70A#05");
    expect(state.signals.now).toBe(0.001);
  });

  it("keep their peaks when there are more points than a screen shows", () => {
    const points = Array.from({ length: 10_000 }, (_, i) => [i / 1000, i === 5000 ? 99 : i % 2] as const);
    const drawn = thinned(points, 0, 10);
    expect(drawn.length).toBeLessThanOrEqual(1200);
    expect(Math.max(...drawn.map(([, value]) => value))).toBe(99);
    expect(thinned(points, 1, 1.003)).toHaveLength(4);
  });

  it("are bounded, and saved a row a point", () => {
    let state = choose(known, [key]);
    const many = "18A#0F7D00 ".repeat(2000);
    for (let i = 0; i < 12; i++) state = add(state, i * 2000, many);
    expect(state.signals.lines.get(key)?.points).toHaveLength(MOST_SIGNAL_POINTS);
    state = choose(add(known, 0, "18A#0F7D00"), [key]);
    expect(signalRows(state.signals)).toEqual([["belt speed", "rpm", "bus", "0.000000", 1000]]);
  });

  it("are in the address", () => {
    const view = { ...begun.view, signals: ["field/18A 4", "a b/1F940000 63"] };
    expect(parseView(fragmentOf(view))).toEqual(view);
    expect(parseView("#signal=x&signal=field/18a 4&signal=field/18A 4").signals).toEqual(["field/18A 4"]);
    const full = Array.from({ length: MOST_SIGNALS }, (_, i) => `field/18A ${i}`);
    expect(signalChange({ signals: full }, "field/18A 99")).toEqual({});
    expect(signalChange({ signals: full }, "field/18A 0").signals).toHaveLength(MOST_SIGNALS - 1);
  });
});
