import { describe, expect, it } from "vitest";
import type { Verb } from "../../protocol/messages";
import { slot } from "../../store/samples";
import { bootStories, firstNetwork, groupsOf, missingOf, networkReducer } from "./reducer";

const verb = (name: string, ...required: string[]): Verb => ({
  name,
  help: "",
  changes: false,
  role: "view",
  parameters: required.map((entry) => ({ name: entry, help: "", required: true, form: "word", value: "" })),
});

describe("network access", () => {
  it("offers the verbs that no other pane has, in groups", () => {
    const groups = groupsOf([
      verb("scan"),
      verb("nmt"),
      verb("sdo read"),
      verb("lss find"),
      verb("sim plug"),
      verb("boot"),
    ]);
    expect(groups.map((group) => [group.title, group.verbs.map((entry) => entry.name)])).toEqual([
      ["Bus", ["scan", "nmt"]],
      ["LSS", ["lss find"]],
    ]);
  });
  it("knows what a form misses, and empties it for another verb", () => {
    let state = networkReducer(firstNetwork, { type: "network/verb", verb: "nmt" });
    state = networkReducer(state, { type: "network/value", name: "node", value: "5" });
    expect(missingOf(verb("nmt", "command", "node"), state.values)).toEqual(["command"]);
    expect(networkReducer(state, { type: "network/verb", verb: "scan" }).values).toEqual({});
  });
  it("tells each boot-up from its last beginning", () => {
    const line = (text: string) => ({ at_s: 1, bus: "field", kind: "state", slot: "belt", text });
    const events = ["binding: discovered", "operational", "absent", "present", "operational"].map(line);
    const [story] = bootStories([slot()], events);
    expect(story?.lines.map((entry) => entry.text)).toEqual(["absent", "present", "operational"]);
  });
});
