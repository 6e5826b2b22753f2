/** Machines at a Mosquitto of the test's own, and the acts of the pane Fleet. */
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { accessSync, constants, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { connect, createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { AxeBuilder } from "@axe-core/playwright";
import { binary, operational, startBerth } from "./berth.mjs";
import { openPage } from "./open.mjs";

const rest = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Where the broker's program is; empty: it is not installed. It is for administrators, whose folders others do not search. */
function program() {
  const folders = [...(process.env.PATH ?? "").split(":"), "/usr/sbin", "/usr/local/sbin"];
  const paths = folders.filter(Boolean).map((folder) => join(folder, "mosquitto"));
  const found = paths.find((path) => {
    try {
      accessSync(path, constants.X_OK);
      return true;
    } catch {
      return false;
    }
  });
  return found ?? "";
}

async function freePort() {
  const server = createServer().listen(0, "127.0.0.1");
  await new Promise((resolve) => server.on("listening", resolve));
  const { port } = server.address();
  await new Promise((resolve) => server.close(resolve));
  return port;
}

const listens = (port) =>
  new Promise((resolve) => {
    const socket = connect(port, "127.0.0.1");
    socket.on("connect", () => resolve(true)).on("error", () => resolve(false));
    socket.on("close", () => socket.destroy());
    setTimeout(() => socket.end(), 100);
  });

/** Also ended when this process ends, whatever ends it. */
function started(words, options) {
  const child = spawn(words[0], words.slice(1), options);
  const kill = () => child.kill("SIGKILL");
  process.on("exit", kill);
  const ended = new Promise((resolve) => child.on("exit", resolve));
  return {
    child,
    async end(signal = "SIGTERM") {
      child.kill(signal);
      await ended;
      process.off("exit", kill);
    },
  };
}

async function startBroker(folder) {
  const port = await freePort();
  const config = join(folder, "broker.conf");
  const user = process.getuid() === 0 ? "user root\n" : "";
  writeFileSync(config, `listener ${port} 127.0.0.1\nallow_anonymous true\npersistence false\n${user}`);
  const broker = started([program(), "-c", config], { stdio: "ignore" });
  for (let look = 0; look < 200 && !(await listens(port)); look++) await rest(50);
  return { url: `mqtt://127.0.0.1:${port}`, end: broker.end };
}

/** Files of a machine with two devices: "drive" is in slot drive, "gate" in slot gate. */
function filesOf(folder, name) {
  const machine = join(folder, `${name}.toml`);
  const plant = join(folder, `${name}.plant.toml`);
  const each = (id, what) => `bus = "field"\nname = "${what}"\ntype = { vendor = 1, product = ${id} }\n`;
  writeFileSync(
    machine,
    `[machine]\nname = "${name}"\n[bus.field]\nport = "sim"\nbitrate = 500_000\nmaster_id = 127\n` +
      `[[slot]]\nid = 1\n${each(1, "drive")}[[slot]]\nid = 3\n${each(3, "gate")}`,
  );
  writeFileSync(
    plant,
    `[plant]\nseed = 2\n[bus.field]\n[[device]]\nserial = 1\n${each(1, "drive")}[[device]]\nserial = 2\n${each(3, "gate")}`,
  );
  return [machine, plant];
}

/** One without Studio, which only the command line reaches. */
function startAlone(folder, name, broker) {
  const [machine, plant] = filesOf(folder, name);
  const control = join(folder, "alone.control");
  const options = { cwd: folder, env: { ...process.env, XDG_RUNTIME_DIR: folder }, stdio: "ignore" };
  const up = started([binary, "up", machine, "--sim", plant, "--mqtt", broker, "--control", control], options);
  return {
    end: up.end,
    async sim(...words) {
      const asked = spawn(binary, ["sim", ...words, "--control", control], options);
      const status = await new Promise((resolve) => asked.on("exit", resolve));
      assert.equal(status, 0, `berth sim ${words.join(" ")}`);
    },
  };
}

async function axe(page) {
  const { violations } = await new AxeBuilder({ page }).analyze();
  assert.deepEqual(
    violations.map((v) => `${v.id} (${v.nodes.length}): ${v.nodes[0]?.html.slice(0, 160)}`),
    [],
  );
}

export const tile = (page, name) => page.locator(".tile", { has: page.getByText(name, { exact: true }) });

/**
 * Three machines at a broker: "line 1" serves the page, "line 2" has a Studio of its own, "line 3" has none and lost
 * its drive. Null: no broker is installed.
 */
export async function startHall() {
  if (!program()) return null;
  const folder = mkdtempSync(join(tmpdir(), "berth-hall-"));
  const broker = await startBroker(folder);
  const alone = startAlone(folder, "line 3", broker.url);
  const first = await startBerth(...filesOf(folder, "line 1"), ["--mqtt", broker.url]);
  const second = await startBerth(...filesOf(folder, "line 2"), ["--mqtt", broker.url]);
  await operational(first);
  return {
    first,
    second,
    alone,
    broker,
    /** As soon as all run. */
    async loseDrive() {
      for (let look = 0; look < 600; look++) {
        const { reply } = await first.request("fleet");
        if (reply.machines?.filter((machine) => machine.operational).length === 3) return alone.sim("unplug", "drive");
        await rest(200);
      }
      throw new Error("the three machines are not operational");
    },
    async close() {
      for (const each of [first, second]) await each.close();
      await alone.end();
      await broker.end();
      rmSync(folder, { recursive: true, force: true });
    },
  };
}

/** `check` of acts.mjs runs each. `skip`: says why one is left out. */
export async function fleetActs(check, browser, skip) {
  if (program()) {
    await threeMachines(check, browser);
  } else {
    skip("three machines at a broker", "mqtt: mosquitto is not installed");
  }
  await manyMachines(check);
}

async function threeMachines(check, browser) {
  await check(
    "of three machines at a broker the tile of the one that lost a drive says so, and a press shows its slots",
    { machine: "belt" },
    async (beside) => {
      assert.equal(await beside.getByRole("tab", { name: "Fleet" }).count(), 0, "that machine is at no broker");
      const hall = await startHall();
      const { page, context, errors } = await openPage(browser, `${hall.first.url}&pane=fleet`);
      page.setDefaultTimeout(60_000);
      try {
        await page.getByText("3 machines, none needs somebody").waitFor();
        await hall.alone.sim("unplug", "drive");
        await page.getByText("1 of 3 machines needs somebody").waitFor();
        const lost = tile(page, "line 3");
        assert.equal(await page.locator(".tile").first().locator("b").first().innerText(), "line 3", "it comes first");
        assert.match(await lost.innerText(), /not operational[\s\S]*1 of 2 slots operational[\s\S]*drive: /);
        await axe(page);
        await lost.getByRole("button").click();
        const slots = page.getByRole("region", { name: "Slots of line 3" });
        await slots.locator("li", { hasText: "drive" }).getByText("absent", { exact: true }).waitFor();
        await slots.locator("li", { hasText: "gate" }).getByText("operational", { exact: true }).waitFor();
        await axe(page);
        const opened = context.waitForEvent("page");
        await tile(page, "line 2").getByRole("link").click();
        const other = await opened;
        await other.waitForURL((url) => url.href.startsWith(hall.second.address));
        assert.equal(await other.evaluate(() => window.opener), null);
        await other.close();
        await hall.alone.sim("plug", "drive");
        await page.getByText("3 machines, none needs somebody").waitFor();
        await hall.alone.end("SIGKILL");
        await lost.getByText("offline", { exact: true }).waitFor();
        await hall.broker.end();
        await page.getByText(/^Not connected: /).waitFor();
        await tile(page, "line 1").getByRole("button").click();
        await page.locator(".rows tr", { hasText: "gate" }).waitFor();
        assert.deepEqual(errors, []);
      } finally {
        await context.close();
        await hall.close();
      }
    },
  );
}

async function manyMachines(check) {
  for (const [count, dark] of [
    [1, false],
    [3, true],
    [100, false],
    [100, true],
  ]) {
    const hash = "&pane=fleet";
    const name = `axe: ${count} machines of a fleet, ${dark ? "dark" : "light"}`;
    await check(name, { mock: { fleet: count }, hash, view: { dark } }, async (page) => {
      await page.locator(".tile").first().waitFor();
      assert.equal(await page.getByLabel("Search machines").count(), count > 12 ? 1 : 0);
      await axe(page);
    });
  }
  await check(
    "of a thousand machines only those in sight are drawn, and one is found by a word or by the keyboard",
    { mock: { fleet: 1000 }, hash: "&pane=fleet" },
    async (page) => {
      await page.getByText(/^\d+ of 1000 machines need somebody$/).waitFor();
      assert.ok((await page.locator(".tile").count()) < 60);
      const focused = () => page.evaluate(() => Number(document.activeElement.dataset.at));
      await page.locator("[data-at]").first().focus();
      await page.keyboard.press("ArrowRight");
      await page.waitForFunction(() => document.activeElement.dataset.at === "1");
      await page.keyboard.press("ArrowDown");
      await page.waitForFunction(() => Number(document.activeElement.dataset.at) > 1);
      const step = (await focused()) - 1;
      for (let row = 2; row < 40; row++) {
        await page.keyboard.press("ArrowDown");
        await page.waitForFunction((at) => document.activeElement.dataset.at === String(at), 1 + row * step);
      }
      assert.ok(await page.locator(":focus").isVisible());
      await page.getByLabel("Search machines").fill("line 777");
      await page.getByText("1 shown").waitFor();
      assert.equal(await page.locator(".tile").count(), 1);
      const link = tile(page, "line 777").getByRole("link");
      assert.equal(await link.getAttribute("href"), "https://line-777.hall-2.plant:8302/");
      assert.equal(await link.getAttribute("rel"), "noopener noreferrer");
      await page.getByLabel("Search machines").fill("no such machine");
      await page.getByText("0 shown").waitFor();
    },
  );
}
