import { describe, expect, it } from "vitest";
import { commandLine } from "../../protocol/command";
import type { Verb } from "../../protocol/messages";
import { firstState, reducer } from "../../store/reducer";
import { checksOf, examines, findingsOf, firstDoctor, requestOf, summaryOf } from "./reducer";

const parameter = (name: string, form: "flag" | "own" | "option" | "common", spelled = `--${name}`) => ({
  name,
  form,
  help: "",
  required: false,
  value: "",
  spelled,
});
const verb: Verb = {
  name: "doctor",
  help: "",
  changes: false,
  role: "view",
  parameters: [
    parameter("bus", "common"),
    parameter("for", "own"),
    parameter("active", "flag"),
    parameter("intrusive", "flag"),
    parameter("conformance", "option"),
  ],
};

describe("the doctor", () => {
  it("asks what was chosen, and that is a command", () => {
    const chosen = (change: Partial<typeof firstDoctor>) =>
      requestOf(reducer(firstState, { type: "doctor", change }).doctor, "field", "belt");
    const line = (change: Partial<typeof firstDoctor>) => commandLine("doctor", chosen(change) ?? {}, [verb], "");
    expect(line({})).toBe("berth doctor");
    expect(line({ seconds: "20", questions: "lss" })).toBe("berth doctor --for '20 s' --active");
    expect(line({ questions: "sdo" })).toBe("berth doctor --intrusive");
    expect(line({ questions: "conformance" })).toBe("berth doctor --bus field --conformance belt");
  });
  it("asks nothing that the server would refuse", () => {
    for (const seconds of ["0", "601", "1.5", "soon"]) {
      expect(requestOf({ ...firstDoctor, seconds }, "field", "belt")).toBeNull();
    }
    expect(requestOf({ ...firstDoctor, questions: "conformance" }, "", "")).toBeNull();
    expect(examines([verb])).toBe(true);
    expect(examines([{ ...verb, parameters: [] }])).toBe(false);
  });
  it("lists the surest findings first, each with the frames that tell it", () => {
    const finding = (kind: string, certainty: string, more: object = {}) => ({
      kind,
      certainty,
      bus: "field",
      node: 12,
      what: kind,
      evidence: ["heard"],
      do: "look",
      ...more,
    });
    const findings = findingsOf({
      findings: [
        finding("duplicate-node-id", "possible"),
        finding("identifier-collision", "likely", { cob_id: "0x181", node: null }),
        finding("error-passive", "certain"),
        finding("silent-bus", "likely", { node: null }),
      ],
    });
    expect(findings.map((entry) => [entry.kind, entry.filter])).toEqual([
      ["error-passive", "08C#"],
      ["identifier-collision", "181#"],
      ["silent-bus", ""],
      ["duplicate-node-id", "70C#"],
    ]);
    expect(findingsOf("none")).toEqual([]);
  });
  it("lists failed checks first, each with its object", () => {
    const check = (verdict: string, more: object = {}) => ({ paragraph: "7.4", what: "w", verdict, ...more });
    const checks = checksOf({
      checks: [check("passed"), check("skipped"), check("failed", { index: "0x1a00", sub: 10, told: "it was taken" })],
    });
    expect(checks.map((entry) => entry.verdict)).toEqual(["failed", "skipped", "passed"]);
    expect(checks[0]).toMatchObject({ object: "1A00h:0A", told: "it was taken" });
    expect(checks[1]?.object).toBe("");
  });
  it("says how long it listened, and to what not", () => {
    const buses = [{ bus: "field", frames: 812 }];
    expect(summaryOf({ listened_s: 5, buses, asked: "nothing", without_port: [] })).toBe(
      "5.0 s, 812 frames on 1 bus; asked: nothing",
    );
    expect(summaryOf({ listened_s: 5, buses, asked: "lss", without_port: ["drives"] })).toContain("drives");
    expect(summaryOf({ checks: [], passed: 3, failed: 1, skipped: 0 })).toBe("3 checks passed, 1 failed, 0 skipped");
    expect(summaryOf({ error: {} })).toBe("");
  });
});
