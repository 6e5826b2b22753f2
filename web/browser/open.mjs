import { existsSync, readFileSync } from "node:fs";
import { extname } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";
import { CSP, types } from "../mock/server.mjs";

const dist = fileURLToPath(new URL(`../${process.env.STUDIO_PAGES}`, import.meta.url));

/** STUDIO_PAGES=dist: the pages as `npm run build` made them last (a folder of web/), with what the server at this address answers. */
function ofDist(route) {
  const { pathname } = new URL(route.request().url());
  const path = dist + (pathname === "/" ? "/index.html" : pathname);
  if (pathname.startsWith("/api/") || !existsSync(path)) return route.fallback();
  const headers = { "Content-Type": types[extname(path)] ?? "", "Content-Security-Policy": CSP };
  return route.fulfill({ body: readFileSync(path), headers });
}

/** Debian's own Chromium; nothing is downloaded. */
export function launch() {
  // A page that no server sent counts as one of elsewhere, which may not ask this computer.
  const more = process.env.STUDIO_PAGES ? ["--disable-features=LocalNetworkAccessChecks"] : [];
  const args = ["--no-sandbox", ...more];
  return chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium", args });
}

/** A page that reports every error of its console, those of the CSP included. */
export async function openPage(browser, url, { width = 1280, height = 800, dark = false, touch = false } = {}) {
  const context = await browser.newContext({
    viewport: { width, height },
    colorScheme: dark ? "dark" : "light",
    hasTouch: touch,
    reducedMotion: "reduce",
  });
  if (process.env.STUDIO_PAGES) await context.route("**/*", ofDist);
  const page = await context.newPage();
  const errors = [];
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("pageerror", (error) => errors.push(String(error)));
  await page.goto(url);
  await page.waitForSelector(".window, .token-page");
  return { page, errors, context };
}
