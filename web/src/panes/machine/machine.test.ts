import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../../store/reducer";
import { batch, slot, snapshot } from "../../store/samples";
import { addressTree } from "./reducer";

const a = "00000001-00000010-00010001-00000001";
const b = "00000001-00000010-00010001-00000002";
const found = (address: string) => ({ at_s: 1, bus: "field", kind: "found", text: `found ${address}` });
const bound = (address: string, name: string) => ({
  at_s: 2,
  bus: "field",
  kind: "bound",
  slot: name,
  text: `bound to ${address} as node-ID 10`,
});

describe("the machine", () => {
  it("has found devices without a name, until they are bound", () => {
    const blank = snapshot({ events: [found(a), found(b)], slots: [slot({ r_sn: null, state: "empty" })] });
    let state = reducer(firstState, { type: "message", message: blank, now: 0 });
    expect(state.machine.found.map((device) => device.slot)).toEqual(["", ""]);
    const change = { type: "change" as const, seq: 8, time_s: 2, events: [bound(a, "belt")] };
    state = reducer(state, { type: "message", message: change, now: 0 });
    expect(state.machine.found.map((device) => device.slot)).toEqual(["field/10", ""]);
    const replaced = { type: "change" as const, seq: 9, time_s: 3, events: [bound(b, "belt")] };
    state = reducer(state, { type: "message", message: replaced, now: 0 });
    expect(state.machine.found).toEqual([{ bus: "field", address: b, slot: "field/10" }]);
  });

  it("draws the addresses as a tree", () => {
    const tree = addressTree([
      { bus: "field", address: a, slot: "field/10" },
      { bus: "field", address: b, slot: "" },
    ]);
    expect(tree).toHaveLength(1);
    expect(tree[0]).toMatchObject({ word: "00000001", count: 2, bound: 1 });
    expect(tree[0]?.children[0]?.children[0]?.children.map((node) => node.word)).toEqual(["00000001", "00000002"]);
  });

  it("hears the questions of a search", () => {
    let state = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
    state = reducer(state, { type: "batch", batch: batch(0, "7E5#4C00000000000000 1F940000#80010001 701#05") });
    expect(state.machine.question).toEqual({ bus: "field", text: "RAND request, phase 1, mask 0001h", n: 2 });
  });
});
