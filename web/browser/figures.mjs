/**
 * What Studio costs in a browser, against a real Berth (build/bench, or $BERTH_BINARY and $BENCH_STUDIO):
 *   node browser/figures.mjs
 * `./run bench studio` calls it behind the server's own figures.
 */
import { spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { operational, root, startBerth } from "./berth.mjs";
import { drawnIn } from "./drawn.mjs";
import { launch, openPage } from "./open.mjs";
import { actsOn, machines, tasks } from "./tasks.mjs";

const bench = process.env.BENCH_STUDIO ?? join(root, "build/bench/bench/bench_studio");
const ROUNDS = 5;
const OBJECTS = 5000;
const browser = await launch();
let missed = 0;

function tell(name, measured, aim = "", met = true) {
  if (!met) missed++;
  console.log(`${name.padEnd(62)} ${measured.padEnd(34)} ${aim}${met ? "" : "  NO"}`);
}

const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

/** From the request for the page to its first drawn content, and to a drawing of the machine; nothing is cached. */
async function firstPaint() {
  const berth = await startBerth("examples/conveyor/machine.toml", "examples/conveyor/plant.toml");
  await operational(berth);
  const paints = [];
  const drawings = [];
  for (let round = 0; round < ROUNDS; round++) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
    const page = await context.newPage();
    await page.goto(berth.url, { waitUntil: "commit" });
    await page.waitForSelector(".machine svg");
    const times = await page.evaluate(() => ({
      paint: performance.getEntriesByName("first-contentful-paint")[0]?.startTime,
      drawing: performance.now(),
    }));
    paints.push(times.paint ?? times.drawing);
    drawings.push(times.drawing);
    await context.close();
  }
  await berth.close();
  const paint = median(paints);
  tell("conveyor on loopback: first paint, median of 5", `${paint.toFixed(0)} ms`, "at most 1000 ms", paint < 1000);
  tell("conveyor on loopback: the machine is drawn, median of 5", `${median(drawings).toFixed(0)} ms`);
}

/** bench_studio's server, told of 32,000 frames a second for so long. */
async function load(seconds) {
  const child = spawn(bench, ["--serve", String(seconds)], { stdio: ["ignore", "pipe", "inherit"] });
  let said = "";
  const ended = new Promise((resolve) => child.on("exit", resolve));
  const url = await new Promise((resolve, reject) => {
    child.on("error", reject);
    child.on("exit", () => reject(new Error(`${bench} ended: ${said}`)));
    child.stdout.on("data", (data) => {
      said += data;
      if (said.includes("\n")) resolve(said.split("\n")[0]);
    });
  });
  const after = async () => (await ended, said.trim().split("\n").slice(1));
  return { url, after, stop: () => child.kill() };
}

async function drawnAtLoad() {
  const SECONDS = 5;
  for (const mode of ["chronological", "latest", "chronological&filter=heartbeat"]) {
    const server = await load(120);
    const { page, context, errors } = await openPage(browser, `${server.url}&pane=trace&mode=${mode}`);
    await page.waitForTimeout(2000);
    const { drawn, p99 } = await page.evaluate(drawnIn, SECONDS);
    const name = `4 buses at 8,000 frames/s, trace ${mode.replace("&", ", ")}: drawn`;
    const text = `${drawn.toFixed(1)} a second, 99 % within ${p99.toFixed(0)} ms`;
    tell(name, text, "at least 50", drawn >= 50);
    if (errors.length) tell(`${name}: errors of the page`, errors.join("; "), "none", false);
    await context.close();
    server.stop();
  }
}

async function busBeside(browsers) {
  const server = await load(10 + 8 * browsers);
  const pages = [];
  for (let i = 0; i < browsers; i++) pages.push(await openPage(browser, `${server.url}&pane=trace`));
  for (const line of await server.after()) {
    const [what, figure] = line.split(": ");
    tell(`${browsers} browsers: ${what}`, figure);
  }
  for (const { context } of pages) await context.close();
}

function bigMachine(folder) {
  const sensor = readFileSync(join(root, "examples/eds/sensor.eds"), "utf8");
  const numbers = Array.from({ length: OBJECTS }, (_, i) => (0x2000 + i).toString(16).toUpperCase());
  const list = numbers.map((number, i) => `${i + 1}=0x${number}`).join("\n");
  const objects = numbers.map(
    (number, i) =>
      `[${number}]\nParameterName=Limit ${i}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=${i}\nPDOMapping=0\n`,
  );
  const text = sensor.replace(/\[ManufacturerObjects\][\s\S]*$/, "");
  writeFileSync(
    join(folder, "big.eds"),
    `${text}\n[ManufacturerObjects]\nSupportedObjects=${OBJECTS}\n${list}\n\n${objects.join("\n")}`,
  );
  writeFileSync(
    join(folder, "machine.toml"),
    '[machine]\nname = "big"\n[bus.field]\nport = "sim"\nbitrate = 1_000_000\nmaster_id = 127\n' +
      '[[slot]]\nbus = "field"\nid = 1\nname = "big"\neds = "big.eds"\n',
  );
  writeFileSync(
    join(folder, "plant.toml"),
    '[plant]\nseed = 1\n[bus.field]\n[[device]]\nbus = "field"\nname = "big"\neds = "big.eds"\nserial = 1\n' +
      'response = "0.1 ms"\n',
  );
}

/** From the text in the field to the list of what was found. */
async function searched() {
  const folder = mkdtempSync(join(tmpdir(), "berth-figures-"));
  bigMachine(folder);
  const berth = await startBerth(join(folder, "machine.toml"), join(folder, "plant.toml"));
  await operational(berth);
  const { page, context } = await openPage(browser, `${berth.url}&pane=dictionary&slot=field/1`);
  const before = Date.now();
  await page.getByRole("button", { name: "Read all objects" }).click();
  await page.waitForFunction(
    (most) => Number(/of (\d+)/.exec(document.querySelector(".bar .number")?.textContent ?? "")?.[1]) > most,
    OBJECTS,
    { timeout: 300_000 },
  );
  tell(`${OBJECTS} objects read by SDO at 1000 kbit/s and listed`, `${((Date.now() - before) / 1000).toFixed(1)} s`);
  const times = await page.evaluate(async () => {
    const field = document.querySelector("[aria-label='Search objects']");
    const set = Object.getOwnPropertyDescriptor(window.HTMLInputElement.prototype, "value").set;
    const times = [];
    for (const text of ["limit 4", "limit 49", "limit 499", "2abc", "", "4711", "no such words", ""]) {
      await new Promise(requestAnimationFrame);
      const began = performance.now();
      set.call(field, text);
      field.dispatchEvent(new window.Event("input", { bubbles: true }));
      times.push(performance.now() - began);
    }
    return times;
  });
  const longest = Math.max(...times);
  tell(`${OBJECTS} objects searched as one types, longest`, `${longest.toFixed(1)} ms`, "at most 50 ms", longest < 50);
  await context.close();
  await berth.close();
  rmSync(folder, { recursive: true, force: true });
}

/** The brief's tasks: acts.mjs asserts their acts, here are their seconds. */
async function tasksTimed() {
  for (const task of tasks) {
    const { machine = "conveyor", ready, hash = "", view = {} } = task.where;
    const berth = await startBerth(...machines[machine]);
    await operational(berth, ready);
    const { page, context } = await openPage(browser, berth.url + hash, view);
    await page.waitForSelector(".tabs");
    const by = actsOn(page);
    const { seconds } = await task.act(page, berth, by);
    const met = by.count() <= task.acts && (!task.limit || seconds <= task.limit);
    tell(
      `task: ${task.name}`,
      `${by.count()} acts, ${seconds.toFixed(1)} s`,
      `at most ${task.acts} acts${task.limit ? `, ${task.limit} s` : ""}`,
      met,
    );
    await context.close();
    await berth.close();
  }
}

await tasksTimed();
await firstPaint();
await searched();
await drawnAtLoad();
for (const browsers of [0, 1, 10]) await busBeside(browsers);
await browser.close();
if (missed) console.log(`${missed} aims are missed`);
