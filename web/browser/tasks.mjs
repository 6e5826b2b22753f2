/**
 * What a person comes with, at most so many acts away: acts.mjs asserts the acts, figures.mjs prints the seconds. They
 * are those of the page, the server and the simulated machine (Chromium presses at once): a person's reading and
 * reaching come on top, and no test waits on them.
 */
import assert from "node:assert/strict";

const own = (name) => [`web/browser/machines/${name}.toml`, `web/browser/machines/${name}.plant.toml`];
const folder = (name) => [`examples/${name}/machine.toml`, `examples/${name}/plant.toml`];
const file = (name) => [`examples/${name}.toml`, `examples/${name}.plant.toml`];
export const machines = {
  belt: file("belt"),
  five: file("five-slaves"),
  many: file("hundred-twenty"),
  configured: file("configured"),
  programmed: file("programmed"),
  twins: own("twins"),
  unsaved: own("unsaved"),
  stray: own("stray"),
  conveyor: folder("conveyor"),
  harvester: folder("harvester"),
  signals: folder("signals"),
};

/** Counts what a person does: each press and each text typed is one act. */
export function actsOn(page) {
  let count = 0;
  return {
    press: (what) => (count++, what.click()),
    tap: (what) => (count++, what.tap()),
    type: (what, text) => (count++, what.fill(text)),
    enter: (what, text) => (count++, what.fill(text).then(() => what.press("Enter"))),
    button: (name) => page.getByRole("button", { name, exact: true }),
    tab: (name) => page.getByRole("tab", { name }),
    row: (text) => page.locator(".rows tr", { hasText: text }),
    slot: (name) => page.locator(".tree button", { has: page.locator(".name", { hasText: new RegExp(`^${name}$`) }) }),
    count: () => count,
    atMost: (most) => assert.ok(count <= most, `${count} acts, at most ${most}`),
  };
}

/** Runs a part of a task and tells how long it took. */
async function timed(part) {
  const begun = performance.now();
  await part();
  return (performance.now() - begun) / 1000;
}

/** A minute of bus time, on a machine that goes on. */
async function minuteLater(berth) {
  const { time_s: begun } = await berth.snapshot();
  await berth.request("world speed", { factor: "1000" });
  for (let look = 0; look < 1200; look++) {
    const { time_s: now } = await berth.snapshot();
    if (now > begun + 60) break;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  await berth.request("world speed", { factor: "1" });
}

/** "task: replace it: 3 acts of 3, 1.9 s" */
export function taskLine({ name, acts, limit }, count, seconds) {
  const aim = limit ? `, at most ${limit} s` : "";
  return `task: ${name}: ${count} acts of ${acts}, ${seconds.toFixed(1)} s${aim}`;
}

const tablet = { width: 768, height: 1024, touch: true };

export const tasks = [
  {
    name: "the failed device is found",
    acts: 1,
    limit: 5,
    where: { machine: "belt", fresh: true },
    async act(page, berth, by) {
      await berth.request("sim", { action: "unplug", device: "light barrier" });
      const needs = page.getByRole("button", { name: "1 needs somebody" });
      await needs.waitFor();
      const seconds = await timed(async () => {
        await by.press(needs);
        await page.locator(".inspector h2", { hasText: "barrier" }).waitFor();
        await page.locator(".need-box", { hasText: "does not answer" }).waitFor();
      });
      return { seconds };
    },
  },
  {
    name: "the fitter replaces it by three taps at most",
    acts: 3,
    where: { machine: "twins", fresh: true, ready: ["left", "right"], hash: "&pane=slots", view: tablet },
    async act(page, berth, by) {
      await berth.request("sim", { action: "unplug", device: "old gate" });
      await by.row("gate").locator("text=absent").waitFor();
      const seconds = await timed(async () => {
        await by.tap(by.row("gate"));
        await by.tap(by.button("Replace").first());
        await page.locator(".steps li.now", { hasText: "plug in the spare" }).waitFor();
        await berth.request("sim", { action: "plug", device: "spare gate" });
        await page.locator(".steps li.done", { hasText: "It runs" }).waitFor();
      });
      assert.equal(await page.locator(".inspector .answer.bad").count(), 0);
      const { slots } = await berth.snapshot();
      assert.equal(slots.find((slot) => slot.name === "gate").r_sn, "0x0000000000000022");
      return { seconds };
    },
  },
  {
    name: "a heartbeat is changed on ten devices",
    acts: 6,
    where: { machine: "many", fresh: true },
    async act(page, berth, by) {
      const seconds = await timed(async () => {
        await by.press(by.slot("sensor 3"));
        await by.press(by.tab("Dictionary"));
        await by.enter(page.getByLabel("Search objects"), "1017h");
        await by.type(page.getByLabel("New value"), "750");
        await by.type(page.getByLabel("Devices"), "1-10");
        await by.press(by.button("Write to 10 devices"));
        await page.locator(".answer.good", { hasText: "10 of 10" }).waitFor();
      });
      for (let id = 1; id <= 10; id++) {
        const { reply } = await berth.request("sdo read", { node: String(id), object: "1017h:00" });
        assert.equal(reply.value, 750);
      }
      const { reply } = await berth.request("sdo read", { node: "11", object: "1017h:00" });
      assert.notEqual(reply.value, 750);
      return { seconds };
    },
  },
  {
    name: "an SDO abort of a minute ago leads to its object",
    acts: 4,
    where: {},
    async act(page, berth, by) {
      const before = await berth.request("sdo read", { node: "unloader drive", object: "1A7Fh:02" });
      assert.notEqual(before.status, 0);
      await minuteLater(berth);
      const seconds = await timed(async () => {
        await by.press(by.tab("Trace"));
        await by.type(page.getByLabel("Filter frames"), "abort 1A7Fh");
        await by.press(page.locator(".scroll .frame", { hasText: "abort" }).first());
        await by.press(page.getByRole("button", { name: "Object 1A7Fh:02 in the dictionary" }));
        await page.locator(".inspector h2", { hasText: "1A7Fh:02" }).waitFor();
        await page.locator(".inspector h2", { hasText: "unloader drive" }).waitFor();
      });
      return { seconds };
    },
  },
];
