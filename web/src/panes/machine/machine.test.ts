import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../../store/reducer";
import { batch, slot, snapshot } from "../../store/samples";
import type { ServerMessage, Snapshot } from "../../protocol/messages";
import type { State } from "../../store/state";
import { PLANT_OWNER } from "../world/reducer";
import { addressTree, type FoundDevice } from "./reducer";
import { alsoLine, inNeedOf, straysOf, whyWords } from "./strays";

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
    expect(state.machine.found).toMatchObject([{ bus: "field", address: b, slot: "field/10" }]);
  });

  it("draws the addresses as a tree", () => {
    const tree = addressTree([
      { bus: "field", address: a, slot: "field/10", toldS: 1, says: null },
      { bus: "field", address: b, slot: "", toldS: 1, says: null },
    ]);
    expect(tree).toHaveLength(1);
    expect(tree[0]).toMatchObject({ word: "00000001", count: 2, bound: 1 });
    expect(tree[0]?.children[0]?.children[0]?.children.map((node) => node.word)).toEqual(["00000001", "00000002"]);
  });

  const odd = (kind: string, address: string, at_s = 3) => {
    return { at_s, bus: "field", kind, text: `device ${address} is of a type; take it off the bus` };
  };
  const message = (of: ServerMessage) => ({ type: "message" as const, message: of, now: 0 });
  const begun = (change: Partial<Snapshot>) => reducer(firstState, message(snapshot(change)));
  const addresses = (state: State) => straysOf(state).map((device) => device.address);

  it("has a device without a slot once Berth says why, until it gets one", () => {
    let state = begun({ events: [found(a), found(b)], slots: [slot({ r_sn: null, state: "empty" })] });
    // Berth is still looking: nobody needs to do anything.
    expect(addresses(state)).toEqual([]);
    state = reducer(state, message({ type: "change", seq: 8, time_s: 3, events: [odd("foreign", b)] }));
    expect(straysOf(state)).toMatchObject([{ address: b, says: { kind: "foreign" } }]);
    expect(whyWords(straysOf(state)[0] as FoundDevice)).toBe("no slot takes its type");
    state = reducer(state, message({ type: "change", seq: 9, time_s: 4, events: [bound(b, "belt")] }));
    expect(addresses(state)).toEqual([]);
  });

  it("has one of which nothing else was heard, and one that an open question is about", () => {
    expect(addresses(begun({ events: [odd("fixed mismatch", b)] }))).toEqual([b]);
    const question = { at_s: 3, bus: "field", kind: "question", text: "which?", slots: ["belt"], devices: [a] };
    const state = begun({ events: [found(a)], questions: [question] });
    expect(addresses(state)).toEqual([a]);
    expect(inNeedOf(state)).toEqual([]);
    expect(inNeedOf(begun({ events: [odd("surplus", a)] }))).toHaveLength(1);
  });

  it("lets a device go from a slot that has another one, or none", () => {
    const there = { r_sn: "0x0001000100000001" };
    const events = [found(a), bound(a, "belt"), odd("surplus", a)];
    expect(addresses(begun({ events, slots: [slot(there)] }))).toEqual([]);
    expect(addresses(begun({ events, slots: [slot({ r_sn: "0x0001000100000009" })] }))).toEqual([a]);
    expect(addresses(begun({ events, slots: [slot({ r_sn: null, state: "empty" })] }))).toEqual([a]);
  });

  it("hides a device that a person took away, until Berth tells of it again", () => {
    let state = begun({ events: [odd("foreign", b)] });
    state = reducer(state, { type: "machine/hide", key: `field/${b}` });
    expect(addresses(state)).toEqual([]);
    state = reducer(state, message({ type: "change", seq: 8, time_s: 9, events: [odd("foreign", b, 9)] }));
    expect(addresses(state)).toEqual([b]);
  });

  it("knows of a simulated device whether it is still there", () => {
    const told = (state: State, plugged: boolean, powered = true) => {
      const devices = [{ device: "spare", bus: "field", plugged, powered, slot: null, lss_address: b }];
      const asked = reducer(state, { type: "sent", id: "r1", verb: "sim", values: {}, owner: PLANT_OWNER });
      const reply = { devices, cables: [] };
      return reducer(asked, message({ type: "reply", id: "r1", status: 0, reply, lines: [], error: "" }));
    };
    const state = begun({ events: [odd("foreign", b)], time_s: 5 });
    expect(addresses(told(state, true))).toEqual([b]);
    expect(addresses(told(state, false))).toEqual([]);
    expect(addresses(told(state, true, false))).toEqual([]);
    // Berth heard it after the plant was asked: it is there.
    const later = reducer(
      told(state, false),
      message({ type: "change", seq: 8, time_s: 6, events: [odd("foreign", b, 6)] }),
    );
    expect(addresses(later)).toEqual([b]);
  });

  it("says what a slot's `also` is for a device", () => {
    expect(alsoLine(b)).toBe("also = [{ vendor = 0x00000001, product = 0x00000010, revision = 0x00010001 }]");
  });

  it("hears the questions of a search", () => {
    let state = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
    state = reducer(state, { type: "batch", batch: batch(0, "7E5#4C00000000000000 1F940000#80010001 701#05") });
    expect(state.machine.question).toEqual({ bus: "field", text: "RAND request, phase 1, mask 0001h", n: 2 });
  });
});
