/** Drawn frames a second with four buses at 8,000 frames/s each: node browser/load.mjs [frames/s in all] [seconds] */
import { startMock } from "../mock/server.mjs";
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
  const result = await page.evaluate(async (seconds) => {
    const times = [];
    const end = performance.now() + seconds * 1000;
    await new Promise((resolve) => {
      const draw = (now) => {
        times.push(now);
        if (performance.now() < end) requestAnimationFrame(draw);
        else resolve();
      };
      requestAnimationFrame(draw);
    });
    const gaps = times.slice(1).map((time, i) => time - times[i]);
    const sorted = [...gaps].sort((a, b) => a - b);
    return {
      drawn: (gaps.length / (times[times.length - 1] - times[0])) * 1000,
      p99: sorted[Math.floor(sorted.length * 0.99)],
      text: document.querySelector(".bar .number").textContent,
    };
  }, length);
  const sent = (mock.machine.next - before) / length;
  const { drawn, p99, text } = result;
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
