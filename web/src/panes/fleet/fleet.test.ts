import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../../store/reducer";
import { snapshot } from "../../store/samples";
import type { State } from "../../store/state";
import {
  ageWords,
  found,
  headline,
  ordered,
  slotsWords,
  stateOf,
  studioLink,
  type FleetMachine,
  type FleetSlot,
} from "./reducer";

const slot = (change: Partial<FleetSlot> = {}): FleetSlot => ({
  name: "drive",
  state: "operational",
  reason: "",
  emcy: "",
  configuration: "none",
  program: "none",
  needs: false,
  ...change,
});

const machine = (change: Partial<FleetMachine> = {}): FleetMachine => ({
  group: "hall-2",
  name: "line 1",
  online: true,
  inDoubt: false,
  isBerth: true,
  operational: true,
  needs: false,
  version: "0.1.0",
  studio: "",
  sinceMs: 0,
  busTrouble: [],
  slots: [slot()],
  ...change,
});

const lost = (name: string) =>
  machine({
    name,
    operational: false,
    needs: true,
    slots: [slot(), slot({ name: "gate", state: "absent", reason: "no heartbeat", needs: true })],
  });

const byKey = (machines: FleetMachine[]) => Object.fromEntries(machines.map((each) => [each.name, each]));

/** What the server sends of a machine. */
const told = (name: string, more = {}) => ({ group: "hall-2", machine: name, online: true, is_berth: true, ...more });

/** After this answer to a request with the verb. */
function answered(state: State, reply: object, { verb = "fleet", status = 0, error = "" } = {}): State {
  const id = `r${state.requests.length}`;
  const asked = reducer(state, { type: "sent", id, verb, values: {}, owner: "look:fleet" });
  const message = { type: "reply" as const, id, status, reply, lines: [], error };
  return reducer(asked, { type: "message", message, now: 0 });
}
const names = (state: State) => ordered(state.fleet.machines).map(({ name }) => name);

describe("the fleet", () => {
  it("is the first answer, and then what changed", () => {
    const first = answered(firstState, {
      changes: 2,
      connected: true,
      trouble: "",
      whole: true,
      more: true,
      machines: [told("line 2"), told("line 1", { studio: "http://10.0.0.1:8302/" })],
    });
    expect(names(first)).toEqual(["line 1", "line 2"]);
    expect(first.fleet).toMatchObject({ changes: 2, more: true, connected: true });
    const news = [told("line 2", { online: false, needs_somebody: true })];
    const next = answered(first, { changes: 3, connected: true, trouble: "", machines: news });
    expect(names(next)).toEqual(["line 2", "line 1"]);
    expect(next.fleet).toMatchObject({ changes: 3, more: false });
    const same = answered(next, { changes: 3, connected: false, trouble: "nothing listens there" });
    expect(names(same)).toEqual(["line 2", "line 1"]);
    expect(same.fleet).toMatchObject({ connected: false, trouble: "nothing listens there" });
  });

  it("begins anew when the server says so, or was restarted", () => {
    const message = { changes: 9, connected: true, trouble: "", whole: true, machines: [told("line 1")] };
    const full = answered(reducer(firstState, { type: "message", message: snapshot({ start: "a" }), now: 0 }), message);
    const anew = answered(full, { ...message, machines: [told("line 7")] });
    expect(names(anew)).toEqual(["line 7"]);
    const again = reducer(anew, { type: "message", message: snapshot({ start: "a", seq: 9 }), now: 0 });
    expect(again.fleet.changes).toBe(9);
    const restarted = reducer(anew, { type: "message", message: snapshot({ start: "b" }), now: 0 });
    expect(restarted.fleet).toMatchObject({ changes: 0, machines: {} });
  });

  it("takes nothing from other answers, and a refusal's words", () => {
    const reply = { changes: 1, connected: true, whole: true, machines: [told("line 1")] };
    expect(answered(firstState, reply, { verb: "report" }).fleet.machines).toEqual({});
    const refused = answered(firstState, { error: {} }, { status: 1, error: "at no MQTT broker" });
    expect(refused.fleet).toMatchObject({ connected: false, trouble: "at no MQTT broker" });
    const broken = answered(answered(firstState, { ...reply, more: true }), {}, { status: 3, error: "too busy" });
    expect(broken.fleet.more).toBe(false);
    const odd = answered(firstState, { changes: 1, connected: true, whole: true, machines: [5, { slots: [{}, 7] }] });
    expect(ordered(odd.fleet.machines)).toMatchObject([{ name: "", online: false, slots: [{ name: "" }] }]);
  });

  it("shows those that need somebody first, then names as people count", () => {
    const machines = [machine({ name: "line 10" }), machine({ name: "line 9" }), lost("line 30"), lost("line 4")];
    expect(ordered(byKey(machines)).map(({ name }) => name)).toEqual(["line 4", "line 30", "line 9", "line 10"]);
  });

  it("says how a machine is by the mark of its worst slot", () => {
    expect(stateOf(machine())).toEqual({ word: "operational", mark: "operational" });
    expect(stateOf(lost("line 1"))).toEqual({ word: "not operational", mark: "absent" });
    const two = lost("line 1");
    two.slots.push(slot({ name: "scale", state: "failed", needs: true }));
    expect(stateOf(two).mark).toBe("failed");
    const starting = machine({ operational: false, slots: [slot({ state: "binding", needs: true })] });
    expect(stateOf(starting).mark).toBe("binding");
    expect(stateOf(machine({ busTrouble: ["bus field is bus-off"] }))).toEqual({
      word: "bus field is bus-off",
      mark: "failed",
    });
    expect(stateOf(machine({ online: false })).word).toBe("offline");
    expect(stateOf(machine({ inDoubt: true })).word).toBe("in doubt");
    expect(stateOf(machine({ isBerth: false, operational: false })).word).toBe("online");
  });

  it("counts slots, machines and time", () => {
    expect(slotsWords(lost("line 1"))).toBe("1 of 2 slots operational");
    expect(slotsWords(machine())).toBe("1 of 1 slot operational");
    expect(slotsWords(machine({ slots: [] }))).toBe("");
    expect(headline([machine()])).toBe("1 machine, none needs somebody");
    expect(headline([machine(), lost("b")])).toBe("1 of 2 machines needs somebody");
    expect(headline([lost("a"), lost("b")])).toBe("2 of 2 machines need somebody");
    const ages = [-5, 59, 60, 3599, 3600, 47 * 3600, 49 * 3600].map((s) => ageWords(1e12 + s * 1000, 1e12));
    expect(ages).toEqual(["0 s", "59 s", "1 min", "59 min", "1 h", "47 h", "2 d"]);
  });

  it("finds a machine by its name, its state, or a slot that needs somebody", () => {
    const all = [machine(), lost("press 2"), machine({ name: "line 3", version: "0.0.9" })];
    const search = (words: string) => found(all, words).map(({ name }) => name);
    expect(search("")).toHaveLength(3);
    expect(search("LINE hall-2")).toEqual(["line 1", "line 3"]);
    expect(search("gate heartbeat")).toEqual(["press 2"]);
    expect(search("drive")).toEqual([]);
    expect(search("0.0.9")).toEqual(["line 3"]);
    expect(search("not operational")).toEqual(["press 2"]);
  });

  it("leads only to pages, and to this computer's only from there", () => {
    expect(studioLink("https://line-3.plant:8302/", "10.0.0.9")).toBe("https://line-3.plant:8302/");
    expect(studioLink("http://10.0.0.5:8302/#token=1", "10.0.0.9")).toBe("http://10.0.0.5:8302/");
    for (const local of ["http://127.0.0.1:8303/", "http://localhost:8303/", "http://[::1]:8303/"]) {
      expect(studioLink(local, "127.0.0.1")).toBe(local);
      expect(studioLink(local, "[::1]")).toBe(local);
      expect(studioLink(local, "line-3.plant")).toBeNull();
    }
    for (const bad of [
      "",
      "line-3",
      "javascript:alert(1)",
      "data:text/html,x",
      "file:///etc/passwd",
      "https://u:p@h/",
    ]) {
      expect(studioLink(bad, "127.0.0.1")).toBeNull();
    }
  });
});
