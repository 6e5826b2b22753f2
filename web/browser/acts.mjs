/**
 * Each pane's act in Chromium against a real Berth on the simulator, and axe over every pane:
 *   node browser/acts.mjs [--summary FILE] [WORD]   (build/test/berth or $BERTH_BINARY, with the pages built in)
 * STUDIO_PAGES=dist: with the pages of web/dist instead.
 * With WORD only the acts whose name has it. --summary: "passed failed skipped".
 */
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { AxeBuilder } from "@axe-core/playwright";
import { startMock } from "../mock/server.mjs";
import { operational, startBerth } from "./berth.mjs";
import { launch, openPage } from "./open.mjs";

const own = (name) => [`web/browser/machines/${name}.toml`, `web/browser/machines/${name}.plant.toml`];
const folder = (name) => [`examples/${name}/machine.toml`, `examples/${name}/plant.toml`];
const file = (name) => [`examples/${name}.toml`, `examples/${name}.plant.toml`];
const machines = {
  belt: file("belt"),
  five: file("five-slaves"),
  many: file("hundred-twenty"),
  configured: file("configured"),
  programmed: file("programmed"),
  twins: own("twins"),
  unsaved: own("unsaved"),
  conveyor: folder("conveyor"),
  harvester: folder("harvester"),
};

const words = process.argv.slice(2);
const summary = words[0] === "--summary" ? words.splice(0, 2)[1] : "";
const wanted = words.join(" ");
const browser = await launch();
const running = new Map();
let passed = 0;
let failed = 0;

/** Machines that take long to come up serve several acts, one after the other. */
async function berthOf(machine, fresh) {
  if (fresh || !running.has(machine)) {
    await running.get(machine)?.close();
    running.set(machine, await startBerth(...machines[machine]));
  }
  return running.get(machine);
}

async function check(name, { machine = "conveyor", mock, fresh, early, ready, view = {}, hash = "", refused }, act) {
  if (wanted && !name.includes(wanted)) return;
  let opened;
  try {
    const berth = mock ? await startMock({ done: true, ...mock }) : await berthOf(machine, fresh);
    if (!early && !mock) await operational(berth, ready);
    opened = await openPage(browser, berth.url + hash, view);
    const { page, errors } = opened;
    page.setDefaultTimeout(30_000);
    await page.waitForSelector(".tabs");
    await act(page, berth, actsOn(page));
    // Before its server goes: that is an error of the page, too.
    const found = errors.filter((error) => !refused || !error.includes(`status of ${refused}`));
    if (mock) await berth.close();
    assert.deepEqual(found, []);
    passed++;
    console.log(`ok    ${name}`);
  } catch (error) {
    failed++;
    console.log(`FAIL  ${name}: ${String(error.stack ?? error).slice(0, 1500)}`);
  }
  await opened?.context.close();
}

/** Counts what a person does: each press and each text typed is one act. */
function actsOn(page) {
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
    atMost: (most) => assert.ok(count <= most, `${count} acts, at most ${most}`),
  };
}

/** How many frames of the whole ring the filter of the trace finds. The watch list stays. */
async function framesOf(page, filter) {
  const show = (pane, words) =>
    page.evaluate(
      ([pane, filter]) => {
        const values = new URLSearchParams(window.location.hash.slice(1));
        values.set("pane", pane);
        values.set("filter", filter);
        window.location.hash = `#${values.toString()}`;
      },
      [pane, words],
    );
  await show("trace", filter);
  const told = page.locator(".bar .number", { hasText: "in the whole ring" });
  await told.waitFor();
  const count = /, ([\d,]+) in the whole ring/.exec(await told.innerText())[1];
  await show("slots", "");
  return Number(count.replace(/,/g, ""));
}

const tablet = { width: 768, height: 1024, touch: true };
const state = (page, word) => page.locator(".inspector .state-word", { hasText: word }).first().waitFor();

// ---- the five tasks' first half ----

await check("task: the failed device is found", { machine: "belt", fresh: true }, async (page, berth, by) => {
  await berth.request("sim", { action: "unplug", device: "light barrier" });
  await by.press(page.getByRole("button", { name: "1 needs somebody" }));
  await page.locator(".inspector h2", { hasText: "barrier" }).waitFor();
  await page.locator(".need-box", { hasText: "does not answer" }).waitFor();
  by.atMost(1);
});

await check(
  "task: the fitter replaces it by three taps at most",
  { machine: "twins", fresh: true, ready: ["left", "right"], hash: "&pane=slots", view: tablet },
  async (page, berth, by) => {
    await berth.request("sim", { action: "unplug", device: "old gate" });
    await by.row("gate").locator("text=absent").waitFor();
    await by.tap(by.row("gate"));
    await by.tap(by.button("Replace").first());
    await page.locator(".steps li.now", { hasText: "plug in the spare" }).waitFor();
    await berth.request("sim", { action: "plug", device: "spare gate" });
    await page.locator(".steps li.done", { hasText: "It runs" }).waitFor();
    assert.equal(await page.locator(".inspector .answer.bad").count(), 0);
    const { slots } = await berth.snapshot();
    assert.equal(slots.find((slot) => slot.name === "gate").r_sn, "0x0000000000000022");
    by.atMost(3);
  },
);

await check(
  "task: a heartbeat is changed on ten devices",
  { machine: "many", fresh: true },
  async (page, berth, by) => {
    await by.press(by.slot("sensor 3"));
    await by.press(by.tab("Dictionary"));
    await by.enter(page.getByLabel("Search objects"), "1017h");
    await by.type(page.getByLabel("New value"), "750");
    await by.type(page.getByLabel("Devices"), "1-10");
    await by.press(by.button("Write to 10 devices"));
    await page.locator(".answer.good", { hasText: "10 of 10" }).waitFor();
    by.atMost(6);
    for (let id = 1; id <= 10; id++) {
      const { reply } = await berth.request("sdo read", { node: String(id), object: "1017h:00" });
      assert.equal(reply.value, 750);
    }
    const { reply } = await berth.request("sdo read", { node: "11", object: "1017h:00" });
    assert.notEqual(reply.value, 750);
  },
);

await check("task: an SDO abort of before leads to its object", {}, async (page, berth, by) => {
  const before = await berth.request("sdo read", { node: "unloader drive", object: "1A7Fh:02" });
  assert.notEqual(before.status, 0);
  await by.press(by.tab("Trace"));
  await by.type(page.getByLabel("Filter frames"), "abort 1A7Fh");
  await by.press(page.locator(".scroll .frame", { hasText: "abort" }).first());
  await by.press(page.getByRole("button", { name: "Object 1A7Fh:02 in the dictionary" }));
  await page.locator(".inspector h2", { hasText: "1A7Fh:02" }).waitFor();
  await page.locator(".inspector h2", { hasText: "unloader drive" }).waitFor();
  by.atMost(4);
});

// ---- machine ----

await check("blank devices become a machine", { early: true, fresh: true }, async (page) => {
  await page.locator('.slot-box[aria-label*="configuring"]').first().waitFor();
  await page.locator(".discovery", { hasText: "55 found" }).waitFor();
  await page.locator(".bus-name", { hasText: "55 of 55 operational" }).waitFor();
});

await check("buses beneath gateways come up, too", { machine: "harvester", early: true }, async (page, berth) => {
  const { buses } = await berth.snapshot();
  for (const bus of buses) await page.locator(".bus-name", { hasText: bus.name }).first().waitFor();
  await operational(berth);
  await page.waitForFunction(
    () => document.querySelectorAll('.slot-box:not([aria-label*="operational"])').length === 0,
  );
});

// ---- slots ----

await check(
  "a question is answered",
  { machine: "twins", fresh: true, ready: ["left", "right"], hash: "&pane=slots" },
  async (page, berth, by) => {
    await by.row("right").click();
    await page.locator(".need-box", { hasText: "which belongs where" }).waitFor();
    // It is still there for a page that is opened later.
    await page.reload();
    await page.getByRole("button", { name: "This one is right" }).nth(0).click();
    await state(page, "operational");
    await operational(berth);
    const { slots, questions } = await berth.snapshot();
    assert.equal(slots.find((slot) => slot.name === "right").r_sn, "0x0000000000000011");
    assert.deepEqual(questions, []);
  },
);

await check(
  "a device that must save its parameters first is told to",
  { machine: "unsaved", fresh: true, early: true, hash: "&pane=slots&slot=field/1" },
  async (page, berth, by) => {
    await page.locator(".need-box", { hasText: "nothing that was saved" }).waitFor();
    await by.button("Save its parameters").click();
    await page.locator(".answer.good", { hasText: "store" }).waitFor();
    await by.button("Reset it").click();
    await state(page, "operational");
    await operational(berth);
    assert.equal(await page.locator(".need-box").count(), 0);
  },
);

await check("history, locate", { machine: "belt", fresh: true, hash: "&pane=slots" }, async (page, berth, by) => {
  await by.row("barrier").click();
  await by.button("Who sat here before").click();
  await page.locator(".answer.good", { hasText: "declared" }).waitFor();
  await by.button("Locate: let it flicker").click();
  await page.locator(".answer:not(.busy)", { hasText: "locate" }).waitFor();
});

// ---- dictionary ----

await check(
  "objects are read, searched, written and read back",
  { machine: "belt", fresh: true, hash: "&pane=dictionary&slot=field/10" },
  async (page, berth, by) => {
    await by.button("Read all objects").click();
    await page.getByLabel("Search objects").fill("heartbeat");
    await page.locator(".object", { hasText: "1017h:00" }).click();
    await page.locator(".inspector", { hasText: "Time between two heartbeats" }).waitFor();
    await page.getByLabel("New value").fill("700");
    await by.button("Write").click();
    await page.locator(".object", { hasText: "1017h:00" }).locator("text=700").waitFor();
    await page.getByLabel("changed only").check();
    await page.locator(".object", { hasText: "1017h:00" }).waitFor();
    const { reply } = await berth.request("sdo read", { node: "10", object: "1017h:00" });
    assert.equal(reply.value, 700);
    await page.getByLabel("New value").fill("no number");
    await by.button("Write").click();
    await page.locator(".answer.bad", { hasText: "no number" }).waitFor();
  },
);

await check(
  "what another browser writes is seen beside one's own draft",
  { machine: "belt", hash: "&pane=dictionary&slot=field/10&object=1017h:00" },
  async (page, berth, by) => {
    await by.button("Read all objects").click();
    await page.getByLabel("Search objects").fill("1017h");
    const row = page.locator(".object", { hasText: "1017h:00" });
    await row.click();
    await page.getByLabel("New value").fill("611");
    const second = await openPage(browser, `${berth.url}&pane=dictionary&slot=field/10&object=1017h:00`);
    await second.page.getByLabel("New value").fill("622");
    await second.page.getByRole("button", { name: "Write", exact: true }).click();
    await row.locator("text=622").waitFor();
    await page.locator(".events", { hasText: "studio: sdo write" }).waitFor();
    assert.equal(await page.getByLabel("New value").inputValue(), "611");
    assert.deepEqual(second.errors, []);
    await second.context.close();
  },
);

await check(
  "differences from the slot's file and from the defaults are shown alone",
  { machine: "configured", fresh: true, hash: "&pane=dictionary" },
  async (page, berth, by) => {
    const { slots } = await berth.snapshot();
    const { bus, id, name } = slots[0];
    await page.evaluate((hash) => (window.location.hash = hash), `#pane=dictionary&slot=${bus}/${id}`);
    await berth.request("sdo write", { node: name, object: "1017h", value: "650" });
    await by.button("Read all objects").click();
    await page.getByLabel("differences only").check();
    await page.locator(".object", { hasText: "1017h:00" }).locator(".unlike").waitFor();
    await page.getByLabel("Search objects").fill("2000h:01");
    assert.equal(await page.locator(".scroll .object").count(), 0, "it is as pump.dcf wants it");
    await page.getByLabel("differences only").uncheck();
    await page.locator(".object", { hasText: "2000h:01" }).click();
    const told = await page.locator(".inspector dl", { hasText: "Configured" }).first().innerText();
    assert.match(told, /Default\s+100\s+Configured\s+500/);
  },
);

await check(
  "a value is edited as its type wants it",
  { machine: "belt", hash: "&pane=dictionary&slot=field/10" },
  async (page, berth, by) => {
    await by.button("Read all objects").click();
    await page.getByLabel("Search objects").fill("1017h");
    await page.locator(".object", { hasText: "1017h:00" }).click();
    await page.getByLabel("New value").fill("65536");
    await page.locator(".bad-text", { hasText: "UNSIGNED16 takes 0 to 65535." }).waitFor();
    assert.equal(await by.button("Write").count(), 0);
    await page.getByLabel("New value").fill("0x320");
    await by.button("Write").click();
    await page.locator(".object", { hasText: "1017h:00" }).locator("text=800").waitFor();
    await page.getByLabel("Search objects").fill("6005h");
    await page.locator(".object", { hasText: "6005h:00" }).click();
    const box = page.getByRole("checkbox", { name: /^New value/ });
    const was = await box.isChecked();
    await box.setChecked(!was);
    await by.button("Write").click();
    await page.locator(".answer.good", { hasText: "sdo write" }).waitFor();
    const { reply } = await berth.request("sdo read", { node: "10", object: "6005h:00" });
    assert.equal(Boolean(reply.value), !was);
    await by.button("Watch").click();
    await page.getByLabel("Search objects").fill("");
    await page.getByLabel("watched only").check();
    assert.equal(await page.locator(".scroll .object").count(), 1);
  },
);

await check(
  "a device's configuration is saved as DCF",
  { machine: "belt", hash: "&pane=slots&slot=field/10" },
  async (page, berth, by) => {
    const coming = page.waitForEvent("download");
    await by.button("Save as DCF").click();
    const file = await coming;
    assert.match(file.suggestedFilename(), /^belt-\d{4}-\d\d-\d\d-\d{4}\.dcf$/);
    const text = readFileSync(await file.path(), "latin1");
    assert.match(text, /^\[1017\]/m);
    assert.match(text, /^ParameterValue=/m);
  },
);

// ---- network access ----

await check("a service is asked by its form", { hash: "&pane=network&slot=field/12" }, async (page, berth) => {
  await page.locator(".tools").getByRole("button", { name: "nmt", exact: true }).click();
  await page.getByLabel("command", { exact: false }).first().selectOption("preop");
  await page.getByRole("button", { name: "Do: nmt" }).click();
  await page.locator(".answer.good").waitFor();
  await page.getByLabel("command", { exact: false }).first().selectOption("start");
  await page.getByRole("button", { name: "Do: nmt" }).click();
  await operational(berth);
  await page.locator(".tools").getByRole("button", { name: "scan", exact: true }).click();
  await page.getByRole("button", { name: "Do: scan" }).click();
  await page.locator(".answer.good", { hasText: "unloader drive" }).waitFor();
  // A long line scrolls in its own box.
  assert.ok(await page.locator(".columns .scroll").evaluate((box) => box.scrollWidth <= box.clientWidth));
});

await check(
  "devices are backed up, compared and restored",
  { machine: "belt", fresh: true, hash: "&pane=network&slot=field/10" },
  async (page, berth, by) => {
    await page.locator(".tools").getByRole("button", { name: "backup and restore", exact: true }).click();
    const files = [];
    page.on("download", (file) => files.push(file));
    await by.button("Back up all 2 devices").click();
    await page.locator(".answer.good", { hasText: "2 of 2 backed up" }).waitFor();
    for (let i = 0; files.length < 2 && i < 100; i++) await page.waitForTimeout(50);
    const names = files.map((file) => file.suggestedFilename());
    assert.match(names[0], /^belt-\d{4}-\d\d-\d\d-\d{4}\.dcf$/);
    assert.match(names[1], /^barrier-/);
    const before = await berth.request("sdo read", { node: "belt", object: "1017h" });
    await berth.request("sdo write", { node: "belt", object: "1017h", value: "650" });
    await page
      .locator("input[type=file]")
      .setInputFiles({ name: names[0], mimeType: "text/plain", buffer: readFileSync(await files[0].path()) });
    await by.button("Compare with belt").click();
    const row = page.locator(".form tr", { hasText: "1017h:00" });
    await row.locator("text=650").waitFor();
    await by.button("Restore into belt").click();
    await page
      .getByRole("dialog")
      .locator("code", { hasText: `berth backup restore belt ${names[0]}` })
      .waitFor();
    await by.button("Send it").click();
    await page.locator(".answer.good", { hasText: "restored and stored" }).waitFor();
    const after = await berth.request("sdo read", { node: "belt", object: "1017h" });
    assert.equal(after.reply.value, before.reply.value);
    await by.button("Compare with belt").click();
    await page.locator(".answer.good", { hasText: "as the DCF has it" }).waitFor();
    await by.slot("barrier").click();
    await by.button("Compare with barrier").click();
    await page.locator(".answer.bad", { hasText: "of another type of device" }).waitFor();
    await operational(berth);
  },
);

await check(
  "each service without obligatory arguments answers",
  { machine: "five", fresh: true, hash: "&pane=network" },
  async (page) => {
    for (const verb of ["scan", "bind", "lss find", "sdo channels"]) {
      await page.locator(".tools").getByRole("button", { name: verb, exact: true }).click();
      await page.getByRole("button", { name: `Do: ${verb}` }).click();
      await page.locator(".form .answer:not(.busy)").waitFor();
      const answer = await page.locator(".form .answer").innerText();
      assert.ok(!/wrong usage|no \(2\)/.test(answer), `${verb}: ${answer}`);
    }
  },
);

await check(
  "a program is updated",
  { machine: "programmed", fresh: true, hash: "&pane=network&slot=line/1" },
  async (page, berth) => {
    await page.locator(".tools").getByRole("button", { name: "program download", exact: true }).click();
    await page.getByRole("button", { name: "Do: program download" }).click();
    await page.locator(".answer.good", { hasText: "downloaded and started" }).waitFor();
    const { reply } = await berth.request("program status", { node: "1" });
    assert.equal(reply.programs[0].state, "started");
    assert.equal(reply.programs[0].identification, reply.programs[0].expected);
  },
);

// ---- trace ----

await check(
  "frames are filtered at load, and a frame's bits are shown",
  { early: true, fresh: true, hash: "&pane=trace" },
  async (page) => {
    await page.getByLabel("Filter frames").fill("sdo");
    await page.locator(".scroll .frame").first().waitFor();
    await page.locator(".bar .number", { hasText: "in the whole ring" }).waitFor();
    await page.getByRole("button", { name: /Pause/ }).click();
    await page.locator(".scroll .frame").last().click();
    await page.locator(".bits .field", { hasText: "CRC" }).first().waitFor();
    for (const row of await page.locator(".scroll .frame .words").allInnerTexts()) assert.match(row, /sdo/i);
    assert.match(page.url(), /filter=sdo/);
  },
);

await check("pause loses nothing", { hash: "&pane=trace" }, async (page, berth) => {
  await page.locator(".scroll .frame").first().waitFor();
  await page.keyboard.press("p");
  await page.locator(".bar .number", { hasText: " new" }).waitFor();
  await page.keyboard.press("p");
  const there = await page.locator(".bar .number").innerText();
  assert.doesNotMatch(there, / new/);
  assert.ok((await berth.snapshot()).seq >= 0);
});

await check(
  "the latest of each identifier",
  { hash: "&pane=trace&mode=latest&slot=field/12&filter=70C" },
  async (page) => {
    await page.locator(".frame.latest", { hasText: "70Ch" }).locator("text=Heartbeat of node 12").waitFor();
  },
);

await check(
  "an SDO transfer is one row, which opens to its frames",
  { machine: "belt", fresh: true, hash: "&pane=trace&mode=folded&filter=1008h" },
  async (page, berth) => {
    await berth.request("sdo read", { node: "10", object: "1008h:00" });
    const row = page.locator(".frame.transfer", { hasText: "Belt of the examples" }).last();
    await row.waitFor();
    assert.match(await row.innerText(), /8 frames/);
    await row.click();
    await page.locator(".frame.child").nth(7).waitFor();
    await page.locator(".frame.child").first().click();
    await page.getByRole("button", { name: "Object 1008h:00 in the dictionary" }).waitFor();
    await page.keyboard.press("ArrowDown");
    await page.locator(".frame.child:nth-child(n) + .frame.child.selected").waitFor();
    await page.keyboard.press("ArrowLeft");
    await page.locator(".frame.transfer.selected", { hasText: "Belt of the examples" }).waitFor();
    assert.equal(await page.locator(".frame.child").count(), 0);
    await page.keyboard.press("ArrowRight");
    await page.locator(".frame.child").nth(7).waitFor();
  },
);

await check(
  "what the whole ring has of a transfer is found, not only what the filter lets through",
  { machine: "belt", hash: "&pane=slots" },
  async (page, berth) => {
    await berth.request("sdo read", { node: "10", object: "1009h:00" });
    for (let i = 0; i < 80; i++)
      await berth.request("sdo probe", { node: "11", objects: "1018:0-4,1000:0,1001:0,1017:0" });
    await page.evaluate(() => (window.location.hash = "#pane=trace&mode=folded&filter=node 10 read 1009h"));
    await page.locator(".frame.transfer", { hasText: "31 2E 30" }).first().waitFor();
  },
);

await check(
  "a marker is in the address, and times count from it",
  { machine: "belt", hash: "&pane=trace" },
  async (page, berth) => {
    await page.locator(".scroll .frame").nth(3).waitFor();
    await page.locator(".scroll .frame").nth(2).click();
    await page.keyboard.press("m");
    await page.locator(".scroll .frame.marked", { hasText: "+0.000000" }).waitFor();
    assert.match(page.url(), /marks=\d+&zero=\d+/);
    const n = /marks=(\d+)/.exec(page.url())[1];
    // Another page, which never saw the frame, finds it.
    const url = `${berth.url}&pane=trace&marks=${n}&zero=${n}`;
    const other = await openPage(browser, url);
    await other.page.locator(".marks button", { hasText: "+0.000000 s" }).waitFor();
    await other.context.close();
    await page.getByRole("button", { name: /Take the marker of frame/ }).click();
    assert.equal(await page.locator(".marks").count(), 0);
  },
);

await check(
  "what the filter finds in the whole ring is saved by the server",
  { machine: "belt", hash: "&pane=trace&filter=70A%2305" },
  async (page, berth, by) => {
    await page.locator(".bar .number", { hasText: "in the whole ring" }).waitFor();
    await page.locator(".menu summary").click();
    const saved = async (words) => {
      const coming = page.waitForEvent("download");
      await by.button(`What the filter finds in the whole ring, as ${words}`).click();
      return readFileSync(await (await coming).path());
    };
    const lines = (await saved("candump log")).toString().trim().split("\n");
    assert.ok(lines.length > 3);
    for (const line of lines) assert.match(line, /^\(\d{10}\.\d{6}\) field 70A#05 [RT]$/);
    assert.equal((await saved("pcapng")).readUInt32BE(0), 0x0a0d0d0a);
    assert.match((await saved("Vector ASC")).toString(), /^date /);
    assert.match((await saved("PEAK TRC 2.1")).toString(), /^;\$FILEVERSION=2\.1/);
    await page.locator(".menu code", { hasText: "curl" }).waitFor();
  },
);

await check(
  "a log of this computer is opened, its wrong lines are told, and the machine's frames come back",
  { machine: "belt", hash: "&pane=trace", refused: 422 },
  async (page, berth, by) => {
    const log = "(0000000001.000000) can0 705#7F\nno frame\n(0000000002.000000) can0 601#4018100400000000\n";
    const pick = (name, text) =>
      page.getByLabel("Open a log", { exact: true }).setInputFiles({ name, mimeType: "", buffer: Buffer.from(text) });
    await pick("run.log", log);
    const bar = page.getByRole("group", { name: "Opened file" });
    await bar.getByText("2 frames, candump").waitFor();
    await page.locator(".frame", { hasText: /pre-operational/i }).waitFor();
    await bar.getByText("1 remark").click();
    await bar.getByText(/^run\.log:2:/).waitFor();
    await bar.locator("code", { hasText: "berth trace run.log" }).waitFor();
    await by.type(page.getByLabel("Filter frames"), "1018h");
    await bar.getByText("1 of 2 frames").waitFor();
    await by.type(page.getByLabel("Filter frames"), "");
    await by.button("Close the file").click();
    await page.locator(".scroll .frame").nth(3).waitFor();
    await pick("empty.log", "");
    await page.getByRole("alert").getByText("empty.log: the file is empty").waitFor();
  },
);

await check("a page of role view sees, and may not", { machine: "belt", hash: "" }, async (page, berth, by) => {
  await by.slot("barrier").click();
  await by.button("Locate: let it flicker").waitFor();
  assert.equal(await by.button("Locate: let it flicker").isDisabled(), false);
  const { token_file } = await berth.snapshot();
  const token = readFileSync(`${token_file}.view`, "utf8").trim();
  const other = await openPage(browser, `${berth.address}#token=${token}&slot=field/11`);
  const button = other.page.getByRole("button", { name: "Locate: let it flicker", exact: true });
  await button.waitFor();
  assert.equal(await button.isDisabled(), true);
  await other.page.getByText("This needs the role operate. Yours is view.").first().waitFor();
  await other.page.getByText("role: view").waitFor();
  await other.context.close();
});

await check(
  "what is listed is saved as candump log and as CSV",
  { machine: "belt", hash: "&pane=trace&filter=70A%2305" },
  async (page, berth, by) => {
    await page.locator(".scroll .frame").nth(3).waitFor();
    await page.keyboard.press("p");
    await page.locator(".menu summary").click();
    for (const [name, line] of [
      ["What is listed, as candump log", /^\(\d{10}\.\d{6}\) field 70A#05$/],
      ["What is listed, as CSV", /^\d+,\d+\.\d{6},field,70A,0,0,[01],1,05,/],
    ]) {
      const coming = page.waitForEvent("download");
      await by.button(name).click();
      const file = await coming;
      const lines = readFileSync(await file.path(), "utf8")
        .split(/\r?\n/)
        .filter(Boolean);
      assert.ok(lines.length > 3);
      for (const each of lines.slice(name.endsWith("CSV") ? 1 : 0)) assert.match(each, line);
    }
  },
);

// ---- plots ----

await check(
  "load, heartbeats and a watched object are drawn, paused and saved",
  { machine: "belt", fresh: true, hash: "&pane=dictionary&slot=field/10&object=1001h:00" },
  async (page, _, by) => {
    await by.button("Watch").click();
    await by.tab("Plots").click();
    await page.locator(".watch tr", { hasText: "1001h:00" }).locator("td", { hasText: /^0$/ }).waitFor();
    await page.locator(".plots p", { hasText: /intervals: mean \d/ }).waitFor();
    assert.ok((await page.locator(".plots canvas").count()) >= 4);
    assert.match(page.url(), /watch=field%2F10\+1001h%3A00/);
    await page.keyboard.press("p");
    const coming = page.waitForEvent("download");
    await by.button("Export as CSV").click();
    const text = readFileSync(await (await coming).path(), "utf8");
    for (const line of [
      /^load field,%,page,/m,
      /^heartbeat interval field\/10,ms,bus,/m,
      /^field\/10 1001h:00,,page,/m,
    ]) {
      assert.match(text, line);
    }
    // While it is paused, and when the pane is left, nobody is asked.
    const asked = () => framesOf(page, "60A#40011000");
    await page.keyboard.press("p");
    await page.waitForTimeout(2200);
    await by.tab("Slots").click();
    await page.waitForTimeout(300);
    const before = await asked();
    await page.waitForTimeout(2500);
    assert.ok(before > 1);
    assert.equal(await asked(), before);
    await by.tab("Plots").click();
    await page.waitForTimeout(2500);
    assert.ok((await asked()) > before);
  },
);

// ---- world ----

await check(
  "a plug is pulled in the world, and put back",
  { machine: "belt", fresh: true, hash: "&pane=world&slot=field/11" },
  async (page, berth, by) => {
    await by.button("Unplug").click();
    await page.locator(".inspector .need-box").waitFor();
    await by.button("Plug in").click();
    await state(page, "operational");
    for (const name of ["Slow by 50 ms", "Deaf for 5 s", "Power off"]) {
      await by.button(name).click();
      await page.locator(".pane .answer.good").waitFor();
    }
    await by.button("Power on").click();
    await operational(berth);
  },
);

// ---- doctor ----

await check(
  "the doctor says what is wrong, and where to look",
  { machine: "belt", fresh: true, hash: "&pane=doctor" },
  async (page, berth, by) => {
    await page.getByLabel("Seconds").fill("4");
    // What Berth itself commands meanwhile is nobody's fault.
    await by.button("Run the doctor").click();
    await berth.request("nmt", { command: "preop", node: "belt" });
    await berth.request("nmt", { command: "start", node: "belt" });
    await page.locator(".answer.good", { hasText: "nothing wrong" }).waitFor();
    await berth.request("sim", { action: "unplug", device: "light barrier" });
    await by.button("Run it again").click();
    const silent = page.locator(".finding.certain", { hasText: "barrier) is silent" });
    await silent.locator("text=has it power").waitFor();
    const kinds = await page.locator(".finding h3 .quiet").allInnerTexts();
    assert.deepEqual(kinds, ["certain", "possible"]);
    await silent.getByRole("button", { name: "Select barrier" }).click();
    await page.locator(".inspector h2", { hasText: "barrier" }).waitFor();
    await silent.getByRole("button", { name: "Frames 70Bh" }).click();
    assert.equal(await page.getByLabel("Filter frames").inputValue(), "field 70B#");
  },
);

await check(
  "a device is examined, and each check leads to its object",
  { machine: "belt", fresh: true, hash: "&pane=doctor&slot=field/10" },
  async (page, berth, by) => {
    await page.getByLabel("What it does").selectOption("conformance");
    await page.getByRole("button", { name: /^Copy command: berth doctor --bus field --conformance belt/ }).waitFor();
    await by.button("Run the doctor").click();
    await page.locator(".answer", { hasText: /\d+ checks passed, \d+ failed/ }).waitFor();
    await page.getByLabel("what passed, too").check();
    await page.locator(".doctor tr", { hasText: "1018h:00" }).getByRole("button", { name: "1018h:00" }).first().click();
    await page.locator(".inspector h2", { hasText: "1018h:00" }).waitFor();
    await operational(berth);
  },
);

// ---- the window ----

await check(
  "a page that lost its server finds it again",
  { machine: "belt", fresh: true, hash: "&pane=slots" },
  async (page, berth) => {
    await page.context().setOffline(true);
    await page.evaluate(() => undefined);
    await page.context().setOffline(false);
    await berth.request("sim", { action: "unplug", device: "light barrier" });
    await page.locator(".rows tr.needs", { hasText: "barrier" }).waitFor();
  },
);

await check("the palette finds a slot by the keyboard", {}, async (page) => {
  await page.keyboard.press("Control+k");
  await page.keyboard.type("quay belt");
  await page.keyboard.press("Enter");
  await page.locator(".inspector h2", { hasText: "quay belt" }).waitFor();
});

// ---- what a simulated machine does not have: the mock server ----

await check(
  "a gap and a lost connection end in a new snapshot",
  { mock: {}, hash: "&pane=slots" },
  async (page, mock) => {
    mock.makeGap();
    mock.machine.set("desk", "absent");
    await page.locator(".rows tr", { hasText: "desk" }).locator("text=absent").first().waitFor();
    mock.dropClients();
    mock.machine.set("bunker", "failed");
    await page.locator(".rows tr.needs", { hasText: "bunker" }).first().waitFor();
  },
);

await check(
  "real buses are read-only until they are unlocked",
  { mock: { real: true }, hash: "&pane=slots&slot=field/3" },
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

await check(
  "a doctor who asks on a real bus is confirmed, and one who listens is not",
  { mock: { real: true }, hash: "&pane=doctor&slot=field/3" },
  async (page, mock, by) => {
    await page.locator("button:enabled", { hasText: "Run the doctor" }).waitFor();
    await page.getByLabel("What it does").selectOption("lss");
    await page.locator("button:disabled", { hasText: "Run the doctor" }).waitFor();
    await page.getByRole("button", { name: /Unlock/ }).click();
    await by.button("Run the doctor").click();
    await page.getByRole("button", { name: "Do nothing" }).click();
    assert.equal(await page.locator(".doctor .answer").count(), 0);
    await page.getByLabel("What it does").selectOption("listen");
    await by.button("Run the doctor").click();
    await page.locator(".doctor .answer", { hasText: "nothing wrong" }).waitFor();
  },
);

await check(
  "a name that is HTML stays text",
  { mock: { odd: true }, hash: "&pane=slots&slot=field/2" },
  async (page) => {
    await page.locator(".inspector h2", { hasText: "<b>quay</b>\\x07" }).waitFor();
    assert.equal(await page.locator(".inspector h2 b").count(), 0);
  },
);

const panes = [
  "machine",
  "slots",
  "dictionary",
  "network",
  "trace",
  "trace&mode=folded&marks=20",
  "plots&watch=field/32+1017h:00",
  "doctor",
  "world",
];
for (const dark of [false, true]) {
  for (const pane of panes) {
    const hash = `&pane=${pane}&slot=field/32`;
    await check(`axe: ${pane}, ${dark ? "dark" : "light"}`, { hash, view: { dark } }, async (page) => {
      await page.locator(".inspector h2").first().waitFor();
      const { violations } = await new AxeBuilder({ page }).analyze();
      const found = violations.map((v) => `${v.id} (${v.nodes.length}): ${v.nodes[0]?.html.slice(0, 160)}`);
      assert.deepEqual(found, []);
    });
  }
}

for (const berth of running.values()) await berth.close();
await browser.close();
console.log(`${passed} passed, ${failed} failed`);
if (summary) writeFileSync(summary, `${passed} ${failed} 0\n`);
process.exitCode = failed ? 1 : 0;
