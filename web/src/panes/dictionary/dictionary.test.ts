import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../../store/reducer";
import type { State } from "../../store/state";
import { idsNamed, limitsOf, objectNamed, rowsOf, searched, wrongFor } from "./reducer";

const object = (index: string, sub: number, value: unknown, name = "") => ({
  index,
  sub,
  value,
  name,
  bytes: "",
  type: "UNSIGNED16",
});

function ask(state: State, id: string, verb: string, reply: unknown): State {
  const sent = reducer(state, { type: "sent", id, verb, values: {}, owner: "dictionary:field/10" });
  return reducer(sent, {
    type: "message",
    now: 0,
    message: { type: "reply", id, status: 0, reply, lines: [], error: "" },
  });
}

describe("the dictionary", () => {
  it("takes an object and node-IDs as people write them", () => {
    const same = ["1018", "1018h", "0x1018", "1018h:00", "1018:0"].map(objectNamed);
    expect(new Set(same)).toEqual(new Set(["1018h:00"]));
    expect(objectNamed("1a7f:2")).toBe("1A7Fh:02");
    expect(objectNamed("heartbeat")).toBeNull();
    expect(idsNamed("1-3, 12", [1, 2, 4, 12, 13])).toEqual([1, 2, 12]);
    expect(idsNamed("1-99999", [5, 127])).toBeNull();
    expect(idsNamed("all", [5])).toBeNull();
  });
  it("knows what is not as configured, or by default, after a write, too", () => {
    const dumped = { ...object("0x1017", 0, 500), default: 0, configured: 600, differs: true };
    const plain = { ...object("0x1018", 1, 1), default: 0 }; // no setting
    let state = ask(firstState, "r1", "sdo dump", { objects: [dumped, plain] });
    const row = () => state.dictionary.objects["field/10"]?.[0];
    expect(row()).toMatchObject({ usual: "0", configured: "600", differs: true });
    expect(state.dictionary.objects["field/10"]?.[1]?.differs).toBe(false);
    state = ask(state, "r2", "sdo write", object("0x1017", 0, 600));
    expect(row()).toMatchObject({ value: "600", configured: "600", differs: false });
    state = ask(state, "r3", "sdo write", object("0x1017", 0, 700));
    expect(row()?.differs).toBe(true);
    state = ask(state, "r4", "sdo read", object("0x1018", 1, 9));
    expect(state.dictionary.objects["field/10"]?.[1]?.differs).toBe(false);
    state = reducer(state, { type: "dictionary/other", only: true });
    expect(state.dictionary.otherOnly).toBe(true);
  });
  it("says what an object is and what its value means", () => {
    const told = { ...object("0x6041", 0, 0x27), note: { text: "State of the drive" }, meaning: "operation enabled" };
    const [row] = rowsOf({ objects: [told] });
    expect(row).toMatchObject({ note: { text: "State of the drive", scale: 1 }, meaning: "operation enabled" });
    expect(rowsOf({ objects: [object("0x6041", 0, 1)] })[0]).toMatchObject({ note: null, meaning: "" });
    expect(searched(rowsOf({ objects: [told] }), "enabled")).toHaveLength(1);
  });
  it("takes what a writing to several devices answers to each of them", () => {
    const values = { bus: "field", node: "11" };
    let state = reducer(firstState, { type: "sent", id: "r1", verb: "sdo write", values, owner: "series 2 field/11" });
    const reply = object("0x1017", 0, 750);
    const message = { type: "reply" as const, id: "r1", status: 0, reply, lines: [], error: "" };
    state = reducer(state, { type: "message", now: 0, message });
    expect(state.dictionary.objects["field/11"]?.[0]).toMatchObject({ key: "1017h:00", value: "750" });
  });
  it("is what `sdo dump` read, and `sdo read` changes", () => {
    let state = ask(firstState, "r1", "sdo dump", {
      objects: [object("0x1017", 0, 500, "Producer heartbeat time"), object("0x1018", 4, 1)],
    });
    state = ask(state, "r2", "sdo write", object("0x1017", 0, 600));
    const rows = state.dictionary.objects["field/10"] ?? [];
    expect(rows.map((row) => [row.key, row.name, row.value])).toEqual([
      ["1017h:00", "Producer heartbeat time", "600"],
      ["1018h:04", "", "1"],
    ]);
    expect(state.dictionary.before["field/10"]).toEqual({ "1017h:00": "500" });
  });

  it("shows what another page wrote, in the devices that it shows", () => {
    const shown = ask(firstState, "r1", "sdo dump", { objects: [object("0x1017", 0, 500, "Producer heartbeat time")] });
    const data = { ...shown.data, seq: 4 };
    const written = [
      { bus: "field", node: 10, ...object("0x1017", 0, 750) },
      { bus: "field", node: 11, ...object("0x1017", 0, 900) },
      { bus: "field", node: 10, objects: [{ index: "0x1018", sub: 4, abort_code: "0x06010002", text: "read only" }] },
    ];
    const message = { type: "change" as const, seq: 5, time_s: 1, written };
    const state = reducer({ ...shown, data }, { type: "message", now: 0, message });
    expect(state.dictionary.objects["field/10"]?.[0]).toMatchObject({ name: "Producer heartbeat time", value: "750" });
    expect(state.dictionary.before["field/10"]).toEqual({ "1017h:00": "500" });
    expect(state.dictionary.objects["field/10"]).toHaveLength(1);
    expect(state.dictionary.objects["field/11"]).toBeUndefined();
  });

  it("says why an object could not be read", () => {
    const [row] = rowsOf({
      objects: [{ index: "0x1003", sub: 1, name: "n", abort_code: "0x08000024", text: "no data available" }],
    });
    expect(row).toMatchObject({ key: "1003h:01", value: "", abort: "0x08000024 no data available" });
  });

  it("is searched by all words in 5,000 objects", () => {
    const rows = rowsOf({
      objects: Array.from({ length: 5000 }, (_, i) => object(`0x${(0x2000 + i).toString(16)}`, 0, i, `Speed ${i}`)),
    });
    expect(searched(rows, "speed 2FA")).toHaveLength(18); // 22FAh, 32FAh, 2FA0h to 2FAFh
  });

  it("knows what an integer type takes", () => {
    expect(limitsOf("UNSIGNED16")).toEqual([0n, 65535n]);
    expect(limitsOf("INTEGER24")).toEqual([-8388608n, 8388607n]);
    expect(limitsOf("REAL32")).toBeNull();
    expect(wrongFor("UNSIGNED8", "256")).toBe("UNSIGNED8 takes 0 to 255.");
    expect(wrongFor("INTEGER8", "-0x81")).not.toBe("");
    const good: [string, string][] = [
      ["UNSIGNED8", "0xFF"],
      ["INTEGER8", "-128"],
      ["UNSIGNED64", "18446744073709551615"],
    ];
    for (const [type, text] of good) expect(wrongFor(type, text)).toBe("");
    // What is no plain number the server judges: "500 ms", "$NODEID+0x180".
    expect(wrongFor("UNSIGNED8", "no number")).toBe("");
  });

  it("takes no nonsense for objects", () => {
    expect(rowsOf(null)).toEqual([]);
    expect(rowsOf({ objects: [null, 3] })).toEqual([]);
  });
});
