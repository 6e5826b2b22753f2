import { describe, expect, it } from "vitest";
import { commandLine } from "../../protocol/command";
import { firstState, reducer } from "../../store/reducer";
import { slot, snapshot } from "../../store/samples";
import type { State } from "../../store/state";
import { cutAct, damageAct, deviceActs, mendAct, plugAct } from "./acts";
import { behind, cutBefore, hangs, nodesOf, wordOf } from "./cable";
import { framesOf, PLANT_OWNER, type PlantDevice } from "./reducer";

const device = (change: Partial<PlantDevice> = {}): PlantDevice => ({
  name: "s2",
  bus: "field",
  plugged: true,
  powered: true,
  deaf: false,
  late: 0,
  slot: "s2",
  address: "",
  ...change,
});
const lines = (of: PlantDevice | null) => deviceActs("s2", of).map((act) => commandLine(act.verb, act.values, [], ""));

describe("acts on a simulated device", () => {
  it("are commands of `berth sim`", () => {
    expect(lines(null)).toEqual([
      "berth sim unplug s2",
      "berth sim plug s2",
      "berth sim power off s2",
      "berth sim power on s2",
      "berth sim reset s2",
      "berth sim fault deaf s2 'duration=5 s'",
      "berth sim fault deaf s2",
      "berth sim fault slow s2 'latency=50 ms'",
      "berth sim fault recover s2",
    ]);
    const line = ({ verb, values }: ReturnType<typeof mendAct>) => commandLine(verb, values, [], "");
    expect(line(cutAct("", "field", ["s2", "s3"]))).toBe("berth sim fault cut-cable nodes=s2,s3 --bus field");
    expect(line(mendAct("field"))).toBe("berth sim fault join --bus field");
    expect(line(plugAct("s2", false))).toBe("berth sim plug s2");
  });
  it("are those that it can take", () => {
    expect(lines(device())).not.toContain("berth sim plug s2");
    expect(lines(device())).not.toContain("berth sim fault recover s2");
    expect(lines(device({ late: 0.05 }))).toContain("berth sim fault recover s2");
    expect(lines(device({ powered: false }))).toEqual(["berth sim unplug s2", "berth sim power on s2"]);
    expect(lines(device({ powered: false, plugged: false }))).toEqual(["berth sim plug s2"]);
  });
  it("damage frames of a bus, or of one device", () => {
    expect(damageAct("field", "1")).toMatchObject({
      label: "Damage the next frame on field",
      values: { bus: "field" },
    });
    expect(damageAct("field", "3", "s2")).toMatchObject({
      label: "Damage the next 3 frames it sends",
      values: { bus: "field", frames: "3", from: "s2" },
    });
    expect(["1", "10000", "0", "10001", "1.5", "", "x"].map(framesOf)).toEqual([
      "1",
      "10000",
      null,
      null,
      null,
      null,
      null,
    ]);
  });
});

describe("the cable", () => {
  const slots = ["a", "b", "c", "d"].map((name, i) => slot({ name, id: i + 1 }));
  const devices = ["c", "a", "b", "d"].map((name) => device({ name: `dev ${name}`, slot: name }));
  const spare = device({ name: "spare", slot: "" });
  const nodes = (pieces: string[][]) => nodesOf({ bus: "field", pieces }, [...devices, spare], slots);
  const words = (names: string) => names.split("").map((name) => (name === "m" ? "master" : `dev ${name}`));
  const whole = nodes([[...words("mabcd"), "spare"]]);

  it("has Berth at its beginning, then the slots in their order, then the rest", () => {
    expect(whole.map((node) => node.word)).toEqual(["master", "dev a", "dev b", "dev c", "dev d", "spare"]);
    expect(nodesOf(undefined, devices, slots)).toEqual([]);
    const out = nodesOf(
      { bus: "field", pieces: [words("mabd")] },
      [device({ name: "dev c", slot: "c", plugged: false })],
      slots,
    );
    expect(out.map((node) => node.word)).toEqual(["master"]);
  });
  it("loses by a cut what is behind it, up to the next cut", () => {
    expect(behind(whole, 3)).toEqual(["dev c", "dev d", "spare"]);
    const half = nodes([words("mab"), [...words("cd"), "spare"]]);
    expect(behind(half, 2)).toEqual(["dev b"]);
    expect(behind(half, 4)).toEqual(["dev d", "spare"]);
    expect(behind(half, 3)).toEqual([]);
    expect([1, 2, 3, 4, 5].map((i) => cutBefore(half, i))).toEqual([false, false, true, false, false]);
  });
  it("goes on past a device whose own wire is cut", () => {
    const one = nodes([[...words("macd"), "spare"], words("b")]);
    expect(one.map((_, i) => hangs(one, i))).toEqual([false, false, true, false, false, false]);
    expect([1, 2, 3, 4, 5].some((i) => cutBefore(one, i))).toBe(false);
    expect(behind(one, 1)).toEqual(["dev a", "dev c", "dev d", "spare"]);
  });
  it("names a device so that no slot is meant", () => {
    expect(wordOf(device({ name: "A", slot: "b" }), slots)).toBe("device:A");
    expect(wordOf(device({ name: "a", slot: "a" }), slots)).toBe("a");
  });
});

describe("the plant's truth", () => {
  const answered = (state: State, owner: string, status: number, reply: unknown): State => {
    const sent = reducer(state, { type: "sent", id: "r1", verb: "sim", values: { action: "devices" }, owner });
    const message = { type: "reply" as const, id: "r1", status, reply, lines: [], error: "" };
    return reducer(sent, { type: "message", message, now: 0 });
  };
  const first = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
  const reply = {
    devices: [{ device: "s2", bus: "field", plugged: true, powered: true, deaf: true, late_s: 0.05, slot: null }],
    cables: [{ bus: "field", pieces: [["master", "s2"]] }],
  };
  it("is read from the answer, and not from what is none", () => {
    const told = answered(first, PLANT_OWNER, 0, reply).world;
    expect(told.devices).toEqual([device({ deaf: true, late: 0.05, slot: "" })]);
    expect(told.cables).toEqual(reply.cables);
    expect(answered(first, PLANT_OWNER, 1, reply).world.devices).toEqual([]);
    expect(answered(first, "world", 0, reply).world.devices).toEqual([]);
    expect(answered(first, PLANT_OWNER, 0, { devices: "no", cables: [null, 3] }).world).toMatchObject({
      devices: [],
      cables: [],
    });
  });
  it("leaves a device in its place when its slot is emptied, until another one sits there", () => {
    const told = (slots: (string | null)[]) => ({
      devices: slots.map((slot, i) => ({ device: `d${i}`, bus: "field", plugged: true, powered: true, slot })),
      cables: [],
    });
    const places = (state: State) => state.world.devices.map((entry) => entry.slot);
    let state = answered(first, PLANT_OWNER, 0, told(["a", "b", null]));
    state = answered(state, PLANT_OWNER, 0, told([null, "b", null]));
    expect(places(state)).toEqual(["a", "b", ""]);
    state = answered(state, PLANT_OWNER, 0, told([null, "b", "a"]));
    expect(places(state)).toEqual(["", "b", "a"]);
  });
  it("does not push out what a person asked for", () => {
    let state = answered(first, "world", 0, reply);
    for (let i = 0; i < 300; i++) state = answered(state, PLANT_OWNER, 0, reply);
    expect(state.requests.some((sent) => sent.owner === "world")).toBe(true);
    expect(state.requests.length).toBeLessThan(5);
  });
  it("a selected slot lets go of a device without one", () => {
    const chosen = reducer(first, { type: "world", change: { device: "spare" } });
    expect(reducer(chosen, { type: "view", change: { slot: "" } }).world.device).toBe("spare");
    expect(reducer(chosen, { type: "view", change: { slot: "field/10" } }).world.device).toBe("");
  });
});
