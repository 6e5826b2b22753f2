import { describe, expect, it } from "vitest";
import type { ServerMessage } from "../protocol/messages";
import { firstState, reducer } from "./reducer";
import { batch, slot, snapshot } from "./samples";
import type { State } from "./state";
import { changedView, firstView, fragmentOf, parseView } from "./view";

const receive = (state: State, message: ServerMessage) => reducer(state, { type: "message", message, now: 0 });

describe("the copy of the server's truth", () => {
  it("is the snapshot, then each change in order", () => {
    let state = receive(firstState, snapshot());
    expect(state.connection.phase).toBe("open");
    state = receive(state, {
      type: "change",
      seq: 8,
      time_s: 3,
      slots: [slot({ state: "absent" })],
      events: [{ at_s: 3, bus: "field", kind: "state", slot: "belt", text: "absent" }],
    });
    expect(state.data.slots.map((entry) => entry.state)).toEqual(["absent", "operational"]);
    expect(state.data.events).toHaveLength(1);
    expect(state.data.time).toBe(3);
    const question = { at_s: 3, bus: "field", kind: "question", text: "which?", slots: ["belt"] };
    state = receive(state, { type: "change", seq: 9, time_s: 3, questions: [question] });
    state = receive(state, { type: "change", seq: 10, time_s: 4 });
    expect(state.data.questions).toEqual([question]);
    state = receive(state, { type: "change", seq: 11, time_s: 4, questions: [] });
    expect(state.data.questions).toEqual([]);
  });

  it("lets go of frames and what was measured on them after another start of the server", () => {
    let state = receive(firstState, snapshot({ start: "one" }));
    state = reducer(state, { type: "batch", batch: batch(1000, "701#05 702#05") });
    state = reducer(state, { type: "view", change: { marks: [1000], zero: 1000, frame: 1001, filter: "7" } });
    state = receive(state, snapshot({ start: "one", seq: 30 }));
    expect(state.trace.kept).toBe(2);
    expect(state.view.marks).toEqual([1000]);
    state = receive(state, snapshot({ start: "other", seq: 1 }));
    expect(state.trace.kept).toBe(0);
    expect(state.view).toMatchObject({ marks: [], zero: null, frame: null, filter: "7" });
    state = reducer(state, { type: "batch", batch: batch(0, "701#05") });
    expect(state.trace.kept).toBe(1);
  });

  it("has the time of the world also while nothing changes", () => {
    const world = { paused: true, speed: 2, time_s: 9 };
    let state = receive(firstState, snapshot());
    state = receive(state, { type: "rates", buses: [], ring: { first: 0, next: 0 }, left_out: 0, world });
    expect(state.data).toMatchObject({ time: 9, world });
  });

  it("does not believe a change behind a gap, and takes the next snapshot whole", () => {
    let state = receive(firstState, snapshot());
    state = receive(state, { type: "change", seq: 9, time_s: 3, slots: [slot({ state: "failed" })] });
    expect(state.connection.phase).toBe("gap");
    expect(state.data.slots[0]?.state).toBe("operational");
    state = receive(state, { type: "change", seq: 8, time_s: 3, slots: [slot({ state: "failed" })] });
    expect(state.data.slots[0]?.state).toBe("operational");
    state = receive(state, snapshot({ seq: 20, slots: [slot({ state: "failed" })] }));
    expect(state.connection.phase).toBe("open");
    expect(state.data.slots).toHaveLength(1);
  });

  it("keeps the last events only", () => {
    let state = receive(firstState, snapshot());
    const events = Array.from({ length: 6000 }, (_, i) => ({ at_s: i, bus: "field", kind: "step", text: "" }));
    state = receive(state, { type: "change", seq: 8, time_s: 3, events });
    expect(state.data.events).toHaveLength(5000);
    expect(state.data.events[4999]?.at_s).toBe(5999);
  });

  it("finds the answer of a request by its id", () => {
    let state = reducer(firstState, { type: "sent", id: "r1", verb: "scan", values: {}, owner: "network" });
    expect(state.requests[0]?.done).toBe(false);
    state = receive(state, { type: "reply", id: "r1", status: 1, reply: {}, lines: ["two"], error: "no" });
    expect(state.requests[0]).toMatchObject({ done: true, status: 1, lines: ["two"], error: "no" });
  });

  it("knows at what bus time a request was answered", () => {
    let state = receive(firstState, snapshot({ time_s: 12.5 }));
    state = reducer(state, { type: "sent", id: "r1", verb: "scan", values: {}, owner: "network" });
    state = receive(state, { type: "change", seq: 8, time_s: 13 });
    state = receive(state, { type: "reply", id: "r1", status: 1, reply: {}, lines: [], error: "" });
    state = receive(state, { type: "change", seq: 9, time_s: 14 });
    expect(state.requests[0]?.answeredS).toBe(13);
  });
});

describe("the view", () => {
  it("comes back from the address as it went there", () => {
    const view = { ...firstView, pane: "trace" as const, slot: "field/12", frame: 99, filter: "abort 1018h" };
    const marked = { ...view, mode: "folded" as const, marks: [812, 4711], zero: 812 };
    expect(parseView(fragmentOf(marked))).toEqual(marked);
    expect(parseView(fragmentOf(view))).toEqual(view);
  });
  it("has a slot selected, or a device without one", () => {
    const device = "field/00000001-00000003-00000000-00000031";
    const chosen = changedView({ ...firstView, slot: "field/2", object: "1018h:04" }, { device });
    expect(chosen).toMatchObject({ slot: "", object: "", device });
    expect(parseView(fragmentOf(chosen))).toEqual(chosen);
    expect(changedView(chosen, { slot: "field/2" }).device).toBe("");
    expect(changedView(chosen, { pane: "slots" }).device).toBe(device);
    expect(parseView("#device=field/<b>").device).toBe("");
  });
  it("takes no nonsense from an address", () => {
    expect(parseView("#pane=__proto__&frame=-1&mode=x&marks=&zero=")).toEqual(firstView);
    expect(parseView("#marks=9,x,-1,2,9,1e99").marks).toEqual([2, 9]);
    expect(parseView(`#marks=${Array.from({ length: 99 }, (_, i) => i).join(",")}`).marks).toHaveLength(20);
  });
  it("lets go of a frame when another slot is selected", () => {
    const view = changedView({ ...firstView, frame: 3, object: "1018h:04" }, { slot: "field/2" });
    expect(view).toMatchObject({ slot: "field/2", frame: null, object: "" });
  });
});
