/** Drawn frames a second with four buses at 8,000 frames/s each: node browser/load.mjs [frames/s in all] [seconds] */
import { startMock } from "../mock/server.mjs";
import { drawnIn } from "./drawn.mjs";
import { launch, openPage } from "./open.mjs";

const rate = Number(process.argv[2] ?? 32000);
const length = Number(process.argv[3] ?? 8);
const browser = await launch();
const mock = await startMock({ example: "conveyor", done: true, rate, buses: 4 });
let failed = false;
for (const mode of ["chronological", "latest", "chronological&filter=heartbeat"]) {
  const { page, errors, context } = await openPage(browser, `${mock.url}&pane=trace&mode=${mode}`);
  await page.waitForTimeout(2500);
  const before = mock.machine.next;
  const { drawn, p99 } = await page.evaluate(drawnIn, length);
  const text = await page.locator(".bar .number").first().textContent();
  const sent = (mock.machine.next - before) / length;
  console.log(
    `${mode}: ${drawn.toFixed(1)} drawn/s, 99 % within ${p99.toFixed(1)} ms, ${sent.toFixed(0)} frames/s sent; ${text}`,
  );
  if (errors.length) console.log(errors);
  failed ||= drawn < 50;
  await context.close();
}
await mock.close();
await browser.close();
process.exitCode = failed ? 1 : 0;
