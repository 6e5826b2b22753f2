import { describe, expect, it } from "vitest";
import { slot } from "../../store/samples";
import { dcfOf, forgettable, inNeed, needOf, questionOf, replacementSteps, savesFirst } from "./reducer";

const event = (kind: string, text = "", more = {}) => ({ at_s: 5, bus: "field", slot: "belt", kind, text, ...more });
const address = "00000001-00000010-00010001-00000001";

describe("slots", () => {
  it("in need say what it is and what to do", () => {
    expect(needOf(slot())).toBeNull();
    expect(needOf(slot({ state: "configuring" }))).toBeNull();
    for (const state of ["absent", "empty", "question", "failed", "duplicate", "wrong type", "power cycle needed"]) {
      const need = needOf(slot({ state }));
      expect(need?.what).toMatch(/\.$/);
      expect(need?.todo).toMatch(/\.$/);
    }
    expect(needOf(slot({ state: "failed", boot: "J" }))?.todo).toMatch(/configuration/);
    expect(inNeed([slot(), slot({ state: "absent" })])).toHaveLength(1);
  });

  it("find the open question that is about them", () => {
    const other = { ...event("question", "other"), bus: "yard", slots: ["belt"] };
    const open = [other, event("question", "which?", { slots: ["barrier", "belt"] })];
    expect(questionOf(slot(), open)?.text).toBe("which?");
    expect(questionOf(slot({ name: "gate" }), open)).toBeNull();
  });

  it("offer the first saving until the device is operational", () => {
    const offer = { ...event("question", "shall it save?", { slots: ["belt"], offers_save: true as const }), slot: "" };
    const pre = slot({ state: "failed" });
    expect(savesFirst(pre, [offer])).toBe(true);
    expect(savesFirst(slot(), [offer])).toBe(false);
    expect(savesFirst(pre, [offer, event("state", "operational")])).toBe(false);
    expect(savesFirst(pre, [event("question", "which?", { slots: ["belt"] })])).toBe(false);
    expect(savesFirst({ ...pre, name: "gate" }, [offer])).toBe(false);
  });

  it("tell which devices can be forgotten", () => {
    const events = [event("unfinished", `${address} was to give its node-ID up`)];
    expect(forgettable(slot(), events)).toEqual([address]);
    expect(forgettable(slot(), [...events, event("forgotten", address)])).toEqual([]);
  });

  it("are followed through a replacement", () => {
    const absent = slot({ state: "absent" });
    const at = (events: ReturnType<typeof event>[], now = absent) =>
      replacementSteps(now, events, 4).map((step) => step.at);
    expect(at([])).toEqual(["now", "later", "later", "later"]);
    expect(at([event("bound")])).toEqual(["done", "done", "now", "later"]);
    expect(at([event("bound"), event("configured")])).toEqual(["done", "done", "done", "now"]);
    expect(at([event("bound")], slot())).toEqual(["done", "done", "done", "done"]);
    expect(at([{ ...event("bound"), at_s: 3 }], slot())).toEqual(["now", "later", "later", "later"]);
  });
});

describe("a DCF in an answer", () => {
  it("is its bytes, or nothing", () => {
    expect(dcfOf({ dcf: "5B 46 69 E9" })).toEqual(Uint8Array.of(0x5b, 0x46, 0x69, 0xe9));
    for (const reply of [null, 3, {}, { dcf: 5 }, { dcf: "" }, { dcf: "5B 4" }, { dcf: "5B zz" }]) {
      expect(dcfOf(reply)).toBeNull();
    }
  });
});
