import { describe, expect, it } from "vitest";
import { storyOf, toldOf } from "./told";

const slot = { bus: "field", id: 1, name: "drive", state: "empty", since_s: 11 };
const head = "bus     id  slot   state             since  type               serial";
const row = "field    1  drive  empty          11.031 s  00000001-00000001  -";

describe("what an answer tells", () => {
  it("has its slots instead of their table", () => {
    const lines = ["drive released (heartbeat lost)", head, row, "drive: empty: replaced by a person"];
    const rest = ["drive released (heartbeat lost)", "drive: empty: replaced by a person"];
    expect(toldOf(lines, slot)).toEqual({ slots: [slot], lines: rest });
    expect(toldOf([head, row], { slots: [slot] })).toEqual({ slots: [slot], lines: [] });
  });

  it("stays whole when it is no such answer", () => {
    expect(toldOf([head, row], null)).toEqual({ slots: [], lines: [head, row] });
    expect(toldOf([head, row], { slots: "none" })).toEqual({ slots: [], lines: [head, row] });
    expect(toldOf(["1018h:04  7"], slot)).toEqual({ slots: [], lines: ["1018h:04  7"] });
  });

  it("is a story when it is a history", () => {
    const lines = ["       0.780 s  field/left drive  asked      00000001-00000001  node-ID 1  discovered"];
    expect(storyOf(lines)).toEqual([{ when: "0.780 s", what: "asked, 00000001-00000001, node-ID 1, discovered" }]);
  });
});
