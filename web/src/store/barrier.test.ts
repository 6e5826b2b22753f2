import { describe, expect, it } from "vitest";
import type { Role, Snapshot } from "../protocol/messages";
import { barrier } from "./barrier";
import { firstState, reducer } from "./reducer";
import { snapshot } from "./samples";

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

  it("is nothing without a connection", () => {
    expect(barrier(firstState, "report")).toBe("Not connected.");
  });
});
