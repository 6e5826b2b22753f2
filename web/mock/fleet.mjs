/** Machines at a broker that is not there: as many as asked for, some of which need somebody. */

const slot = (name, state = "operational", reason = "") => ({
  name,
  state,
  reason,
  emcy: "",
  configuration: state === "absent" ? "" : "as wanted",
  program: "none",
  needs_somebody: state !== "operational",
});

const troubles = [
  [slot("left drive", "absent", "no heartbeat for 1.5 s; it was last heard at 812.020 s")],
  [
    slot("gate", "failed", "1F20h: value of 6423h:00 refused, abort 06090030h, value range exceeded"),
    slot("scale", "question", "two new devices and one free slot: which one is scale?"),
  ],
  ["infeed drive", "outfeed drive", "lifter", "gate", "scale"].map((name) => slot(name, "absent", "no heartbeat")),
];
const sound = ["infeed drive", "left drive", "right drive", "outfeed drive", "lifter", "gate", "scale", "cabinet io"];

/** The machine with this number; number 1 is the one that serves the page. */
function machine(number, now) {
  const online = number === 1 || number % 29 !== 3;
  const wrong = number % 17 === 2 ? troubles[Math.floor(number / 17) % troubles.length] : [];
  const good = sound.filter((name) => !wrong.some((each) => each.name === name)).map((name) => slot(name));
  const operational = online && !wrong.length;
  const words = wrong.map(({ name, state, reason }) => `slot ${name}: ${state}, ${reason}`);
  return {
    group: "hall-2",
    machine: `line ${number}`,
    online,
    in_doubt: false,
    is_berth: true,
    operational,
    needs_somebody: !operational,
    reason: online ? words.join("; ") : "offline",
    version: number % 5 ? "0.1.0" : "0.0.9",
    studio: online && number % 2 ? `https://line-${number}.hall-2.plant:8302/` : "",
    since_ms: now - number * number * 7000,
    bus_trouble: [],
    slots: [...wrong, ...good].sort((a, b) => (a.name < b.name ? -1 : 1)),
  };
}

const MOST = 100;

export class MockFleet {
  constructor(count) {
    const now = Date.now();
    this.machines = Array.from({ length: count }, (_, i) => machine(i + 1, now));
  }

  /** docs/api.md, The fleet: each machine has its place in the list as number. */
  answer({ since = "0" }) {
    const from = Number(since);
    const head = { connected: true, trouble: "" };
    if (from === this.machines.length) return { changes: from, ...head };
    const changes = Math.min(from + MOST, this.machines.length);
    const more = changes < this.machines.length;
    return { changes, ...head, whole: from === 0, more, machines: this.machines.slice(from, changes) };
  }
}
