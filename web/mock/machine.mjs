/** A machine that does again what was recorded, and a little of what it is asked for. No sockets here. */
import { MockFleet } from "./fleet.mjs";
import { dump, recorded, verbs } from "./recorded.mjs";

const RING = 200_000;
const machines = {
  conveyor: { name: "coal conveyor", file: "examples/conveyor/machine.toml", bitRate: 500_000 },
  belt: { name: "belt", file: "examples/belt.toml", bitRate: 250_000 },
};

export class MockMachine {
  /**
   * rate: frames a second in all, over `buses` buses; `done`: begins where the recording ends; `fleet`: so many
   * machines at its broker
   */
  constructor({
    example = "conveyor",
    buses = 1,
    rate = 500,
    done = false,
    real = false,
    role = "configure",
    odd = false,
    fleet = 0,
  } = {}) {
    const data = recorded(example);
    this.about = machines[example];
    this.script = data.events;
    this.frames = data.frames;
    this.final = new Map(data.slots.map((slot) => [slot.name, slot]));
    this.rate = rate;
    this.role = role;
    this.fleet = new MockFleet(fleet);
    this.lock = { real, unlocked_until_s: null };
    this.buses = Array.from({ length: buses }, (_, i) => ({
      name: i === 0 ? "field" : `bus ${i + 1}`,
      bit_rate: i === 0 ? this.about.bitRate : 1_000_000,
      port: real ? "can0" : "sim",
      role: "master",
      master_id: 127,
      beneath: null,
    }));
    this.slots = data.slots.map((slot) => ({ ...slot, state: "empty", r_sn: null, since_s: 0 }));
    if (odd) this.slots[1].name = "<b>quay</b>\u0007\u202edrow";
    this.events = [];
    this.time = 0;
    this.at = 0;
    this.planned = [];
    this.news = { slots: new Set(), events: [], lock: false };
    this.questions = [];
    this.next = 0;
    this.ring = [];
    this.owed = 0;
    this.running = true;
    this.speed = 1;
    this.listeners = new Set();
    if (done) this.advance(this.script[this.script.length - 1].at_s + 0.01);
    if (example === "conveyor" && done) this.makeTrouble();
  }

  get ringFirst() {
    return this.next - Math.min(this.next, this.ring.length);
  }

  slot(name) {
    return this.slots.find((slot) => slot.name === name || String(slot.id) === name);
  }

  /** Some slots that need somebody. */
  makeTrouble() {
    this.set("reclaimer drive", "absent", "no heartbeat for 1.5 s; it was last heard at 9.020 s", "B");
    this.set("yard scale", "failed", "1F20h: value of 6423h:00 refused, abort 06090030h, value range exceeded", "J");
    const devices = ["00000001-00000042-00010001-000007D1", "00000001-00000042-00010001-000007D2"];
    const text =
      "two new devices and one free slot: which one is main belt? Answer: berth replace 'main belt' --device ADDRESS";
    this.set("main belt", "question", text);
    this.tell({ kind: "question", slot: "main belt", slots: ["main belt"], devices, text });
  }

  set(name, state, reason = "", boot = "") {
    const slot = this.slot(name);
    if (!slot) return;
    Object.assign(slot, { state, since_s: Number(this.time.toFixed(6)) });
    delete slot.reason;
    delete slot.boot;
    if (reason) slot.reason = reason;
    if (boot) slot.boot = boot;
    this.news.slots.add(slot);
    this.tell({ kind: "state", slot: slot.name, text: reason ? `${state}: ${reason}` : state });
  }

  tell(event) {
    const whole = { at_s: Number(this.time.toFixed(6)), bus: "field", ...event };
    this.events.push(whole);
    this.news.events.push(whole);
    if (event.kind === "question") this.questions.push(whole);
  }

  later(seconds, run) {
    this.planned.push({ at: this.time + seconds, run });
  }

  advance(seconds) {
    if (!this.running) return;
    this.time += seconds * this.speed;
    while (this.at < this.script.length && this.script[this.at].at_s <= this.time) this.replay(this.script[this.at++]);
    const due = this.planned.filter((entry) => entry.at <= this.time);
    this.planned = this.planned.filter((entry) => entry.at > this.time);
    for (const entry of due) entry.run();
    this.owed += seconds * this.speed * this.rate;
    const count = Math.floor(this.owed);
    this.owed -= count;
    this.send(count, seconds * this.speed);
  }

  replay(event) {
    this.events.push(event);
    this.news.events.push(event);
    const slot = event.slot && this.slot(event.slot);
    if (!slot) return;
    if (event.kind === "bound") slot.r_sn = this.final.get(slot.name)?.r_sn ?? null;
    if (event.kind === "state") {
      const [state, ...reason] = event.text.split(": ");
      Object.assign(slot, { state, since_s: event.at_s });
      delete slot.reason;
      if (reason.length) slot.reason = reason.join(": ");
    }
    this.news.slots.add(slot);
  }

  send(count, seconds) {
    const step = count ? seconds / count : 0;
    for (let i = 0; i < count; i++) {
      const original = this.frames[this.next % this.frames.length];
      const frame = {
        ...original,
        n: this.next,
        t: this.time - seconds + (i + 1) * step,
        bus: this.next % this.buses.length,
      };
      this.ring.push(frame);
      this.next++;
      for (const listener of this.listeners) listener(frame);
    }
    if (this.ring.length > RING + 50_000) this.ring = this.ring.slice(-RING);
  }

  snapshot(seq) {
    return {
      type: "snapshot",
      start: "mock",
      seq,
      machine: {
        name: this.about.name,
        simulated: !this.lock.real,
        fleet: this.fleet.machines.length ? "hall-2/line 1" : "",
        file: this.about.file,
      },
      buses: this.buses,
      slots: this.slots,
      events: this.events.slice(-1000),
      questions: this.questions,
      time_s: this.time,
      verbs: this.lock.real ? verbs.filter((verb) => !verb.name.startsWith("world ")) : verbs,
      lock: this.lock,
      role: this.role,
      world: this.world(),
    };
  }

  /** What changed since it was asked last, or null. */
  takeNews() {
    const { slots, events, lock } = this.news;
    const answered = this.questions.filter(({ slots }) => slots.some((name) => this.slot(name)?.state === "question"));
    const changed = answered.length !== this.questions.length || events.some((event) => event.kind === "question");
    this.questions = answered;
    if (!slots.size && !events.length && !lock && !changed) return null;
    this.news = { slots: new Set(), events: [], lock: false };
    const more = { ...(lock ? { lock: this.lock } : {}), ...(changed ? { questions: this.questions } : {}) };
    return { time_s: this.time, slots: [...slots], events, ...more };
  }

  world() {
    return this.lock.real ? null : { paused: !this.running, speed: this.speed, time_s: this.time };
  }

  rates() {
    const each = this.running ? (this.rate * this.speed) / this.buses.length : 0;
    return {
      type: "rates",
      buses: this.buses.map((bus) => ({
        bus: bus.name,
        frames_per_s: each,
        load: Math.min(1, (each * 118) / bus.bit_rate),
        errors_per_s: 0,
        errors: 0,
        state: "active",
        tec: 0,
        rec: 0,
      })),
      ring: { first: this.ringFirst, next: this.next },
      left_out: 0,
      world: this.world(),
    };
  }

  /** With `from` the first rows from there on, else the newest. */
  rows({ from, count, filter = "" }) {
    const words = filter.toLowerCase().split(/\s+/).filter(Boolean);
    const row = (frame) => ({
      n: frame.n,
      t_s: frame.t,
      bus: this.buses[frame.bus].name,
      id: frame.id,
      ext: frame.ext,
      rtr: frame.rtr,
      data: frame.data,
      text: frame.text,
      ...(frame.rtr ? { dlc: frame.dlc } : {}),
    });
    const line = (frame) => {
      const id = frame.id.toString(16).padStart(frame.ext ? 8 : 3, "0");
      return `${this.buses[frame.bus].name} ${id}#${frame.data} ${frame.text}`.toLowerCase();
    };
    const matching = words.length
      ? this.ring.filter((frame) => words.every((word) => line(frame).includes(word)))
      : this.ring;
    const chosen =
      from === undefined ? matching.slice(-count) : matching.filter((frame) => frame.n >= from).slice(0, count);
    const rows = chosen.map(row);
    const none = from ?? this.ringFirst;
    return { first: rows[0]?.n ?? none, last: rows[rows.length - 1]?.n ?? none, rows, matched: matching.length };
  }

  /** The reply to a request: { status, reply, lines, error }. */
  request(verb, values) {
    if (verb === "fleet") {
      return this.fleet.machines.length ? done(this.fleet.answer(values)) : refused(1, "it is at no MQTT broker");
    }
    const entry =
      verb === "sim" ? { changes: true, role: "operate" } : verbs.find((candidate) => candidate.name === verb);
    if (!entry) return refused(2, `there is no command "${verb}"`);
    const roles = ["view", "operate", "configure"];
    if (roles.indexOf(this.role) < roles.indexOf(entry.role))
      return refused(1, `"${verb}" needs the role ${entry.role}, and this token is for ${this.role}`);
    if (entry.changes && this.lock.real && this.lock.unlocked_until_s === null) {
      return refused(1, "real buses are read-only; unlock them first");
    }
    const answer = answers[verb] ?? (() => done({}, [`${verb}: the mock server does nothing for it`]));
    return answer(this, values);
  }

  bringUp(slot, rSn) {
    this.later(1.5, () => {
      slot.r_sn = rSn;
      this.set(slot.name, "binding", "discovered");
    });
    this.later(2, () => {
      const digits = (slot.type + rSn).replace(/0x/g, "").match(/.{8}/g).join("-");
      this.tell({ kind: "bound", slot: slot.name, text: `bound to ${digits} as node-ID ${slot.id}` });
      this.set(slot.name, "present");
    });
    this.later(2.5, () => this.set(slot.name, "configuring", "comparing 41 values of machine.toml"));
    this.later(3.5, () => {
      this.tell({ kind: "configured", slot: slot.name, text: "33 of 41 values of machine.toml written, dated, saved" });
      this.set(slot.name, "present");
    });
    this.later(4, () => this.set(slot.name, "operational"));
  }
}

const done = (reply, lines = []) => ({ status: 0, reply, lines, error: "" });
const refused = (status, error) => ({ status, reply: { error: { message: error } }, lines: [], error });
const key = (object) =>
  `${object.index.replace(/^0x/i, "").toUpperCase()}h:${object.sub.toString(16).toUpperCase().padStart(2, "0")}`;
const objects = structuredClone(dump.objects);

function noSlot(name) {
  return refused(2, `"${name}" is no slot`);
}

const answers = {
  replace(machine, { slot: name, device }) {
    const slot = machine.slot(name);
    if (!slot) return noSlot(name);
    slot.r_sn = null;
    machine.set(slot.name, "empty", "waits for a new device");
    const spare = device ? `0x${device.replace(/-/g, "").slice(16)}` : "0x00010001000007D5";
    machine.bringUp(slot, spare);
    return done({ slot: slot.name }, [`${slot.name} waits for a new device`]);
  },
  locate: (_, { target, seconds = "10" }) => done({ target }, [`${target} flickers for ${seconds} s`]),
  forget: (_, { device }) => done({ device }, [`${device} is forgotten`]),
  history(machine, { slot: name }) {
    const slot = machine.slot(name);
    if (!slot) return noSlot(name);
    return done({ history: [] }, [`field/${slot.name}`, "  0.000 s  declared", "  0.828 s  confirmed, discovered"]);
  },
  scan: (machine) =>
    done(
      {},
      machine.slots.map((slot) => `node ${String(slot.id).padStart(3)}  ${slot.state.padEnd(12)}  ${slot.name}`),
    ),
  doctor(machine, values) {
    const buses = [{ bus: "field", frames: 812, load: 0.1, errors: 0 }];
    const asked = values.active || values.intrusive ? "lss" : "nothing";
    return done({ listened_s: 5, asked, buses, findings: [], problems: [], without_port: [] }, ["nothing wrong"]);
  },
  nmt: (_, { command, node }) => done({ command }, [`${command} sent to ${node}`]),
  "sdo dump": () => done({ ...dump, objects }),
  "sdo read"(_, { object }) {
    const found = objects.find((entry) => key(entry) === object);
    return found
      ? done({ objects: [found] })
      : refused(1, `object ${object}: aborted with 06020000h, object does not exist`);
  },
  "sdo write"(_, { object, value }) {
    const found = objects.find((entry) => key(entry) === object);
    if (!found) return refused(1, `object ${object}: aborted with 06020000h, object does not exist`);
    if (!/^\d+$/.test(value)) return refused(2, `"${value}" is no number`);
    found.value = Number(value);
    delete found.time;
    return done(found);
  },
  sim(machine, { action, device }) {
    if (action === "devices") return done({ devices: [], cables: [] });
    const slot = machine.slot(device);
    if (!slot) return noSlot(device);
    if (action === "unplug") machine.set(device, "absent", "no heartbeat for 1.5 s", "B");
    if (action === "plug") machine.bringUp(slot, slot.r_sn ?? "0x00010001000007D5");
    return done({ action, device }, [`${device}: ${action}`]);
  },
  "world pause"(machine) {
    machine.running = false;
    return done({});
  },
  "world run"(machine) {
    machine.running = true;
    return done({});
  },
  "world speed"(machine, { factor }) {
    machine.speed = Math.min(100, Math.max(0.1, Number(factor) || 1));
    return done({});
  },
};
