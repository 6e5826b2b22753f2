import { describe, expect, it } from "vitest";
import type { Role, Snapshot } from "../protocol/messages";
import { barrier } from "./barrier";
import { firstState, reducer } from "./reducer";
import { slot, snapshot } from "./samples";

const verbs: Snapshot["verbs"] = [
  { name: "report", help: "", changes: false, role: "view", parameters: [] },
  { name: "nmt", help: "", changes: true, role: "operate", parameters: [] },
  { name: "sdo write", help: "", changes: true, role: "configure", parameters: [] },
];
const as = (role: Role, change: Partial<Snapshot> = {}) =>
  reducer(firstState, { type: "message", message: snapshot({ role, verbs, ...change }), now: 0 });
const asked = (role: Role, change?: Partial<Snapshot>) =>
  ["report", "nmt", "sim", "sdo write"].filter((verb) => barrier(as(role, change), verb) === null);

describe("what a page may ask for", () => {
  it("goes by its role", () => {
    expect(asked("view")).toEqual(["report"]);
    expect(asked("operate")).toEqual(["report", "nmt", "sim"]);
    expect(asked("configure")).toEqual(["report", "nmt", "sim", "sdo write"]);
    expect(barrier(as("view"), "sdo write")).toBe("This needs the role configure. Yours is view.");
  });

  it("only reads on real buses until they are unlocked", () => {
    const real = (unlocked_until_s: number | null) => ({ lock: { real: true, unlocked_until_s } });
    expect(asked("configure", real(null))).toEqual(["report"]);
    expect(barrier(as("operate", real(null)), "nmt")).toContain("Unlock");
    expect(barrier(as("view", real(null)), "nmt")).toContain("role");
    expect(asked("operate", real(60))).toEqual(["report", "nmt", "sim"]);
  });

  it("goes by an argument that makes a verb change something", () => {
    const active = {
      name: "active",
      help: "",
      required: false,
      form: "flag" as const,
      value: "",
      changes: true as const,
    };
    const doctor = { name: "doctor", help: "", changes: false, role: "view" as const, parameters: [active] };
    const state = as("view", { verbs: [doctor] });
    expect(barrier(state, "doctor")).toBeNull();
    expect(barrier(state, "doctor", { active: "1" })).toBe("This needs the role operate. Yours is view.");
    expect(barrier(as("operate", { verbs: [doctor] }), "doctor", { active: "1" })).toBeNull();
  });

  it("goes by the bus: beneath a gateway Berth may have no port", () => {
    const bus = { name: "field", bit_rate: 250000, port: "sim", role: "master", master_id: 127, beneath: null };
    const left = { ...bus, name: "left", port: "gateway", master_id: 1, beneath: { bus: "field", slot: "gate" } };
    const wing = { ...left, name: "wing", port: "socketcan:can1" };
    const names = ["replace", "upload", "history", "locate", "lss find", "sdo connect", "doctor", "nmt", "sdo read"];
    const state = as("configure", {
      verbs: names.map((name) => ({ name, help: "", changes: false, role: "view" as const, parameters: [] })),
      buses: [bus, left, wing],
      slots: [slot({ id: 3, name: "gate" }), slot({ bus: "left", id: 5, name: "motor" }), slot({ bus: "wing", id: 5 })],
    });
    const may = (values: Record<string, string>) => names.filter((name) => barrier(state, name, values) === null);
    expect(may({ bus: "field" })).toEqual(names);
    expect(may({ bus: "wing" }), "a port of its own").toEqual(names);
    expect(may({})).toEqual(names);
    expect(may({ bus: "left" })).toEqual(["nmt", "sdo read"]);
    expect(may({ conformance: "motor" }), "by the slot's name alone").toEqual(["nmt", "sdo read"]);
    expect(barrier(state, "replace", { slot: "motor" })).toBe(
      "Beneath gateway 3 of bus field: Berth has no port there. Put the new device in: the gateway's own NMT master gives it the node-ID.",
    );
  });

  it("is nothing without a connection", () => {
    expect(barrier(firstState, "report")).toBe("Not connected.");
  });
});
