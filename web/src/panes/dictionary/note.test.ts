import { describe, expect, it } from "vitest";
import { commandLine } from "../../protocol/command";
import type { Verb } from "../../protocol/messages";
import { firstState, reducer } from "../../store/reducer";
import type { State } from "../../store/state";
import { draftOf, meaningOf, noteOf, noteValues, scaled, sorted, wrongNames, type Note } from "./note";
import { noteOwner } from "./reducer";

const parameter = (name: string, form: Verb["parameters"][number]["form"], more = {}) => ({
  name,
  form,
  help: "",
  required: false,
  value: "",
  ...more,
});
const verbs: Verb[] = [
  {
    name: "note write",
    help: "",
    changes: true,
    role: "configure",
    parameters: [
      parameter("bus", "common"),
      parameter("node", "word"),
      parameter("object", "own"),
      parameter("text", "option"),
      parameter("unit", "option"),
      parameter("scale", "option"),
      parameter("values", "own", { spelled: "--value" }),
      parameter("bits", "own", { spelled: "--bit" }),
      parameter("anew", "flag"),
    ],
  },
];

const drive = { text: "State", bits: { "0": "ready", "3": "fault", "15": "maker's" }, values: { "-1": "none" } };
const note = (of: object): Note => noteOf(of) as Note;

function answered(state: State, verb: string, owner: string, reply: unknown, status = 0): State {
  const id = `${verb} ${state.requests.length}`;
  const sent = reducer(state, { type: "sent", id, verb, values: {}, owner });
  const message = { type: "reply" as const, id, status, reply, lines: [], error: "" };
  return reducer(sent, { type: "message", now: 0, message });
}

describe("a note", () => {
  it("says what a value means: its name, its bits, its quantity", () => {
    expect(meaningOf("9", note(drive))).toBe("ready, fault");
    expect(meaningOf("-1", note(drive))).toBe("none");
    expect(meaningOf("32768", note(drive))).toBe("maker's");
    expect(meaningOf("235", note({ unit: "°C", scale: 0.1 }))).toBe("23.5 °C");
    expect(meaningOf("-3", note({ unit: "°C", scale: 0.1, values: { "-3": "cold" } }))).toBe("-0.3 °C, cold");
    expect(meaningOf("Pump", note({ unit: "°C" }))).toBe("");
    expect(scaled(3, note({ unit: "V", scale: 0.1 }))).toBe(0.3);
    expect(scaled(3, null)).toBe(3);
  });
  it("is sorted by number, and nonsense is none", () => {
    expect(sorted({ "10": "b", "9": "a", "-2": "c" }).map(([key]) => key)).toEqual(["-2", "9", "10"]);
    expect(noteOf("text")).toBeNull();
    expect(noteOf({ scale: -1, values: 3, text: 7 })).toEqual({ text: "", unit: "", scale: 1, values: {}, bits: {} });
  });
  it("is edited as lines, and sent as what the command line takes", () => {
    const draft = draftOf("note:x", { file: "drive.notes", own: { unit: "°C", scale: 0.1, values: { "0": "off" } } });
    expect(draft).toMatchObject({ inFile: true, file: "drive.notes", scale: "0.1", values: "0 = off", bits: "" });
    const changed = { ...draft, values: "0 = off\n 0x10=a = b \n\n" };
    const values = noteValues(changed);
    expect(values).toEqual({ anew: "1", unit: "°C", scale: "0.1", values: "0=off\n0x10=a = b" });
    const target = { bus: "field", node: "drive", object: "2001h:02" };
    expect(commandLine("note write", { ...target, ...values }, verbs, "m.toml")).toBe(
      "berth note write drive 2001h:02 --bus field --unit '°C' --scale 0.1 --value 0=off --value '0x10=a = b' --anew -m m.toml",
    );
    expect(noteValues(draftOf("note:x", { file: "drive.notes" }))).toBeNull();
  });
  it("says which line is wrong", () => {
    expect(wrongNames("0 = off\n0x1F = on\n-3=low", false)).toBe("");
    expect(wrongNames("off", false)).toContain('"off"');
    expect(wrongNames("3 =", false)).not.toBe("");
    expect(wrongNames("63 = last", true)).toBe("");
    expect(wrongNames("64 = none", true)).not.toBe("");
    expect(wrongNames("-1 = none", true)).not.toBe("");
  });
  it("takes nothing away of what the object's own description says its value means", () => {
    const object = "1A00h:01";
    const mapped = { index: "0x1A00", sub: 1, type: "UNSIGNED32", value: 1, bytes: "01 00 00 00", meaning: "6000h:01" };
    let state = reducer(firstState, { type: "view", change: { slot: "field/10", object } });
    state = answered(state, "sdo dump", "dictionary:field/10", { objects: [mapped] });
    const row = () => state.dictionary.objects["field/10"]?.[0];
    const noted = (note: unknown) => answered(state, "note write", noteOwner("field/10", object), { note, own: note });
    state = noted({ text: "The belt's inputs", values: { "1": "named" } });
    expect(row()).toMatchObject({ note: { text: "The belt's inputs" }, meaning: "6000h:01" });
    // `sdo read` says it again, `sdo write` of the same value need not.
    const { meaning, ...bare } = mapped;
    state = answered(state, "sdo write", "dictionary:field/10", bare);
    expect(row()?.meaning).toBe(meaning);
    state = answered(state, "sdo read", "dictionary:field/10", { ...mapped, value: 2, meaning: "6000h:02" });
    expect(row()?.meaning).toBe("6000h:02");
    state = answered(state, "sdo write", "dictionary:field/10", bare);
    expect(row()?.meaning).toBe("named");
    state = noted(null);
    expect(row()?.meaning).toBe("");
  });
  it("comes into the row and the editor, and leaves with the selection", () => {
    const object = "6041h:00";
    let state = reducer(firstState, { type: "view", change: { slot: "field/10", object } });
    const dumped = { objects: [{ index: "0x6041", sub: 0, type: "UNSIGNED16", value: 9, bytes: "09 00" }] };
    state = answered(state, "sdo dump", "dictionary:field/10", dumped);
    const reply = { index: "0x6041", sub: 0, file: "drive.notes", note: drive, own: { text: "State" } };
    state = answered(state, "note write", noteOwner("field/10", object), reply);
    const row = () => state.dictionary.objects["field/10"]?.[0];
    expect(row()).toMatchObject({ note: { text: "State" }, meaning: "ready, fault" });
    expect(state.dictionary.note).toMatchObject({ text: "State", values: "", inFile: true });
    state = reducer(state, { type: "dictionary/note", change: { text: "Statusword" } });
    expect(state.dictionary.note?.text).toBe("Statusword");
    // `sdo write` says nothing of notes: they stay, and tell the new value.
    const written = { index: "0x6041", sub: 0, type: "UNSIGNED16", value: 1, bytes: "01 00" };
    state = answered(state, "sdo write", "dictionary:field/10", written);
    expect(row()).toMatchObject({ note: { text: "State" }, value: "1", meaning: "ready" });
    state = answered(state, "note write", noteOwner("field/10", object), {}, 3);
    expect(state.dictionary.note?.text).toBe("Statusword");
    state = reducer(state, { type: "view", change: { object: "1017h:00" } });
    expect(state.dictionary.note).toBeNull();
    // An answer that comes later is none of the object that is selected now.
    state = answered(state, "note read", noteOwner("field/10", object), reply);
    expect(state.dictionary.note).toBeNull();
  });
});
