/**
 * A picture of each pane of a real Berth on the simulator, light and dark, 1280x800 and a tablet:
 *   node browser/screenshots.mjs [--docs] [NAME] -> screenshots/   (build/test/berth or $BERTH_BINARY)
 * --docs: also those that docs/ shows, into docs/studio/.
 */
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { operational, root, startBerth } from "./berth.mjs";
import { launch, openPage } from "./open.mjs";
import { smaller } from "./png.mjs";

const sizes = [
  { width: 1280, height: 800 },
  { width: 768, height: 1024, touch: true },
];
const words = process.argv.slice(2);
const forDocs = words[0] === "--docs";
const wanted = words[forDocs ? 1 : 0];
/** What docs/studio.md and README.md show: at 1280x800. */
const shown = {
  machine: "light",
  replace: "dark",
  trace: "light",
  dictionary: "dark",
  world: "light",
  folded: "dark",
  plots: "light",
  doctor: "light",
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
    act: async (page) => {
      const read = page.locator(".frame.transfer", { hasText: "2 frames" });
      await read.nth(2).waitFor();
      await read.nth(1).click();
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
  world: { hash: "pane=world&slot=field/12", act: (page) => button(page, "Unplug").waitFor() },
  palette: {
    hash: "pane=machine",
    act: async (page) => {
      await page.keyboard.press("Control+k");
      await page.keyboard.type("drive");
    },
  },
};

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
if (!wanted || wanted === "discovery") {
  const { page, context } = await openPage(browser, `${berth.url}&pane=machine`);
  await page.locator('.slot-box[aria-label*="configuring"]').first().waitFor();
  await picture(page, "discovery", sizes[0], false);
  await context.close();
}
await operational(berth);
// One that needs somebody, and an SDO that was aborted.
await berth.request("sdo read", { node: "unloader drive", object: "1A7Fh:02" });
await berth.request("sim", { action: "unplug", device: "main drive" });
await operational(berth, ["main drive"], true);
for (const [name, shot] of Object.entries(shots)) {
  if (wanted && wanted !== name) continue;
  for (const size of sizes) {
    for (const dark of [false, true]) {
      const { page, errors, context } = await openPage(browser, `${berth.url}&${shot.hash}`, { ...size, dark });
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
await berth.close();
