/** A picture of each pane: node browser/screenshots.mjs [name] -> screenshots/ (needs `npm run build`). */
import { mkdirSync } from "node:fs";
import { startMock } from "../mock/server.mjs";
import { launch, openPage } from "./open.mjs";

const sizes = [
  { width: 1280, height: 800 },
  { width: 1024, height: 768 },
  { width: 768, height: 1024, touch: true },
];
const wanted = process.argv[2];

async function seconds(page, s) {
  await page.waitForTimeout(s * 1000);
}

const shots = {
  machine: { hash: "pane=machine", act: (page) => seconds(page, 1.5) },
  slots: { hash: "pane=slots&slot=field/28", act: (page) => page.locator(".rows tr.needs").first().click() },
  question: {
    hash: "pane=slots",
    act: (page) => page.locator(".rows tr.needs", { hasText: "question" }).first().click(),
  },
  trace: {
    hash: "pane=trace",
    act: async (page) => {
      await seconds(page, 1.5);
      await page.locator(".pane .scroll .frame").nth(8).click();
    },
  },
  latest: { hash: "pane=trace&mode=latest&slot=field/7", act: (page) => seconds(page, 1.5) },
  dictionary: {
    hash: "pane=dictionary&slot=field/3",
    act: async (page) => {
      await page.getByRole("button", { name: "Read all objects" }).click();
      await page.getByLabel("Search objects").fill("time");
      await page.locator(".object", { hasText: "1017h" }).click();
      await page.getByLabel("New value").fill("600");
    },
  },
  network: {
    hash: "pane=network&slot=field/12",
    act: async (page) => {
      await page.locator(".tools").getByRole("button", { name: "scan", exact: true }).click();
      await page.getByRole("button", { name: "Do: scan" }).click();
      await seconds(page, 0.3);
    },
  },
  boot: { hash: "pane=network", act: () => undefined },
  world: { hash: "pane=world&slot=field/12", act: () => undefined },
  palette: { hash: "pane=machine", act: (page) => page.keyboard.press("Control+k") },
};

mkdirSync("screenshots", { recursive: true });
const browser = await launch();
const mock = await startMock({ example: "conveyor", done: true, odd: true });
for (const [name, shot] of Object.entries(shots)) {
  if (wanted && wanted !== name) continue;
  for (const size of sizes) {
    for (const dark of [false, true]) {
      const { page, errors, context } = await openPage(browser, `${mock.url}&${shot.hash}`, { ...size, dark });
      await page.waitForSelector(".tabs");
      await page.waitForFunction(() => document.querySelectorAll(".event").length > 0 || window.innerWidth < 900);
      await shot.act(page);
      await seconds(page, 0.2);
      const file = `screenshots/${name}-${size.width}-${dark ? "dark" : "light"}.png`;
      await page.screenshot({ path: file });
      console.log(file, errors.length ? errors : "");
      await context.close();
    }
  }
}
await mock.close();

if (!wanted || wanted === "discovery") {
  const blank = await startMock({ example: "conveyor", rate: 2000 });
  for (const dark of [false, true]) {
    const { page, context } = await openPage(browser, `${blank.url}&pane=machine`, { dark });
    await seconds(page, 1);
    const wait = dark ? 1.2 : 0.3;
    await seconds(page, wait);
    await page.screenshot({ path: `screenshots/discovery-1280-${dark ? "dark" : "light"}.png` });
    await context.close();
  }
  await blank.close();
}
await browser.close();
