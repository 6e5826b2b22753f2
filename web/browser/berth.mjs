/** A Berth of its own for each test: a machine of examples/ on the simulator, in a folder that goes with it. */
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve as absolute } from "node:path";
import { fileURLToPath } from "node:url";

export const root = fileURLToPath(new URL("../../", import.meta.url));
export const binary = process.env.BERTH_BINARY ?? join(root, "build/test/berth");

/** Paths of machine and plant begin at the repository's root. `where`: the address; else any free port. */
export async function startBerth(machine, plant, more = [], where = "127.0.0.1:0") {
  const folder = mkdtempSync(join(tmpdir(), "berth-studio-"));
  const words = ["up", absolute(root, machine), "--sim", absolute(root, plant), `--studio=${where}`];
  const child = spawn(binary, [...words, "--control", join(folder, "control"), ...more], {
    cwd: folder,
    env: { ...process.env, XDG_RUNTIME_DIR: folder },
    stdio: ["ignore", "pipe", "pipe"],
  });
  // Whatever ends this process: none is left behind.
  const kill = () => child.kill("SIGKILL");
  process.on("exit", kill);
  let said = "";
  const ended = new Promise((resolve) => child.on("exit", (code) => resolve(code)));
  const url = await new Promise((resolve, reject) => {
    const hear = (data) => {
      said += data;
      const found = /http:\/\/\S+#token=[0-9a-f]+/.exec(said);
      if (found) resolve(found[0]);
    };
    child.stdout.on("data", hear);
    child.stderr.on("data", hear);
    child.on("error", reject);
    child.on("exit", () => reject(new Error(`berth ended before it was there: ${said}`)));
  });
  const [address, token] = url.split("#token=");
  return {
    url,
    address,
    said: () => said,
    /** Asked past the page, as another program would. */
    async request(verb, values = {}) {
      const answer = await fetch(`${address}api/v1/request`, {
        method: "POST",
        headers: { Authorization: `Bearer ${token}`, Origin: address.slice(0, -1) },
        body: JSON.stringify({ verb, arguments: values }),
      });
      return answer.json();
    },
    async snapshot() {
      const answer = await fetch(`${address}api/v1/snapshot`, { headers: { Authorization: `Bearer ${token}` } });
      return answer.json();
    },
    async close() {
      child.kill("SIGTERM");
      const code = await ended;
      process.off("exit", kill);
      rmSync(folder, { recursive: true, force: true });
      return code;
    },
  };
}

const LOOKS = 600;

/** Until every slot is operational, but those named; with `gone` until these are not. */
export async function operational(berth, but = [], gone = false) {
  let others = [];
  for (let look = 0; look < LOOKS; look++) {
    const { slots } = await berth.snapshot();
    const good = (slot) => (slot.state === "operational") !== (gone && but.includes(slot.name));
    others = slots.filter((slot) => !good(slot) && (gone || !but.includes(slot.name)));
    if (!others.length) return;
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
  throw new Error(`not operational: ${others.map((slot) => `${slot.name}: ${slot.state}`).join(", ")}`);
}
