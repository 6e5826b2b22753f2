import { describe, expect, it } from "vitest";
import { packed, unpacked } from "../../parts/zlib";
import { commandLine } from "../../protocol/command";
import type { Verb } from "../../protocol/messages";
import { firstState, reducer } from "../../store/reducer";
import { comparisonOf, savedOf } from "./backup";

const verb: Verb = {
  name: "backup restore",
  help: "",
  changes: true,
  role: "configure",
  parameters: [
    { name: "bus", help: "", required: false, form: "common", value: "" },
    { name: "node", help: "", required: true, form: "word", value: "" },
    { name: "dcf", help: "", required: false, form: "own", value: "" },
  ],
};

describe("backup and restore", () => {
  it("packs what the server unpacks, and back", async () => {
    const text = new TextEncoder().encode("[1017]\r\nParameterValue=500\r\n".repeat(500));
    const digits = await packed(text);
    expect(digits).toMatch(/^78[0-9a-f]+$/); // a zlib stream (RFC 1950)
    expect(digits.length).toBeLessThan(text.length / 10);
    expect(await unpacked(digits)).toEqual(text);
    await expect(unpacked("nonsense")).rejects.toThrow();
  });
  it("is a command with the file's name", () => {
    const shown = { bus: "field", node: "belt", file: "belt 1.dcf" };
    expect(commandLine("backup restore", shown, [verb], "")).toBe("berth backup restore belt 'belt 1.dcf' --bus field");
  });
  it("names the devices as the command line does", () => {
    const save: Verb = {
      ...verb,
      name: "backup save",
      parameters: [
        { name: "bus", help: "", required: false, form: "common", value: "" },
        { name: "node", help: "", required: false, form: "own", value: "" },
        { name: "all", help: "", required: false, form: "flag", value: "" },
      ],
    };
    const line = (values: Record<string, string>) => commandLine("backup save", values, [save], "");
    expect(line({ bus: "field", node: "main drive" })).toBe("berth backup save 'main drive' --bus field");
    expect(line({ all: "1" })).toBe("berth backup save --all");
  });
  it("lists what each device gave, and why one gave nothing", () => {
    const devices = savedOf({
      backups: [
        { bus: "field", node: 10, slot: "belt", read: 40, refused: 1, dcf: "78" },
        { bus: "field", node: 11, problem: "no answer" },
      ],
    });
    expect(devices.map((device) => [device.name, device.read, device.dcf, device.problem])).toEqual([
      ["belt", 40, "78", ""],
      ["node 11", 0, "", "no answer"],
    ]);
    expect(savedOf(null)).toEqual([]);
  });
  it("shows what differs, and what was refused", () => {
    const found = comparisonOf({
      result: "partly restored",
      compared: 7,
      written: 2,
      differences: [{ object: "0x1017:00", has: "500", wants: "600" }, { object: "0x1a00:01" }],
      refused: [{ object: "0x6200:01", why: "the device refused it" }],
    });
    expect(found?.differences.map((entry) => [entry.object, entry.has])).toEqual([
      ["1017h:00", "500"],
      ["1A00h:01", "cannot be read"],
    ]);
    expect(found?.refused[0]?.object).toBe("6200h:01");
    expect(comparisonOf({ error: {} })).toBeNull();
  });
  it("keeps the DCF that was chosen over another service", () => {
    let state = reducer(firstState, { type: "network/dcf", chosen: { name: "a.dcf", dcf: "78" }, problem: "" });
    state = reducer(state, { type: "network/verb", verb: "scan" });
    expect(state.network.chosen?.name).toBe("a.dcf");
    state = reducer(state, { type: "network/dcf", chosen: null, problem: "too long" });
    expect(state.network).toMatchObject({ chosen: null, dcfProblem: "too long" });
  });
});
