import { describe, expect, it } from "vitest";
import { commandLine } from "../protocol/command";
import { firstState, reducer } from "../store/reducer";
import { slot, snapshot } from "../store/samples";
import type { State } from "../store/state";
import { entriesOf, found, type Entry } from "./entries";

const address = "00000001-00000003-00000000-00000031";
const verb = (name: string, help = "") => ({ name, help, changes: true, role: "operate" as const, parameters: [] });
const events = [
  { at_s: 1, bus: "field", kind: "foreign", text: `device ${address} is of a type; take it off the bus` },
];
const verbs = [
  verb("program download", "loads a program"),
  verb("backup save", "values of devices"),
  verb("world pause"),
  verb("world damage"),
  verb("sdo read"),
];
const panes = [
  { name: "plots" as const, title: "Plots", about: "", words: "export chart" },
  { name: "world" as const, title: "World", about: "", words: "unplug" },
];
const begun = (change = {}): State => {
  const message = snapshot({ events, verbs, ...change });
  let state = reducer(firstState, { type: "message", message, now: 0 });
  const values = { bus: "field", node: "belt" };
  state = reducer(state, { type: "sent", id: "r1", verb: "sdo dump", values, owner: "dictionary:field/10" });
  const reply = { objects: [{ index: "0x1017", sub: 0, name: "Producer heartbeat time", value: 500 }] };
  const answer = { type: "reply" as const, id: "r1", status: 0, reply, lines: [], error: "" };
  return reducer(state, { type: "message", message: answer, now: 0 });
};
const search = (text: string, state = begun()): Entry[] => found(entriesOf(state, panes), text, state);
const titles = (text: string, state?: State) => search(text, state).map((entry) => entry.title);

describe("Find or do", () => {
  it("finds acts of the simulated world, each as its request", () => {
    const asks = (text: string) => search(text)[0]?.asks?.map(({ verb, values }) => commandLine(verb, values, [], ""));
    expect(asks("unplug barrier")).toEqual(["berth sim unplug barrier"]);
    expect(asks("slow belt")).toEqual(["berth sim fault slow belt 'latency=50 ms'"]);
    expect(asks("deaf belt")).toEqual(["berth sim fault deaf belt 'duration=5 s'"]);
    expect(asks("pause world")).toEqual(["berth world pause"]);
    expect(asks("damage")).toEqual(["berth world damage --bus field"]);
    expect(asks("damage belt")).toEqual(["berth world damage --bus field --from belt"]);
    expect(search("unplug barrier")[0]?.view).toMatchObject({ pane: "world", slot: "field/11" });
  });

  it("has none of them of a real machine, and does nothing that this page may not", () => {
    const real = { machine: { name: "m", simulated: false, file: "" }, verbs: [] };
    expect(titles("unplug barrier", begun(real))).toEqual([]);
    const viewer = search("unplug barrier", begun({ role: "view" }))[0];
    expect(viewer?.asks).toBeUndefined();
    expect(viewer?.view).toMatchObject({ pane: "world" });
    expect(viewer?.hint).toContain("needs the role operate");
  });

  it("finds devices without a slot, and objects that were read, by index and name", () => {
    expect(search("31h")[0]?.view).toEqual({ pane: "machine", device: `field/${address}` });
    const view = { pane: "dictionary", slot: "field/10", object: "1017h:00" };
    expect(search("heartbeat")[0]).toMatchObject({ title: "1017h:00 Producer heartbeat time", view });
    expect(search("1017h")[0]?.view).toEqual(view);
  });

  it("reads an object that was not read, of the selected slot", () => {
    expect(titles("1018:4")).toEqual([]);
    const state = reducer(begun(), { type: "view", change: { slot: "field/10" } });
    const entry = search("1018:4", state)[0];
    expect(entry?.title).toBe("Read 1018h:04 of belt");
    expect(entry?.asks?.[0]?.values).toEqual({ bus: "field", node: "belt", object: "1018h:04" });
    // One that was read is shown, not asked for again.
    expect(titles("1017", state)).toEqual(["1017h:00 Producer heartbeat time"]);
  });

  it("finds panes and services by other words", () => {
    expect(titles("firmware")).toEqual(["program download"]);
    expect(titles("backup")).toContain("Backup and restore");
    expect(titles("export")[0]).toBe("Plots");
    expect(titles("help")[0]).toBe("Help");
    expect(titles("link")).toContain("Copy the link to this view");
    expect(titles("no such thing")).toEqual([]);
  });

  it("puts what is called so before what only has the word", () => {
    const slots = [slot({ name: "pause 2" }), slot({ id: 11, name: "pause" })];
    expect(titles("pause", begun({ slots })).slice(0, 2)).toEqual(["pause", "pause 2"]);
    expect(titles("barrier")[0]).toBe("barrier");
    expect(titles("")[0]).toBe("Plots");
  });
});
