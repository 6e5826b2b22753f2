/**
 * A picture of each pane of a real Berth on the simulator, light and dark, 1280x800 and a tablet:
 *   node browser/screenshots.mjs [--docs] [NAME...] -> screenshots/   (build/test/berth or $BERTH_BINARY)
 * --docs: also those that docs/ shows, into docs/studio/.
 */
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { operational, root, startBerth } from "./berth.mjs";
import { startHall } from "./fleet.mjs";
import { launch, openPage } from "./open.mjs";
import { smaller } from "./png.mjs";
import { machines } from "./tasks.mjs";

const sizes = [
  { width: 1280, height: 800 },
  { width: 768, height: 1024, touch: true },
];
const words = process.argv.slice(2);
const forDocs = words[0] === "--docs";
const wanted = words.slice(forDocs ? 1 : 0);
/** What docs/studio.md and README.md show: at 1280x800. */
const shown = {
  machine: "light",
  replace: "dark",
  trace: "light",
  dictionary: "dark",
  world: "light",
  first_save: "light",
  folded: "dark",
  plots: "light",
  doctor: "light",
  fleet: "light",
};

const button = (page, name) => page.getByRole("button", { name, exact: true });
const shots = {
  machine: { hash: "pane=machine", act: (page) => page.locator(".load-plot").waitFor() },
  slots: { hash: "pane=slots&slot=field/28", act: (page) => page.locator(".inspector h2").first().waitFor() },
  replace: {
    hash: "pane=slots",
    act: async (page) => {
      await page.locator(".rows tr.needs").first().click();
      await page.locator(".need-box").waitFor();
    },
  },
  trace: {
    hash: "pane=trace&filter=abort",
    act: async (page) => {
      await page.locator(".bar .number", { hasText: "in the whole ring" }).waitFor();
      await page.locator(".pane .scroll .frame").last().click();
      await page.locator(".bits .field").first().waitFor();
    },
  },
  folded: {
    hash: "pane=trace&mode=folded&filter=node+12+read&marks=40,90&zero=40",
    // Those of the start are no longer among what a page begins with.
    before: async (of) => {
      for (const object of ["1018h:01", "1018h:02", "1008h:00", "1018h:04"]) {
        await of.request("sdo read", { node: "unloader drive", object });
      }
    },
    act: async (page) => {
      const read = page.locator(".frame.transfer", { hasText: "2 frames" });
      await read.nth(2).waitFor();
      await button(page, "▮▮ Pause").click();
      // Not one that the edge cuts: scrolled into view it would move from under the press.
      await read.nth((await read.count()) - 2).click();
      await page.locator(".frame.child").first().waitFor();
      await page.locator(".marks .quiet", { hasText: "+" }).first().waitFor();
    },
  },
  plots: {
    hash: "pane=plots&slot=field/12&watch=field/12+1001h:00&watch=field/13+1017h:00&watch=field/14+1017h:00",
    act: async (page) => {
      await page.locator(".watch td.number", { hasText: /\d/ }).nth(2).waitFor();
      await page.locator(".plots p", { hasText: "intervals" }).waitFor();
      await page.waitForTimeout(6000);
    },
  },
  latest: {
    hash: "pane=trace&mode=latest&slot=field/7",
    act: (page) => page.locator(".frame.latest").nth(20).waitFor(),
  },
  dictionary: {
    hash: "pane=dictionary&slot=field/12",
    act: async (page) => {
      await button(page, "Read all objects").click();
      await page.locator(".object", { hasText: "1017h" }).waitFor();
      await page.getByLabel("Search objects").fill("heartbeat");
      await page.locator(".object", { hasText: "1017h" }).click();
      await page.getByLabel("New value").fill("600");
    },
  },
  network: {
    hash: "pane=network&slot=field/12",
    act: async (page) => {
      await page.locator(".tools").getByRole("button", { name: "scan", exact: true }).click();
      await button(page, "Do: scan").click();
      await page.locator(".answer.good").waitFor();
    },
  },
  backup: {
    hash: "pane=network&slot=field/12",
    act: async (page) => {
      await page.locator(".tools").getByRole("button", { name: "backup and restore", exact: true }).click();
      const coming = page.waitForEvent("download");
      await button(page, "Back up unloader drive").click();
      const file = await coming;
      await page.locator("input[type=file]").setInputFiles({
        name: file.suggestedFilename(),
        mimeType: "text/plain",
        buffer: readFileSync(await file.path()),
      });
      await button(page, "Compare with unloader drive").click();
      await page.locator(".answer.good", { hasText: "as the DCF has it" }).waitFor();
    },
  },
  boot: { hash: "pane=network", act: (page) => page.locator(".boot-log section").first().waitFor() },
  doctor: {
    hash: "pane=doctor&slot=field/12",
    act: async (page) => {
      await button(page, "Run the doctor").click();
      await page.locator(".finding.certain").first().waitFor();
    },
  },
  world: { hash: "pane=world&slot=field/12", act: (page) => button(page, "Cut its wire").waitFor() },
  fleet: {
    hash: "pane=fleet",
    machine: "hall",
    act: async (page) => {
      await page.getByText("1 of 3 machines needs somebody").waitFor();
      await page.locator(".tile button", { hasText: "line 3" }).click();
      await page.getByRole("region", { name: "Slots of line 3" }).waitFor();
    },
  },
  cut: {
    hash: "pane=machine",
    machine: "belt",
    act: async (page) => {
      await page.locator(".wires .line-hit rect, .wires .cut-mark rect").first().waitFor({ state: "attached" });
      if (!(await page.locator(".wires .cut-mark").count())) await page.locator(".line-hit rect").first().click();
      await page.locator(".wires .cut-mark").first().waitFor();
      await page.locator('.slot-box[aria-label*="absent"]').nth(1).waitFor();
    },
  },
  stray: {
    hash: "pane=machine&device=field/00000001-00000003-00000000-00000031",
    machine: "stray",
    act: async (page) => {
      await page.locator(".drawing .stray").waitFor();
      await page.locator('.slot-box[aria-label*="operational"]').waitFor();
      await page.locator('.slot-box[aria-label*="empty"]').waitFor();
    },
  },
  first_save: {
    hash: "pane=slots&slot=field/1",
    machine: "unsaved",
    act: (page) => button(page, "Save its parameters").waitFor(),
  },
  role: {
    hash: "pane=slots&slot=field/12",
    role: "view",
    act: (page) => page.getByText("This needs the role operate. Yours is view.").first().waitFor(),
  },
  help: {
    hash: "pane=machine",
    act: async (page) => {
      await button(page, "Help").click();
      await page.getByRole("dialog", { name: "Help" }).waitFor();
    },
  },
  palette: {
    hash: "pane=machine",
    act: async (page) => {
      await page.keyboard.press("Control+k");
      await page.keyboard.type("drive");
    },
  },
};

/** Beside the conveyor, which most pictures are of. */
const others = new Map();
async function berthOf(machine) {
  if (!machine) return berth;
  if (machine === "hall") return hallsFirst();
  if (!others.has(machine)) others.set(machine, await startBerth(...machines[machine]));
  const other = others.get(machine);
  if (machine === "belt" && !other.wasUp) await operational(other);
  other.wasUp = true;
  return other;
}

/** Of three machines at a broker, one of which lost a drive; null: no broker is installed. */
async function hallsFirst() {
  if (!others.has("hall")) {
    const hall = await startHall();
    if (hall) await hall.loseDrive();
    others.set("hall", hall ?? { close() {} });
  }
  return others.get("hall").first ?? null;
}

/** The page of a role has another token. */
async function addressOf(of, role) {
  if (!role) return of.url;
  const { token_file } = await of.snapshot();
  return `${of.address}#token=${readFileSync(`${token_file}.${role}`, "utf8").trim()}`;
}

async function picture(page, name, size, dark) {
  const file = `screenshots/${name}-${size.width}-${dark ? "dark" : "light"}.png`;
  const png = smaller(await page.screenshot());
  writeFileSync(file, png);
  console.log(file, png.length);
  if (!forDocs || size.width !== 1280 || shown[name] !== (dark ? "dark" : "light")) return;
  mkdirSync(join(root, "docs/studio"), { recursive: true });
  writeFileSync(join(root, `docs/studio/${name}.png`), png);
}

mkdirSync("screenshots", { recursive: true });
const browser = await launch();
const berth = await startBerth("examples/conveyor/machine.toml", "examples/conveyor/plant.toml");
if (!wanted.length || wanted.includes("discovery")) {
  // The world stands for it, however long the page takes to open.
  while (!(await berth.snapshot()).slots.some((slot) => slot.state === "configuring"));
  await berth.request("world pause");
  const { page, context } = await openPage(browser, `${berth.url}&pane=machine`);
  await page.locator('.slot-box[aria-label*="configuring"]').first().waitFor();
  await picture(page, "discovery", sizes[0], false);
  await context.close();
  await berth.request("world run");
}
await operational(berth);
// One that needs somebody, and an SDO that was aborted.
await berth.request("sdo read", { node: "unloader drive", object: "1A7Fh:02" });
await berth.request("sim", { action: "unplug", device: "main drive" });
await operational(berth, ["main drive"], true);
for (const [name, shot] of Object.entries(shots)) {
  if (wanted.length && !wanted.includes(name)) continue;
  for (const size of sizes) {
    for (const dark of [false, true]) {
      const of = await berthOf(shot.machine);
      if (!of) {
        console.log(`${name}: left out, mosquitto is not installed`);
        continue;
      }
      await shot.before?.(of);
      const { page, errors, context } = await openPage(browser, `${await addressOf(of, shot.role)}&${shot.hash}`, {
        ...size,
        dark,
      });
      page.setDefaultTimeout(30_000);
      await page.waitForSelector(".tabs");
      await shot.act(page);
      await picture(page, name, size, dark);
      if (errors.length) throw new Error(`${name}: ${errors.join("; ")}`);
      await context.close();
    }
  }
}
await browser.close();
for (const each of [berth, ...others.values()]) await each.close();
