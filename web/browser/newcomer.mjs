/** Acts about what a newcomer did not find: help, devices without a slot, answers that are overtaken, "Find or do". */
import assert from "node:assert/strict";
import { AxeBuilder } from "@axe-core/playwright";
import { operational } from "./berth.mjs";
import { openPage } from "./open.mjs";

const tablet = { width: 768, height: 1024, touch: true };

async function axe(page) {
  const { violations } = await new AxeBuilder({ page }).analyze();
  assert.deepEqual(
    violations.map((v) => `${v.id} (${v.nodes.length}): ${v.nodes[0]?.html.slice(0, 160)}`),
    [],
  );
}

/** Waits until Berth has told this of the machine. */
async function told(berth, text) {
  for (let look = 0; look < 300; look++) {
    const { events } = await berth.snapshot();
    if (events.some((event) => event.text.includes(text))) return;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  throw new Error(`nobody told: ${text}`);
}

/** `check` of acts.mjs runs each. */
export async function newcomerActs(check, browser) {
  await answers(check);
  await strays(check, browser);
  await help(check);
  await palette(check);
  await paletteAtOnce(check);
  await views(check);
}

async function answers(check) {
  await check(
    "a replacement that was answered too early is not told as refused once the slot runs",
    { machine: "twins", fresh: true, ready: ["left", "right"], hash: "&pane=slots&slot=field/3" },
    async (page, berth, by) => {
      await berth.request("sim", { action: "unplug", device: "old gate" });
      await by.row("gate").locator("text=absent").waitFor();
      await by.button("Replace").first().click();
      await page.locator(".steps li.now", { hasText: "plug in the spare" }).waitFor();
      // The verb waits 13 s of bus time, and says that nobody came.
      await berth.request("world speed", { factor: "10" });
      await told(berth, "studio: replace bus=field slot=gate: no");
      await berth.request("world speed", { factor: "1" });
      await berth.request("sim", { action: "plug", device: "spare gate" });
      await page.locator(".steps li.done", { hasText: "It runs" }).waitFor();
      assert.equal(await page.locator(".inspector .answer.bad").count(), 0);
      await page.locator(".inspector .answer.past", { hasText: "gate has become operational since" }).waitFor();
      assert.equal(await page.locator(".inspector pre").isVisible(), false);
    },
  );

  await check(
    "what was refused while a device was away says that it has come back",
    { machine: "belt", fresh: true, hash: "&pane=slots&slot=field/11" },
    async (page, berth, by) => {
      await berth.request("sim", { action: "unplug", device: "light barrier" });
      await by.row("barrier").locator("text=absent").waitFor();
      await page.locator(".acts summary").click();
      await by.button("Save as DCF").click();
      await page.locator(".inspector .answer.bad", { hasText: "upload" }).waitFor();
      await berth.request("sim", { action: "plug", device: "light barrier" });
      await operational(berth);
      await page.locator(".inspector .answer.past", { hasText: "barrier has become operational since" }).waitFor();
      assert.equal(await page.locator(".inspector .answer.bad").count(), 0);
    },
  );

  await check(
    "the answer about one object is not shown beneath another",
    { machine: "belt", hash: "&pane=dictionary&slot=field/10&object=1A7Fh:02" },
    async (page, berth, by) => {
      await by.button("Read", { exact: true }).first().click();
      await page.locator(".inspector .answer.bad", { hasText: "1A7Fh:02" }).waitFor();
      await page.evaluate(() => (window.location.hash = "#pane=dictionary&slot=field/10&object=1017h:00"));
      await page.locator(".inspector h2", { hasText: "1017h:00" }).waitFor();
      assert.equal(await page.locator(".inspector .answer.bad").count(), 0);
    },
  );
}

async function strays(check, browser) {
  await check(
    "a device that no slot takes has a name, is chosen by press and keyboard, and says what to do",
    { machine: "stray", fresh: true, ready: ["gate"], hash: "&pane=machine" },
    async (page, berth, by) => {
      const box = page.getByRole("button", { name: /^1h \/ 3h, serial number 31h, without a slot/ });
      const inDrawing = box.and(page.locator(".drawing *"));
      await inDrawing.waitFor();
      assert.match(await page.locator(".drawing .stray").textContent(), /1h \/ 3h/);
      await inDrawing.click();
      const inspector = page.locator(".inspector");
      await inspector.locator("h2", { hasText: "1h / 3h" }).waitFor();
      await inspector.getByText("is of a type that this machine has no slot for").waitFor();
      await inspector.getByText("also = [{ vendor = 0x00000001, product = 0x00000003").first().waitFor();
      assert.match(page.url(), /device=field%2F00000001-00000003-00000000-00000031/);
      await page.keyboard.press("Escape");
      assert.equal(await inspector.locator("h2").count(), 0);
      await inDrawing.focus();
      await page.keyboard.press("Enter");
      await inspector.locator("h2", { hasText: "1h / 3h" }).waitFor();
      // Somebody is needed for the gate, and for the device.
      await page.getByRole("button", { name: "2 need somebody" }).click();
      await inspector.locator("h2", { hasText: /^gate$/ }).waitFor();
      await inspector.getByText("Plug in a device of the slot's type, 1h / 2h.").waitFor();
      await inspector.getByRole("button", { name: /^1h \/ 3h/ }).click();
      await inspector.getByText("is of a type that this machine has no slot for").waitFor();
      await by.tab("Slots").click();
      await page
        .locator(".tree")
        .getByRole("button", { name: /^1h \/ 3h/ })
        .waitFor();
      await by.slot("drive").click();
      await inspector.locator("h2", { hasText: "drive" }).waitFor();
      assert.doesNotMatch(page.url(), /device=/);
    },
  );

  await check(
    "a second device of a type says whose place it can take, takes it, and one that is unplugged goes",
    { machine: "stray", fresh: true, ready: ["gate"], hash: "&pane=slots" },
    async (page, berth, by) => {
      await berth.request("sim", { action: "plug", device: "second drive" });
      const second = page.locator(".tree").getByRole("button", { name: /^1h \/ 1h, serial number 12h/ });
      await second.click();
      const inspector = page.locator(".inspector");
      await inspector.getByText("is of the type of drive, and that has its device").waitFor();
      await berth.request("sim", { action: "unplug", device: "second drive" });
      await second.waitFor({ state: "detached" });
      await inspector.getByText("not on the bus any more").waitFor();
      await berth.request("sim", { action: "plug", device: "second drive" });
      await second.waitFor();
      await berth.request("sim", { action: "unplug", device: "first drive" });
      await by.row("drive").locator("text=absent").waitFor();
      await by.button("Take it for drive").click();
      await by.row("drive").locator("text=operational").waitFor();
      const { slots } = await berth.snapshot();
      assert.equal(slots.find((slot) => slot.name === "drive").r_sn, "0x0000000000000012");
      await second.waitFor({ state: "detached" });
    },
  );

  await check(
    "axe: a device without a slot",
    {
      machine: "stray",
      fresh: true,
      ready: ["gate"],
      hash: "&pane=machine&device=field/00000001-00000003-00000000-00000031",
    },
    async (page, berth) => {
      for (const view of [{}, { dark: true }, tablet]) {
        const other = await openPage(browser, `${berth.url}&${new URL(page.url()).hash.slice(1)}`, view);
        await other.page.locator(".inspector h2", { hasText: "1h / 3h" }).waitFor();
        await axe(other.page);
        await other.context.close();
      }
    },
  );

  await check(
    "the stub of a slot without a device is drawn open, also on a page that is opened later",
    { machine: "stray", fresh: true, ready: ["gate"], hash: "&pane=machine" },
    async (page, berth) => {
      const stub = (of, name) => of.locator(`.slot-box[aria-label^="${name},"] .stub`);
      await page.locator('.slot-box[aria-label*="drive"][aria-label*="operational"]').waitFor();
      assert.equal(await stub(page, "gate").getAttribute("class"), "stub open");
      assert.equal(await stub(page, "drive").getAttribute("class"), "stub");
      await berth.request("sim", { action: "unplug", device: "first drive" });
      await page.locator('.slot-box[aria-label*="drive"][aria-label*="absent"]').waitFor();
      await berth.request("world speed", { factor: "20" });
      await berth.request("replace", { slot: "drive" });
      await berth.request("world speed", { factor: "1" });
      const later = await openPage(browser, `${berth.url}&pane=machine`);
      await later.page.locator('.slot-box[aria-label^="drive,"][aria-label*="empty"]').waitFor();
      assert.equal(await stub(later.page, "drive").getAttribute("class"), "stub open");
      await later.context.close();
    },
  );
}

async function help(check) {
  await check(
    "help opens by its button and by ?, says what each pane is for, and Escape closes only it",
    { machine: "belt", hash: "&pane=slots&slot=field/10" },
    async (page, berth, by) => {
      await page.locator(".inspector h2", { hasText: "belt" }).waitFor();
      await page.keyboard.press("?");
      const dialog = page.getByRole("dialog", { name: "Help" });
      await dialog.waitFor();
      const words = await dialog.innerText();
      for (const tab of await page.locator(".tabs button").allInnerTexts()) assert.ok(words.includes(tab), tab);
      for (const each of ["Ctrl K", "Escape", "power cycle needed", "configure", "docs/studio.md", "berth help"]) {
        assert.ok(words.includes(each), each);
      }
      await page.keyboard.press("Escape");
      await dialog.waitFor({ state: "detached" });
      await page.locator(".inspector h2", { hasText: "belt" }).waitFor();
      await by.button("Help").click();
      await dialog.waitFor();
      await by.button("Close").click();
      await dialog.waitFor({ state: "detached" });
      await by.tab("Trace").click();
      await page.getByLabel("Filter frames").fill("");
      await page.getByLabel("Filter frames").press("?");
      assert.equal(await dialog.count(), 0);
    },
  );
  for (const [words, view] of [
    ["light", {}],
    ["dark", { dark: true }],
    ["a tablet", tablet],
  ]) {
    await check(`axe: help, ${words}`, { machine: "belt", hash: "&pane=slots", view }, async (page, berth, by) => {
      await by.button("Help").click();
      await page.getByRole("dialog", { name: "Help" }).waitFor();
      await axe(page);
      const box = await page.getByRole("dialog").boundingBox();
      assert.ok(box.x >= 0 && box.x + box.width <= (view.width ?? 1280));
      assert.ok(await page.locator(".help-body").evaluate((body) => body.scrollWidth <= body.clientWidth));
    });
  }
}

async function palette(check) {
  await check(
    "Find or do finds acts of the world, objects that were read, words of panes, and help",
    { machine: "belt", fresh: true, hash: "&pane=dictionary&slot=field/10" },
    async (page, berth, by) => {
      await by.button("Read all objects").click();
      await page.locator(".object", { hasText: "1017h:00" }).waitFor();
      const find = async (text) => {
        await page.keyboard.press("Control+k");
        await page.getByRole("combobox", { name: "Find or do" }).fill(text);
      };
      const close = () => page.keyboard.press("Escape");
      const first = page.getByRole("option").first();
      const expect = async (text, title) => {
        await find(text);
        await page.getByRole("option", { name: title }).first().waitFor();
        await close();
      };
      await expect("firmware", /program download/);
      await expect("backup", /Backup and restore/);
      await expect("export", /Trace/);
      await expect("export", /Plots/);
      await expect("link", /link to this view/);
      await expect("damage", /Damage the next frame on field/);
      await expect("damage belt", /Damage the next frame it sends: belt/);
      await expect("slow", /Slow by 50 ms: barrier/);
      await expect("deaf", /Deaf: belt/);
      await expect("pause", /Pause the world/);
      await expect("1018h:04", /1018h:04/);
      await expect("6206h:7F", /Read 6206h:7F of belt/);
      await find("producer heartbeat");
      assert.match(await first.innerText(), /1017h:00/);
      await page.keyboard.press("Enter");
      await page.locator(".inspector h2", { hasText: "1017h:00" }).waitFor();
      await find("unplug barrier");
      await page.keyboard.press("Enter");
      await page.locator(".pane-world .answer.good", { hasText: "light barrier" }).waitFor();
      await page.locator(".inspector h2", { hasText: "barrier" }).waitFor();
      const { reply } = await berth.request("sim", { action: "devices" });
      assert.equal(reply.devices.find(({ device }) => device === "light barrier").plugged, false);
      await find("no such thing");
      await page.getByText("Nothing is found for “no such thing”").waitFor();
      await page.locator(".palette .hint", { hasText: "1018h:04" }).waitFor();
      await close();
      await find("help");
      await page.keyboard.press("Enter");
      await page.getByRole("dialog", { name: "Help" }).waitFor();
    },
  );
}

async function paletteAtOnce(check) {
  await check(
    "Ctrl K opens Find or do also in the moment in which Escape closes it",
    { machine: "belt", hash: "&pane=dictionary&slot=field/10" },
    async (page) => {
      const box = page.getByRole("combobox", { name: "Find or do" });
      await page.keyboard.press("Control+k");
      for (let i = 0; i < 100; i++) {
        await box.fill("firmware");
        // Together, so that no message of the page comes between the two keys.
        await Promise.all([page.keyboard.press("Escape"), page.keyboard.press("Control+k")]);
      }
      await box.waitFor();
      await page.keyboard.press("Control+k");
      await page.locator("dialog.palette").waitFor({ state: "detached" });
    },
  );
}

async function views(check) {
  for (const [words, view] of [
    ["1280×800", {}],
    ["a tablet", tablet],
  ]) {
    await check(
      `no reason is cut in Slots, and the type is there: ${words}`,
      { machine: "belt", fresh: true, hash: "&pane=slots&slot=field/10", view },
      async (page, berth, by) => {
        await berth.request("sim", { action: "unplug", device: "light barrier" });
        await by.row("barrier").locator("text=absent").waitFor();
        const { slots } = await berth.snapshot();
        const { reason } = slots.find(({ name }) => name === "barrier");
        assert.ok(reason.length > 30, reason);
        await page.waitForFunction(
          (all) => [...document.querySelectorAll("td.col-reason")].some((cell) => cell.innerText === all),
          reason,
        );
        const cut = await page.locator(".pane-slots .scroll").evaluate((pane) => {
          const edge = pane.getBoundingClientRect().right + 0.5;
          const cells = [...pane.querySelectorAll("th, td")].filter((cell) => cell.offsetWidth > 0);
          return cells
            .filter((cell) => cell.scrollWidth > cell.clientWidth || cell.getBoundingClientRect().right > edge)
            .map((cell) => cell.innerText);
        });
        assert.deepEqual(cut, []);
        await page.locator("td.col-type", { hasText: "/" }).first().waitFor();
        // A short name is one line: who has no reason has no high row.
        const { height } = await by.row("belt").boundingBox();
        assert.ok(height < 48, `${height} pixels`);
      },
    );
  }

  await check(
    "the count of error frames leads to them in the trace",
    { machine: "belt", fresh: true, hash: "&pane=machine" },
    async (page, berth, by) => {
      // Berth was alone when it sent its first frame: nobody acknowledged it.
      await page.getByRole("button", { name: "1 error frame on field: show it in the trace" }).click();
      assert.match(page.url(), /pane=trace/);
      await page.locator(".frame.service-error", { hasText: "ACK slot" }).click();
      await page.locator(".inspector", { hasText: "no other node was on the bus" }).waitFor();
      await by.tab("Plots").click();
      await page.getByRole("button", { name: "1 error frame on field: show it in the trace" }).press("Enter");
      await page.locator(".frame.service-error").first().waitFor();
    },
  );

  await check(
    "who has no keyboard is told the name of the button",
    { machine: "belt", hash: "&pane=slots", view: { width: 1180, height: 820, touch: true } },
    async (page) => {
      const hint = page.locator(".inspector .hint");
      await hint.waitFor();
      assert.match(await hint.innerText(), /“Find or do” at the top finds panes, slots, services and objects/);
      assert.doesNotMatch(await page.locator(".window").innerText(), /Ctrl K/);
    },
  );
}
