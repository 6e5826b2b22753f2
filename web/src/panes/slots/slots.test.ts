import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../../store/reducer";
import { slot, snapshot } from "../../store/samples";
import type { Sent } from "../../store/state";
import { overtaken } from "../../store/overtaken";
import {
  bootWords,
  dcfOf,
  emcyWords,
  forgettable,
  inNeed,
  isReplaced,
  needOf,
  questionOf,
  replacementSteps,
  savesFirst,
} from "./reducer";

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
    expect(needOf(slot({ state: "empty", r_sn: null }))?.todo).toBe("Plug in a device of the slot's type, 1h / 10h.");
    expect(needOf(slot({ state: "empty", type: null }))?.todo).toBe("Plug in a device of the slot's type.");
    expect(inNeed([slot(), slot({ state: "absent" })])).toHaveLength(1);
  });

  it("show the last EMCY, and how often it came", () => {
    const emcy = { at_s: 1, code: "0x2310", text: "output current too high (overload)", register: "0x03", count: 1 };
    expect(emcyWords(undefined)).toBe("");
    expect(emcyWords(emcy)).toBe("2310h");
    expect(emcyWords({ ...emcy, count: 3 })).toBe("2310h ×3");
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

  it("say of a boot-up what is so of the device that they have", () => {
    expect(bootWords(slot())).toBe("");
    expect(bootWords(slot({ state: "absent", boot: "B" }))).toBe("B: It does not answer. Switch it on, or replace it.");
    expect(bootWords(slot({ state: "empty", boot: "B" }))).toBe("No device: plug one in of the slot's type, 1h / 10h.");
  });

  it("are not followed when Berth has refused the replacement", () => {
    const followed = (status: number, owner = "slots:field/10", verb = "replace") => {
      let state = reducer(firstState, { type: "message", message: snapshot(), now: 0 });
      state = reducer(state, { type: "sent", id: "r1", verb, values: {}, owner });
      state = reducer(state, { type: "slots/replacing", replacing: { slot: "field/10", atS: 2 } });
      const message = { type: "reply" as const, id: "r1", status, reply: null, lines: [], error: "" };
      return reducer(state, { type: "message", message, now: 0 }).slots.replacing !== null;
    };
    expect(followed(2)).toBe(false);
    expect(followed(1), "no device yet").toBe(true);
    expect(followed(0)).toBe(true);
    expect(followed(2, "slots:field/11"), "another slot's").toBe(true);
    expect(followed(2, "slots:field/10", "locate"), "another verb's").toBe(true);
  });

  it("are no longer followed when the spare ran and is gone again", () => {
    const over = (events: ReturnType<typeof event>[], state = "absent") => isReplaced(slot({ state }), events, 4);
    expect(over([event("bound")])).toBe(false);
    expect(over([event("state", "operational"), event("bound")]), "of the old device").toBe(false);
    expect(over([event("bound"), event("state", "operational")])).toBe(true);
    expect(over([event("bound"), event("state", "operational")], "operational")).toBe(false);
    expect(isReplaced(slot({ state: "absent" }), [event("bound"), event("state", "operational")], 6)).toBe(false);
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

describe("the answer of an act", () => {
  const sent = (verb: string, values: Record<string, string>, status = 1): Sent => ({
    id: "r1",
    verb,
    values,
    owner: "slots:field/10",
    done: true,
    status,
    answeredS: 13,
    reply: null,
    lines: [],
    error: "",
  });
  const later = slot({ since_s: 25.6 });
  const replace = sent("replace", { bus: "field", slot: "belt" });
  const gate = slot({ name: "gate", id: 11 });

  it("is overtaken when its slot got there after it", () => {
    expect(overtaken(replace, [later, gate])).toEqual({ name: "belt", state: "operational", sinceS: 25.6 });
    expect(overtaken(sent("store", { bus: "field", node: "10" }), [later])?.name).toBe("belt");
    expect(overtaken(sent("locate", { target: "belt" }, 3), [later])?.name).toBe("belt");
    // A device that has the slot is no longer "no new device yet", whatever it is doing.
    expect(overtaken(replace, [slot({ state: "configuring", since_s: 20 })])?.state).toBe("configuring");
  });
  it("stays when it is true still, or was never refused", () => {
    expect(overtaken(replace, [slot({ since_s: 12 })])).toBeNull();
    expect(overtaken(replace, [slot({ state: "empty", r_sn: null, since_s: 20 })])).toBeNull();
    expect(overtaken(sent("store", { node: "belt" }), [slot({ state: "failed", since_s: 20 })])).toBeNull();
    expect(overtaken({ ...replace, status: 0 }, [later])).toBeNull();
    expect(overtaken({ ...replace, done: false }, [later])).toBeNull();
    // Wrong usage stays wrong.
    expect(overtaken({ ...replace, status: 2 }, [later])).toBeNull();
    expect(overtaken(sent("sim", { device: "belt" }), [later])).toBeNull();
    expect(overtaken({ ...replace, values: { bus: "yard", slot: "belt" } }, [later])).toBeNull();
    // Two buses may have a slot of one name.
    expect(overtaken(sent("store", { node: "belt" }), [later, slot({ bus: "yard", state: "absent" })])).toBeNull();
  });
  it("about a whole bus is overtaken when all its slots run", () => {
    const bind = sent("bind", { bus: "field" });
    const yard = slot({ bus: "yard", state: "absent" });
    expect(overtaken(bind, [later, gate, yard])).toEqual({ name: "", state: "operational", sinceS: 25.6 });
    expect(overtaken(bind, [later, { ...gate, state: "empty" }])).toBeNull();
    expect(overtaken(bind, [gate])).toBeNull();
    expect(overtaken(sent("bind", {}), [later, gate, yard])).toBeNull();
    expect(overtaken(sent("lss find", { bus: "field" }), [later])).toBeNull();
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
