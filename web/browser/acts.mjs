/** Each pane's act in Chromium against the mock server, and axe over every pane: node browser/acts.mjs */
import assert from "node:assert/strict";
import { AxeBuilder } from "@axe-core/playwright";
import { startMock } from "../mock/server.mjs";
import { launch, openPage } from "./open.mjs";

const browser = await launch();
let failures = 0;

async function check(name, options, run) {
  const { page: view = {}, hash = "", ...mockOptions } = options;
  const mock = await startMock({ example: "conveyor", done: true, ...mockOptions });
  const { page, errors, context } = await openPage(browser, mock.url + hash, view);
  page.setDefaultTimeout(8000);
  try {
    await page.waitForSelector(".tabs");
    await run(page, mock);
    assert.deepEqual(errors, []);
    console.log(`ok    ${name}`);
  } catch (error) {
    failures++;
    console.log(`FAIL  ${name}: ${String(error.message).slice(0, 600)}`);
  }
  await context.close();
  await mock.close();
}

const tablet = { width: 768, height: 1024, touch: true };

await check("the fitter replaces a device in three taps", { hash: "&pane=slots", page: tablet }, async (page) => {
  await page.locator(".rows tr", { hasText: "reclaimer drive" }).tap();
  await page.getByRole("button", { name: "Replace", exact: true }).first().tap();
  await page.locator(".steps li.done", { hasText: "It runs" }).waitFor();
});

await check("the events lead to who needs somebody", {}, async (page) => {
  await page.getByRole("button", { name: /need somebody/ }).click();
  await page.locator(".need-box").waitFor();
  assert.match(page.url(), /pane=slots&slot=field/);
});

await check("a question is answered", { hash: "&pane=slots" }, async (page) => {
  await page.locator(".rows tr", { hasText: "main belt" }).click();
  await page.getByRole("button", { name: "This one is main belt" }).nth(1).click();
  await page.locator(".inspector .state-word", { hasText: "operational" }).waitFor();
});

await check("an object is found, written and read back", { hash: "&pane=dictionary&slot=field/3" }, async (page) => {
  await page.getByRole("button", { name: "Read all objects" }).click();
  await page.getByLabel("Search objects").fill("1017");
  await page.locator(".object", { hasText: "1017h:00" }).click();
  await page.getByLabel("New value").fill("700");
  await page.getByRole("button", { name: "Write", exact: true }).click();
  await page.locator(".object", { hasText: "700" }).waitFor();
});

await check("a frame is found while the bus runs, and its bits are shown", { hash: "&pane=trace" }, async (page) => {
  await page.getByLabel("Filter frames").fill("heartbeat");
  await page.locator(".scroll .frame").first().waitFor();
  await page.getByRole("button", { name: /Pause/ }).click();
  await page.locator(".scroll .frame").last().click();
  await page.locator(".bits .field", { hasText: "CRC" }).first().waitFor();
  assert.match(await page.locator(".bar .number").innerText(), /in the whole ring/);
  assert.match(page.url(), /filter=heartbeat/);
});

await check("pause loses nothing", { hash: "&pane=trace" }, async (page, mock) => {
  await page.locator(".scroll .frame").first().waitFor();
  await page.keyboard.press("p");
  await page.waitForTimeout(700);
  assert.match(await page.locator(".bar .number").innerText(), / new/);
  await page.keyboard.press("p");
  await page.waitForTimeout(400);
  const [kept] = /[\d,]+/.exec(await page.locator(".bar .number").innerText()) ?? [];
  assert.ok(Number(kept?.replace(/,/g, "")) >= 1000, kept);
  assert.ok(mock.machine.next > 0);
});

await check("blank devices become a machine", { hash: "&pane=machine", done: false, example: "belt" }, async (page) => {
  await page.locator('.slot-box[aria-label*="operational"]').nth(1).waitFor();
});

await check("a plug is pulled in the world", { hash: "&pane=world&slot=field/12" }, async (page) => {
  await page.getByRole("button", { name: "Unplug", exact: true }).click();
  await page.locator(".inspector .need-box").waitFor();
});

await check("a service is asked by its form", { hash: "&pane=network&slot=field/12" }, async (page) => {
  await page.locator(".tools").getByRole("button", { name: "nmt", exact: true }).click();
  await page.getByLabel("command", { exact: false }).first().selectOption("preop");
  await page.getByRole("button", { name: "Do: nmt" }).click();
  await page.locator(".answer.good").waitFor();
});

await check("a gap and a lost connection end in a new snapshot", { hash: "&pane=slots" }, async (page, mock) => {
  mock.makeGap();
  mock.machine.set("desk", "absent");
  await page.locator(".rows tr", { hasText: "desk" }).locator("text=absent").first().waitFor();
  mock.dropClients();
  mock.machine.set("bunker", "failed");
  await page.locator(".rows tr.needs", { hasText: "bunker" }).first().waitFor();
});

await check(
  "real buses are read-only until they are unlocked",
  { hash: "&pane=slots&slot=field/3", real: true },
  async (page) => {
    const replace = page.getByRole("button", { name: "Replace", exact: true });
    assert.ok(await replace.isDisabled());
    await page.getByRole("button", { name: /Unlock/ }).click();
    await replace.click();
    await page.getByRole("button", { name: "Send it" }).click();
    await page.locator(".answer").waitFor();
    assert.equal(await page.getByRole("tab", { name: "World" }).count(), 0);
  },
);

await check("the palette finds a slot by the keyboard", {}, async (page) => {
  await page.keyboard.press("Control+k");
  await page.keyboard.type("quay belt");
  await page.keyboard.press("Enter");
  await page.locator(".inspector h2", { hasText: "quay belt" }).waitFor();
});

await check("a name that is HTML stays text", { odd: true, hash: "&pane=slots&slot=field/2" }, async (page) => {
  await page.locator(".inspector h2", { hasText: "<b>quay</b>\\x07" }).waitFor();
  assert.equal(await page.locator(".inspector h2 b").count(), 0);
});

const panes = ["machine", "slots", "dictionary", "network", "trace", "world"];
for (const dark of [false, true]) {
  for (const pane of panes) {
    const hash = `&pane=${pane}&slot=field/32`;
    await check(`axe: ${pane}, ${dark ? "dark" : "light"}`, { hash, page: { dark } }, async (page) => {
      await page.waitForTimeout(700);
      const { violations } = await new AxeBuilder({ page }).analyze();
      const words = violations.map((v) => `${v.id} (${v.nodes.length}): ${v.nodes[0]?.html.slice(0, 160)}`);
      assert.deepEqual(words, []);
    });
  }
}
await browser.close();
process.exitCode = failures ? 1 : 0;
