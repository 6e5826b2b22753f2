/**
 * Each pane's act in Chromium against a real Berth on the simulator, and axe over every pane:
 *   node browser/acts.mjs [--summary FILE] [WORD]   (build/test/berth or $BERTH_BINARY, with the pages built in)
 * STUDIO_PAGES=dist: with the pages of web/dist instead.
 * With WORD only the acts whose name has it. --summary: "passed failed skipped".
 */
import assert from "node:assert/strict";
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { AxeBuilder } from "@axe-core/playwright";
import { startMock } from "../mock/server.mjs";
import { bigMachine, odd, oddMachine } from "./bad_input.mjs";
import { operational, root, startBerth } from "./berth.mjs";
import { newcomerActs } from "./newcomer.mjs";
import { launch, openPage } from "./open.mjs";
import { actsOn, machines, taskLine, tasks } from "./tasks.mjs";

const words = process.argv.slice(2);
const summary = words[0] === "--summary" ? words.splice(0, 2)[1] : "";
const wanted = words.join(" ");
const browser = await launch();
const running = new Map();
let passed = 0;
let failed = 0;
const told = [];

/** Machines that take long to come up serve several acts, one after the other. */
async function berthOf(machine, fresh) {
  if (fresh || !running.has(machine)) {
    await running.get(machine)?.close();
    running.set(machine, await startBerth(...machines[machine]));
  }
  return running.get(machine);
}

/** `paused`: before the page is opened, so that however slow it is, the machine has not come up before. */
async function check(
  name,
  { machine = "conveyor", mock, fresh, early, paused, ready, view = {}, hash = "", refused },
  act,
) {
  if (wanted && !name.includes(wanted)) return;
  let opened;
  try {
    const berth = mock ? await startMock({ done: true, ...mock }) : await berthOf(machine, fresh);
    if (!early && !mock) await operational(berth, ready);
    if (paused) await berth.request("world pause");
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

const state = (page, word) => page.locator(".inspector .state-word", { hasText: word }).first().waitFor();

// ---- the brief's tasks ----

for (const task of tasks) {
  await check(`task: ${task.name}`, task.where, async (page, berth, by) => {
    const { seconds } = await task.act(page, berth, by);
    by.atMost(task.acts);
    told.push(taskLine(task, by.count(), seconds));
  });
}

// ---- beneath a gateway ----

await check(
  "a slot beneath a gateway offers what SDO does; what needs a port there is grey, and says why",
  { machine: "signals", hash: "&pane=slots&slot=left/2" },
  async (page, berth, by) => {
    const inspector = page.locator(".inspector");
    await inspector.locator("h2", { hasText: "front motor" }).waitFor();
    const acts = ["Locate: let it flicker", "Replace", "Who sat here before", "Save as DCF"];
    const offered = async () => {
      const enabled = acts.map((name) => inspector.getByRole("button", { name, exact: true }).isEnabled());
      return Promise.all(enabled);
    };
    assert.deepEqual(await offered(), [false, false, false, false]);
    const why = inspector.getByText("Beneath gateway 3 of bus backbone: Berth has no port there.");
    assert.equal(await why.count(), acts.length);
    // The page says no where Berth does, and only there.
    const { status } = await berth.request("replace", { bus: "left", slot: "front motor" });
    assert.equal(status, 2);
    await by.tab("Network access").click();
    await by.button("lss identify-unconfigured").click();
    assert.ok(await by.button("Do: lss identify-unconfigured").isDisabled());
    await by.button("emcy").click();
    await by.button("Do: emcy").click();
    await page.locator(".answer.good", { hasText: "no error" }).waitFor();
    await by.slot("engine").click();
    await by.button("lss identify-unconfigured").click();
    assert.ok(await by.button("Do: lss identify-unconfigured").isEnabled());
    assert.deepEqual(await offered(), [true, true, true, true]);
  },
);

await check(
  "of a bus beneath a gateway nothing is heard, and that is said instead of 0",
  { machine: "signals", hash: "&pane=machine" },
  async (page, berth, by) => {
    const loads = page.locator(".tree .load");
    await page.locator(".tree .load", { hasText: "%" }).waitFor();
    assert.match((await loads.allInnerTexts()).join(), /^\d+ %,not heard,not heard$/);
    const names = await page.locator(".bus-name").allTextContents();
    assert.match(names[0], /frames\/s, load/);
    for (const name of names.slice(1)) assert.match(name, /operational· not heardBerth has no port here/);
    await by.tab("Plots").click();
    await page.getByText("left, reel: not heard, Berth has no port there.").waitFor();
    assert.equal(await page.locator(".plots").getByText("left", { exact: true }).count(), 0);
    assert.equal(await page.getByText(/(left|reel): no error frames/).count(), 0);
    await by.slot("front motor").click();
    await page.getByText("The heartbeats of front motor are not heard").waitFor();
  },
);

// ---- machine ----

/** Runs the paused world until a slot is configuring, and pauses it again: so long a page may take to show it. */
async function runUntilConfiguring(berth) {
  for (let look = 0; look < 3000; look++) {
    await berth.request("world run");
    await new Promise((resolve) => setTimeout(resolve, 20));
    await berth.request("world pause");
    if ((await berth.snapshot()).slots.some((slot) => slot.state === "configuring")) return;
  }
  throw new Error("no slot was configuring");
}

await check("blank devices become a machine", { early: true, fresh: true, paused: true }, async (page, berth) => {
  await page.locator(".slot-box").first().waitFor();
  await runUntilConfiguring(berth);
  await page.locator('.slot-box[aria-label*="configuring"]').first().waitFor();
  await berth.request("world run");
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
  "an empty slot asks for a device, and what an act answered about slots fits the inspector",
  { machine: "stray", fresh: true, ready: ["gate"], hash: "&pane=slots&slot=field/1" },
  async (page, berth, by) => {
    await berth.request("sim", { action: "unplug", device: "drive" });
    await state(page, "absent");
    await by.button("Replace").click();
    await state(page, "empty");
    const inspector = page.locator(".inspector");
    await inspector.getByText("Plug in a device of the slot's type, 1h / 1h.").waitFor();
    assert.equal(await inspector.locator("dt", { hasText: "Boot-up" }).count(), 0, "it has no device to boot up");
    await by.tab("Network access").click();
    await page.locator(".boot-log", { hasText: "No device: plug one in of the slot's type, 1h / 1h." }).waitFor();
    assert.equal(await page.locator(".boot-log", { hasText: "It does not answer" }).count(), 0);
    await berth.request("sim", { action: "plug", device: "second drive" });
    await state(page, "operational");
    await by.button("Who sat here before").click();
    const answer = inspector.locator(".answer.good");
    await answer.locator("li", { hasText: "cleared" }).first().waitFor();
    const fits = (what) => what.evaluate((element) => element.scrollWidth <= element.clientWidth);
    assert.ok(await fits(inspector));
    await berth.request("sim", { action: "unplug", device: "drive" });
    await state(page, "absent");
    await by.button("Replace").click();
    await state(page, "empty");
    // It sat here before: Berth asks, and the answer to Replace is no longer "it waits".
    await berth.request("sim", { action: "plug", device: "first drive" });
    await state(page, "question");
    await inspector.locator(".answer.bad .state-word").waitFor();
    await inspector.locator(".answer.bad pre", { hasText: "drive released" }).waitFor();
    assert.ok(await fits(inspector.locator(".answer pre")));
    assert.ok(await fits(inspector));
    assert.equal(await inspector.getByText(/bus +id +slot/).count(), 0);
  },
);

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

// A copy: its notes are written beside its descriptions.
const noted = mkdtempSync(join(tmpdir(), "berth-noted-"));
for (const name of ["belt.toml", "belt.plant.toml", "eds", "scripts"]) {
  cpSync(join(root, "examples", name), join(noted, name), { recursive: true });
}
machines.noted = [join(noted, "belt.toml"), join(noted, "belt.plant.toml")];
const notes = () => readFileSync(join(noted, "eds/belt.notes"), "utf8");

await check(
  "a note is written, and shows in the row, by name, in plots and trace",
  { machine: "noted", fresh: true, hash: "&pane=dictionary&slot=field/10" },
  async (page, berth, by) => {
    await by.button("Read all objects").click();
    await page.getByLabel("Search objects").fill("1017h");
    const row = page.locator(".object", { hasText: "1017h:00" });
    await row.click();
    await by.button("Edit note").click();
    await page.getByLabel("Text", { exact: true }).fill("How often it shows that it lives");
    await page.getByLabel("Unit", { exact: true }).fill("s");
    await page.getByLabel("One count is").fill("0.001");
    await page.getByLabel("Values", { exact: true }).fill("700 = slow\n100 = quick");
    const command = page.locator(".note .command code", { hasText: "berth note write" });
    assert.match(await command.innerText(), /--unit s --scale 0.001 --value 700=slow --value 100=quick --anew/);
    await by.button("Write note").click();
    await page.locator(".note .answer.good", { hasText: "note write: done" }).waitFor();
    assert.equal(
      notes(),
      '["1017h:00"]\ntext = "How often it shows that it lives"\nunit = "s"\nscale = 0.001\n' +
        'values = { 100 = "quick", 700 = "slow" }\n',
    );
    await page.locator(".inspector .reason", { hasText: "it lives" }).waitFor();
    await page.getByLabel("By name").selectOption({ label: "slow (700)" });
    assert.equal(await page.getByLabel("New value").inputValue(), "700");
    await by.button("Write").click();
    await row.locator("text=0.7 s, slow").waitFor();
    await page.locator(".names .on", { hasText: "slow" }).waitFor();
    await by.button("Watch").click();
    await by.tab("Plots").click();
    await page.locator(".watch tr", { hasText: "0.7 s, slow" }).waitFor();
    await page.getByRole("img", { name: "1017h:00, last" }).waitFor();
    await by.tab("Trace").click();
    await by.button("SDO folded").click();
    await by.type(page.getByLabel("Filter frames"), "1017h"); // else heartbeats push it out of sight
    await page.locator(".transfer .words", { hasText: "= 0.7 s, slow" }).first().waitFor();
    const { reply } = await berth.request("note read", { node: "belt", object: "1017h" });
    assert.equal(reply.own.unit, "s");
  },
);

await check(
  "a note goes with its last word, and what is wrong is told",
  { machine: "noted", hash: "&pane=dictionary&slot=field/10&object=1017h:00" },
  async (page, berth, by) => {
    await berth.request("note write", { node: "belt", object: "1017h", anew: "1", bits: "3=x" });
    await by.button("Edit note").click();
    const bits = page.getByLabel("Bits", { exact: true });
    await bits.fill("64 = none");
    await page.locator(".note .bad-text", { hasText: "bits have the numbers 0 to 63" }).waitFor();
    assert.equal(await by.button("Write note").count(), 0);
    await bits.fill("");
    await by.button("Remove note").click();
    await page.locator(".note .answer.good", { hasText: "note remove: done" }).waitFor();
    assert.equal(notes(), "");
  },
);
rmSync(noted, { recursive: true, force: true });

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
  "what is chosen stays in sight where the inspector takes room from its list",
  {
    machine: "belt",
    hash: "&pane=trace&mode=folded&filter=node+10+read+1018h",
    view: { width: 768, height: 1024 },
  },
  async (page, berth) => {
    for (let i = 0; i < 40; i++) await berth.request("sdo read", { node: "10", object: "1018h:01" });
    const reads = page.locator(".frame.transfer", { hasText: "2 frames" });
    await reads.nth(20).waitFor();
    await page.getByRole("button", { name: "▮▮ Pause", exact: true }).click();
    await page.locator(".pane .scroll").hover();
    await page.mouse.wheel(0, 5000);
    await reads.last().click();
    await page.locator(".frame.child.selected").waitFor();
    await page.evaluate(() => (window.location.hash = "#pane=dictionary&slot=field/10&object=6206h:02"));
    await page.getByRole("button", { name: "Read all objects" }).click();
    await page.locator(".object.selected", { hasText: "6206h:02" }).waitFor();
    const [list, row] = await Promise.all(
      [".pane .scroll", ".object.selected"].map((each) => page.locator(each).boundingBox()),
    );
    assert.ok(row.y + row.height <= list.y + list.height + 1, `${row.y} is below ${list.y} + ${list.height}`);
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
    await page.locator(".menu code", { hasText: "berth trace --ring --filter '70A#05' -o run.log -m" }).waitFor();
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

await check(
  "an opened log has bits, markers, folded transfers and an export, and the address stays the machine's",
  { machine: "belt", hash: "&pane=trace" },
  async (page, berth, by) => {
    const sdo = "(0000000002.000000) field 60A#4018100400000000\n(0000000002.000500) field 58A#4318100406000000\n";
    const log = `(0000000001.000000) field 70A#7F\n${sdo}(0000000003.000000) field 70A#05\n`;
    const buffer = Buffer.from(log);
    await page.getByLabel("Open a log", { exact: true }).setInputFiles({ name: "run.log", mimeType: "", buffer });
    const row = (text) => page.locator(".scroll .frame", { hasText: text });
    await row("58Ah").click();
    await page.getByRole("heading", { name: "Frame 2" }).waitFor();
    await page.locator(".bits .field", { hasText: "CRC" }).first().waitFor();
    await page.keyboard.press("m");
    await page.locator(".scroll .frame.marked.selected", { hasText: "+0.000000" }).waitFor();
    await row("+0.999500").waitFor();
    assert.doesNotMatch(page.url(), /frame=|marks=/);
    await page.keyboard.press("Escape");
    await by.button("SDO folded").click();
    const transfer = page.locator(".frame.transfer", { hasText: "06 00 00 00" });
    assert.match(await transfer.innerText(), /2 frames, 0\.50 ms/);
    await transfer.click();
    await page.locator(".frame.child").nth(1).waitFor();
    await by.type(page.getByLabel("Filter frames"), "70A#");
    await page.locator(".menu summary", { hasText: "Export" }).click();
    await page.locator(".menu code", { hasText: "berth trace run.log -o run.pcapng" }).waitFor();
    const coming = page.waitForEvent("download");
    await by.button("What is listed, as candump log").click();
    const saved = readFileSync(await (await coming).path(), "utf8");
    assert.equal(saved, "(0000000001.000000) field 70A#7F\n(0000000003.000000) field 70A#05\n");
    await page.locator(".menu summary", { hasText: "Export" }).click();
    await by.button("Close the file").click();
    await row("70Ah").first().waitFor();
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

await check(
  "an error frame is a red row that says where and who, and is counted in Plots and Machine",
  { machine: "belt", hash: "&pane=trace" },
  async (page, berth, by) => {
    await page.locator(".scroll .frame").first().waitFor();
    await berth.request("world damage", { bus: "field", frames: "2" });
    await by.type(page.getByLabel("Filter frames"), "error");
    const row = page.locator(".scroll .frame.service-error").first();
    await row.waitFor();
    // An EMCY has the word, too: what the ring has of them goes in front, and while the list runs a row becomes another's.
    await page.locator(".bar .number", { hasText: "in the whole ring" }).waitFor();
    await by.button("▮▮ Pause").click();
    const colour = (what) => what.evaluate((element) => window.getComputedStyle(element).color);
    const bad = await page.evaluate(() =>
      window.getComputedStyle(document.documentElement).getPropertyValue("--bad").trim(),
    );
    const rgb = bad.match(/[0-9a-f]{2}/gi).map((digits) => parseInt(digits, 16));
    assert.equal(await colour(row), `rgb(${rgb.join(", ")})`);
    await row.click();
    const inspector = page.locator(".inspector");
    await inspector.getByRole("heading", { name: /^Error \d/ }).waitFor();
    // The server's words: who signalled it, and who sent what.
    await inspector.locator("p", { hasText: /signalled first by .*; .* sent [0-9A-F]{3}h/ }).waitFor();
    await inspector.locator("dt", { hasText: "Where" }).waitFor();
    assert.equal(await page.locator(".bits").count(), 0);
    await by.tab("Plots").click();
    await page.getByRole("heading", { name: "Error frames a second" }).waitFor();
    await page.getByText(/field: \d+ error frames, error-active, TEC \d+, REC \d+/).waitFor();
    await by.tab("Machine").click();
    await page.locator(".bus-name", { hasText: /\d+ error frames/ }).waitFor();
  },
);

/** Two error frames, and what else comes until the page has them. */
async function damaged(berth, page, filter) {
  await page.locator(".scroll .frame").first().waitFor();
  await berth.request("world damage", { bus: "field", frames: "2" });
  await page.getByLabel("Filter frames").fill(filter);
  await page.locator(".scroll .frame.service-error").nth(1).waitFor();
}

/** From the next loading of the page on its frames of the server's ring are held back, until somebody lets them come. */
async function heldRing(page) {
  const held = [];
  await page.routeWebSocket(/\/api\/v1\/socket/, (route) => {
    const server = route.connectToServer();
    server.onMessage((message) => {
      const ofRing = typeof message === "string" && /"type": ?"frames"/.test(message) && !/"words/.test(message);
      if (ofRing) held.push(() => route.send(message));
      else route.send(message);
    });
  });
  await page.evaluate(() => (window.location.hash = "#pane=trace"));
  await page.reload();
  return async () => {
    // What was there before the page, and what the filter found.
    while (held.length < 2) await page.waitForTimeout(50);
    for (const send of held.splice(0)) send();
    await page.locator(".bar .number", { hasText: "in the whole ring" }).waitFor();
  };
}

const firstCell = async (row) => (await row.locator("span").first().innerText()).trim();

for (const mode of ["Chronological", "SDO folded"]) {
  await check(
    `older frames that come late leave the rows of a paused list where they are: ${mode}`,
    { machine: "belt", hash: "&pane=trace" },
    async (page, berth, by) => {
      // Of these the new page knows nothing, until the server's ring has answered.
      await damaged(berth, page, "error");
      const release = await heldRing(page);
      await by.button(mode).click();
      await damaged(berth, page, "error");
      await by.button("▮▮ Pause").click();
      const first = page.locator(".scroll .frame.service-error").first();
      const name = await firstCell(first);
      const { y } = await first.boundingBox();
      await release();
      const row = page.locator(".scroll .frame.service-error", { hasText: name });
      assert.equal((await row.boundingBox()).y, y, "the row moved");
      // The older ones are above it, a turn of the wheel away.
      const box = page.locator(".middle .scroll");
      const offset = await box.evaluate((element) => element.scrollTop);
      assert.ok(offset > 0 && offset % 24 === 0, `scrolled by ${offset}`);
      await row.click();
      await page.locator(".inspector dd", { hasText: name }).waitFor();
      assert.equal((await row.boundingBox()).y, y, "the press moved the row");
      await box.evaluate((element) => (element.scrollTop = 0));
      await page.waitForFunction(
        (shown) => document.querySelector(".scroll .frame span")?.textContent?.trim() !== shown,
        name,
      );
      assert.ok(Number(await firstCell(page.locator(".scroll .frame").first())) < Number(name));
    },
  );
}

await check(
  "older frames that come late leave a chosen row where it is, also when there are many",
  { machine: "belt", hash: "&pane=trace" },
  async (page) => {
    const release = await heldRing(page);
    await page.getByLabel("Filter frames").fill("heartbeat");
    await page.locator(".scroll .frame").nth(2).click();
    const chosen = page.locator(".scroll .frame.selected");
    await chosen.waitFor();
    const name = await firstCell(chosen);
    const { y } = await chosen.boundingBox();
    await release();
    const box = page.locator(".middle .scroll");
    const { top, height } = await box.evaluate((e) => ({ top: e.scrollTop, height: e.clientHeight }));
    assert.ok(top > height, `only ${top / 24} came`);
    await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
    assert.equal(await firstCell(chosen), name);
    assert.equal((await chosen.boundingBox()).y, y);
  },
);

await check(
  "older frames that come late do not lengthen a paused list: what is newer than the pause stays out",
  { machine: "belt", hash: "&pane=trace" },
  async (page, _, by) => {
    const release = await heldRing(page);
    await page.getByLabel("Filter frames").fill("18B#");
    await page.locator(".scroll .frame", { hasText: "18Bh" }).nth(3).waitFor();
    await by.button("▮▮ Pause").click();
    const last = page.locator(".scroll .frame").last();
    const name = await firstCell(last);
    await page.locator(".bar .number", { hasText: /, \d+ new/ }).waitFor();
    await release();
    await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
    assert.equal(await firstCell(last), name);
  },
);

/** How many of these words stand in rows of the trace, and how many of them are cut off. */
const cutOff = (page, words) =>
  page.locator(".scroll .frame > .words").evaluateAll((cells, wanted) => {
    const seen = { shown: 0, cut: 0 };
    for (const cell of cells) {
      const texts = document.createTreeWalker(cell, window.NodeFilter.SHOW_TEXT);
      while (texts.nextNode()) {
        const at = texts.currentNode.data.search(new RegExp(wanted));
        if (at < 0) continue;
        const range = document.createRange();
        range.setStart(texts.currentNode, at);
        range.setEnd(texts.currentNode, texts.currentNode.data.length);
        const { right } = range.getBoundingClientRect();
        let box = texts.currentNode.parentElement;
        while (box !== cell && window.getComputedStyle(box).overflow === "visible") box = box.parentElement;
        seen.shown++;
        if (right > box.getBoundingClientRect().right + 0.5) seen.cut++;
      }
    }
    return seen;
  }, words);

for (const [width, height] of [
  [1280, 800],
  [768, 1024],
]) {
  await check(
    `values and the reason of an abort are never cut at ${width}×${height}: names give way`,
    { machine: "signals", view: { width, height }, hash: "&pane=trace" },
    async (page, berth, by) => {
      const all = async (words) => {
        const { shown, cut } = await cutOff(page, words);
        assert.ok(shown > 0, `no ${words} is shown`);
        assert.equal(cut, 0, `${cut} of ${shown} ${words} are cut off`);
      };
      const filter = page.getByLabel("Filter frames");
      await filter.fill("183#");
      const row = page.locator(".scroll .frame", { hasText: "183h" }).last();
      await row.waitFor();
      // The engine's gateway sends the torque: of a long name one value.
      await all("\\d+$");
      await by.button("▮▮ Pause").click();
      await row.locator("button.signal").first().waitFor();
      await all("\\d+$");
      await berth.request("sdo write", { bus: "backbone", node: "engine", object: "1018h:01", value: "5" });
      await by.button("▶ Go on").click();
      await filter.fill("abort 1018h");
      const abort = page.locator(".scroll .frame.service-abort").last();
      await abort.waitFor();
      await all("attempt to write a read-only object");
      assert.equal(
        await page.locator(".inspector:visible").count(),
        0,
        "nothing is chosen, and the inspector is there",
      );
      const { y } = await abort.boundingBox();
      await abort.click();
      await page.locator(".inspector h2", { hasText: "Frame" }).waitFor();
      if (width > 900) assert.equal((await abort.boundingBox()).y, y, "the inspector moved the row");
      await all("attempt to write a read-only object");
    },
  );
}

// ---- plots ----

await check(
  "a signal of a PDO is plotted from its frames, and plot and trace lead to each other",
  { machine: "belt", fresh: true, hash: "&pane=trace" },
  async (page, berth, by) => {
    await by.type(page.getByLabel("Filter frames"), "18B#");
    await page.locator(".scroll .frame", { hasText: "18Bh" }).first().waitFor();
    await by.button("▮▮ Pause").click();
    const row = page.locator(".scroll .frame", { hasText: "18Bh" }).last();
    const chip = row.locator("button.signal").first();
    const shown = (await chip.locator("b").innerText()).trim();
    await chip.click();
    await page.waitForURL(/signal=field%2F18B\+0/);
    await row.locator("span").first().click();
    await page.getByRole("heading", { name: /^Frame/ }).waitFor();
    const value = await page.locator(".signals td.number").first().innerText();
    assert.equal(value, shown);
    const frame = await page.getByRole("heading", { name: /^Frame/ }).innerText();
    await by.button("Its place in the plot").click();
    const table = page.locator(".plots .watch", { hasText: "TPDO 1" });
    await table.locator("tr", { hasText: "barrier" }).waitFor();
    await page.locator(".chart-mark").waitFor();
    // Back: a press beside the mark goes to the frame that stands there.
    const mark = await page.locator(".chart-mark").boundingBox();
    await page.mouse.click(mark.x, mark.y + mark.height / 2);
    await page.getByRole("heading", { name: frame, exact: true }).waitFor();
    await page.locator(".scroll .frame.selected", { hasText: "18Bh" }).waitFor();
    assert.match(page.url(), /pane=trace/);
  },
);

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
  "a paused world is told in every pane, and runs again from there",
  { machine: "belt", hash: "&pane=slots" },
  async (page, berth, by) => {
    const banner = page.locator(".top-bar", { hasText: "the world is paused" });
    await by.row("barrier").first().waitFor();
    assert.equal(await banner.count(), 0);
    await berth.request("world pause");
    await banner.waitFor();
    await by.tab("Trace").click();
    await banner.waitFor();
    assert.match(await by.button("Run the world").getAttribute("title"), /^berth world run -m /);
    await by.button("Run the world").click();
    await banner.waitFor({ state: "detached" });
    const { world } = await berth.snapshot();
    assert.equal(world.paused, false);
  },
);

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

const piecesOf = async (berth) => (await berth.request("sim", { action: "devices" })).reply.cables[0].pieces;

await check(
  "a cable is cut and mended, and a device's own wire",
  { machine: "belt", hash: "&pane=world&slot=field/11" },
  async (page, berth, by) => {
    await by.button("Cut the cable before barrier").click();
    await page.locator(".pane .answer.good", { hasText: "bus field is cut (light barrier)" }).waitFor();
    await state(page, "absent");
    assert.deepEqual(await piecesOf(berth), [["belt", "master"], ["light barrier"]]);
    await page.getByRole("button", { name: /^Copy command: berth sim fault join --bus field/ }).waitFor();
    await by.button("Mend the cable of field").click();
    await state(page, "operational");
    await operational(berth);
    await by.button("Cut the cable before belt").click();
    await page.locator(".plug.off").nth(1).waitFor();
    assert.deepEqual(await piecesOf(berth), [["master"], ["belt", "light barrier"]]);
    await by.button("Mend the cable of field").click();
    await operational(berth);
    await page.locator(".tools button", { hasText: "belt" }).first().click();
    await by.button("Cut its wire").click();
    await page.locator(".plug.hangs", { hasText: "belt" }).waitFor();
    assert.deepEqual(await piecesOf(berth), [["light barrier", "master"], ["belt"]]);
    await by.button("Mend the cable of field").click();
    await operational(berth);
  },
);

await check(
  "a device is deaf until it recovers, is reset, and its frames are damaged",
  { machine: "belt", hash: "&pane=world&slot=field/11" },
  async (page, berth, by) => {
    await by.button("Deaf").click();
    await page.getByText("light barrier: has power, deaf").waitFor();
    await by.button("Slow by 50 ms").click();
    await page.getByText("light barrier: has power, deaf, slow by 50 ms").waitFor();
    await by.button("Neither deaf nor slow").click();
    await page.getByText(/light barrier: has power$/).waitFor();
    await page.getByLabel("Frames that a press damages").fill("3");
    await by.button("Damage the next 3 frames it sends").click();
    await page.locator(".pane .answer.good", { hasText: "only frames that light barrier sends" }).waitFor();
    await page.getByLabel("Frames that a press damages").fill("0");
    assert.equal(await page.getByRole("button", { name: /^Damage/ }).count(), 0);
    await by.button("Reset").click();
    await page.locator(".pane .answer.good", { hasText: "light barrier is reset" }).waitFor();
    await operational(berth);
  },
);

await check(
  "a device without a slot is plugged in",
  { machine: "twins", fresh: true, ready: ["left", "right"], hash: "&pane=world" },
  async (page, berth, by) => {
    await page.locator(".tools button", { hasText: "spare gate" }).click();
    await page.getByText("spare gate: not plugged in").waitFor();
    await by.button("Plug in").click();
    await page.getByText("spare gate: has power").waitFor();
    const { reply } = await berth.request("sim", { action: "devices" });
    assert.equal(reply.devices.find(({ device }) => device === "spare gate").plugged, true);
  },
);

await check(
  "in the drawing the line is cut and mended by a press, and a stub is a plug",
  { machine: "belt", fresh: true, hash: "&pane=machine" },
  async (page, berth) => {
    await page.locator(".wires .line-hit rect").first().click();
    await page.locator(".wires .cut-mark").first().waitFor();
    await page.getByRole("button", { name: /^Copy command: berth sim fault cut-cable/ }).waitFor();
    await page.locator('.slot-box[aria-label*="absent"]').nth(1).waitFor();
    assert.deepEqual(await piecesOf(berth), [["master"], ["belt", "light barrier"]]);
    await page.locator(".wires .cut-mark rect").last().click();
    await operational(berth);
    await page.locator(".wires .plug-hit", { hasText: "light barrier" }).locator("rect").click();
    await page.locator('.slot-box[aria-label*="barrier"][aria-label*="absent"]').waitFor();
    await page.locator(".wires .plug-hit.out rect").click();
    await operational(berth);
  },
);

await check("a page of role view has no wires to press", { machine: "belt", hash: "" }, async (page, berth) => {
  const { token_file } = await berth.snapshot();
  const token = readFileSync(`${token_file}.view`, "utf8").trim();
  const other = await openPage(browser, `${berth.address}#token=${token}&pane=machine`);
  await other.page.locator(".wires .plug-hit rect").first().waitFor({ state: "attached" });
  await other.page.locator(".wires .plug-hit rect").first().click();
  assert.equal(await other.page.locator(".wires.may").count(), 0);
  const { reply } = await berth.request("sim", { action: "devices" });
  assert.ok(reply.devices.every(({ plugged }) => plugged));
  assert.deepEqual(other.errors, []);
  await other.context.close();
});

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
    await silent.locator("text=does it have power").waitFor();
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

/** What comes to this page by its WebSocket, in bytes and messages, from now on. */
async function incoming(page) {
  const session = await page.context().newCDPSession(page);
  const came = { bytes: 0, messages: 0, snapshots: 0 };
  await session.send("Network.enable");
  session.on("Network.webSocketFrameReceived", ({ response: { opcode, payloadData } }) => {
    came.messages++;
    came.bytes += opcode === 2 ? (payloadData.length * 3) / 4 : payloadData.length;
    if (payloadData.startsWith('{"type":"snapshot"')) came.snapshots++;
  });
  return { session, came };
}

/**
 * The processes that run pages get no processor time, as those of a tab asleep: nothing is read, nothing runs. (Chromium's
 * own Page.setWebLifecycleState leaves a page that is visible as it is.) Returns what wakes them.
 */
async function asleepPages() {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  const pids = processInfo.filter(({ type }) => type === "renderer").map(({ id }) => id);
  assert.ok(pids.length > 0);
  for (const pid of pids) process.kill(pid, "SIGSTOP");
  return () => {
    for (const pid of pids) process.kill(pid, "SIGCONT");
  };
}

const heapOf = async (session) => {
  await session.send("HeapProfiler.collectGarbage");
  return (await session.send("Runtime.getHeapUsage")).usedSize;
};

await check(
  "a tab that slept for an hour of the machine's time is right again, without a flood",
  { machine: "belt", fresh: true, hash: "&pane=trace" },
  async (page, berth) => {
    await page.locator(".scroll .frame").nth(3).waitFor();
    const { session, came } = await incoming(page);
    await session.send("Runtime.enable");
    const heap = await heapOf(session);
    await page.evaluate(() => {
      window.ticks = 0;
      setInterval(() => window.ticks++, 50);
    });
    const asleep = performance.now();
    const { time_s: slept } = await berth.snapshot();
    const wake = await asleepPages();
    try {
      await berth.request("sim", { action: "unplug", device: "light barrier" });
      await berth.request("world speed", { factor: "1000" });
      for (let look = 0; look < 600; look++) {
        if ((await berth.snapshot()).time_s > slept + 3600) break;
        await new Promise((resolve) => setTimeout(resolve, 200));
      }
      await berth.request("world speed", { factor: "1" });
    } finally {
      wake();
    }
    const slices = (performance.now() - asleep) / 50;
    const [bytes, messages] = [came.bytes, came.messages];
    assert.ok((await berth.snapshot()).time_s > slept + 3600);
    assert.ok((await page.evaluate(() => window.ticks)) < slices / 2, "the page was asleep");
    // What is on the screen is now: the newest frames, the slot that went away meanwhile, the time.
    await page.locator('.tree button[aria-label*="absent"], .tree button', { hasText: "barrier" }).first().waitFor();
    await page.waitForFunction(
      (since) =>
        Number(/[\d.]+/.exec(document.querySelector(".scroll .frame:last-child")?.textContent ?? "")?.[0]) > since,
      slept + 3600,
    );
    await page.getByRole("button", { name: "1 needs somebody" }).waitFor();
    console.log(
      `      asleep: ${(bytes / 1e6).toFixed(1)} MB in ${messages} messages meanwhile, ` +
        `${((came.bytes - bytes) / 1e6).toFixed(1)} MB after waking, ${came.snapshots} snapshots`,
    );
    const grown = (await heapOf(session)) - heap;
    assert.ok(grown < 100e6, `the page took ${grown} bytes more`);
    assert.ok(came.bytes < 64e6, `${came.bytes} bytes came`);
    await berth.request("sim", { action: "plug", device: "light barrier" });
    await page.waitForFunction(() => !document.body.textContent.includes("needs somebody"));
  },
);

await check(
  "a server that is started anew under an open page is found again, with its frames",
  { machine: "belt", fresh: true, refused: 401 },
  async (_, first) => {
    const folder = mkdtempSync(join(tmpdir(), "berth-tokens-"));
    const more = ["--studio-tokens", join(folder, "tokens")];
    const where = new URL(first.address).host.replace(/\d+$/, (port) => String(Number(port) + 1));
    let berth = await startBerth(...machines.belt, more, where);
    await operational(berth);
    const { page, context, errors } = await openPage(browser, `${berth.url}&pane=trace`);
    page.setDefaultTimeout(30_000);
    await page.locator(".scroll .frame").nth(3).waitFor();
    await berth.request("world speed", { factor: "20" });
    const lastOf = () =>
      page.evaluate(() => {
        const all = [...document.querySelectorAll(".scroll .frame")].map((row) => parseFloat(row.textContent));
        return Math.max(0, ...all.filter((time) => !Number.isNaN(time)));
      });
    await page.waitForFunction(() => parseFloat(document.querySelector(".scroll .frame:last-child").textContent) > 60);
    await berth.close();
    await page.getByText(/No connection/).waitFor();
    berth = await startBerth(...machines.belt, more, where);
    await operational(berth);
    await page.waitForFunction(() => !/No connection/.test(document.body.textContent));
    await page.locator(".scroll .frame").nth(3).waitFor();
    await page.waitForFunction(() => parseFloat(document.querySelector(".scroll .frame:last-child").textContent) < 60);
    assert.ok((await lastOf()) < 60, "the frames are those of the new start");
    await berth.close();
    await page.getByText(/No connection/).waitFor();
    // Another token: the page says so, and takes the new address.
    berth = await startBerth(...machines.belt, [], where);
    await page.getByText("The server refuses this page's token").waitFor();
    await page.getByLabel("Address or token").fill(berth.url);
    await page.getByRole("button", { name: "Open", exact: true }).click();
    await page.waitForSelector(".tabs");
    await operational(berth);
    await page.locator(".scroll .frame").nth(3).waitFor();
    const unexpected = errors.filter(
      (error) => !/ERR_CONNECTION_REFUSED|WebSocket connection|status of 401/.test(error),
    );
    assert.deepEqual(unexpected, []);
    await context.close();
    await berth.close();
    rmSync(folder, { recursive: true, force: true });
  },
);

await check("a description of 10 MB: every object is there, and found as one types", { machine: "belt" }, async () => {
  const OBJECTS = 16_000;
  const big = bigMachine(OBJECTS, 10_500_000);
  const berth = await startBerth(...big.files);
  try {
    assert.ok(big.bytes > 10_000_000);
    await operational(berth);
    const { page, context, errors } = await openPage(browser, `${berth.url}&pane=dictionary&slot=field/1`);
    await page.getByRole("button", { name: "Read all objects" }).click();
    const begun = performance.now();
    await page.waitForFunction(
      (most) =>
        Number(/of ([\d,]+)/.exec(document.querySelector(".bar .number")?.textContent ?? "")?.[1]?.replace(/,/g, "")) >
        most,
      OBJECTS,
      { timeout: 300_000 },
    );
    console.log(
      `      ${big.bytes} bytes, ${OBJECTS} objects read in ${((performance.now() - begun) / 1000).toFixed(1)} s`,
    );
    await page.getByLabel("Search objects").fill("limit 15999");
    const row = page.locator(".object", { hasText: "Limit 15999" });
    await row.click();
    await page.getByLabel("New value").fill("4711");
    await page.getByRole("button", { name: "Write", exact: true }).click();
    await row.locator("text=4711").waitFor();
    assert.equal(await page.locator(".scroll .object").count(), 1);
    await page.getByLabel("Search objects").fill("");
    await page.locator(".scroll .object").nth(5).waitFor();
    assert.ok((await page.locator(".scroll .object").count()) < 200, "only what is seen is drawn");
    assert.deepEqual(errors, []);
    await context.close();
  } finally {
    await berth.close();
    big.end();
  }
});

await check(
  "names that are HTML or control characters are shown, and nothing of them runs",
  { machine: "belt" },
  async () => {
    const strange = oddMachine();
    const berth = await startBerth(...strange.files);
    try {
      await operational(berth);
      const { page, context, errors } = await openPage(browser, `${berth.url}&pane=machine&slot=field/1`);
      const dialogs = [];
      page.on("dialog", (dialog) => (dialogs.push(dialog.message()), dialog.dismiss()));
      await page.getByText(odd.machine).first().waitFor();
      const shown = odd.slot.replace("\u202E", "\\u202e");
      await page.locator(".inspector h2", { hasText: shown }).waitFor();
      for (const pane of ["slots", "world", "network", "trace", "plots", "doctor", "dictionary"]) {
        await page.evaluate((hash) => (window.location.hash = hash), `#pane=${pane}&slot=field/1`);
        await page.locator(`.pane-${pane}`).waitFor();
      }
      await page.getByRole("button", { name: "Read all objects" }).click();
      await page.locator(".object", { hasText: "1008h" }).locator("text=<svg onload=alert(5)>").first().waitFor();
      await page.evaluate(() => (window.location.hash = "#pane=world&slot=field/1"));
      await page.getByRole("button", { name: "Unplug", exact: true }).click();
      await page.locator(".pane .answer.good", { hasText: odd.device }).waitFor();
      await page.locator(".inspector .need-box").waitFor();
      const foreign = await page.locator("b[onclick], svg[onload], img, body script, i").count();
      assert.equal(foreign, 0);
      const words = await page.evaluate(() => document.body.innerText);
      const hidden = ["\x07", "\x1b", "\u202e"].some((character) => words.includes(character));
      assert.equal(hidden, false, "a control character is shown as what it is");
      assert.deepEqual(dialogs, []);
      assert.deepEqual(errors, []);
      await context.close();
    } finally {
      await berth.close();
      strange.end();
    }
  },
);

await check("the palette finds a slot by the keyboard", {}, async (page) => {
  await page.keyboard.press("Control+k");
  await page.keyboard.type("quay belt");
  await page.keyboard.press("Enter");
  await page.locator(".inspector h2", { hasText: "quay belt" }).waitFor();
});

await newcomerActs(check, browser);

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
  "plots&watch=field/32+1017h:00&signal=field/1A0+0",
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
for (const line of told) console.log(line);
console.log(`${passed} passed, ${failed} failed`);
if (summary) writeFileSync(summary, `${passed} ${failed} 0\n`);
process.exitCode = failed ? 1 : 0;
