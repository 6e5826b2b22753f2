/** Machines that are too much or too odd, written for a test into a folder of their own. */
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { root } from "./berth.mjs";

const sensor = () => readFileSync(join(root, "examples/eds/sensor.eds"), "latin1");

/** Machine and plant file of one device with this description; `end` takes the folder away. */
function machineOf(eds, { name, slot, device, rate = 1_000_000 }) {
  const folder = mkdtempSync(join(tmpdir(), "berth-bad-"));
  const toml = (text) => JSON.stringify(text);
  const [machine, plant] = [join(folder, "machine.toml"), join(folder, "plant.toml")];
  writeFileSync(join(folder, "device.eds"), eds, "latin1");
  writeFileSync(
    machine,
    `[machine]\nname = ${toml(name)}\n[bus.field]\nport = "sim"\nbitrate = ${rate}\nmaster_id = 127\n` +
      `[[slot]]\nbus = "field"\nid = 1\nname = ${toml(slot)}\neds = "device.eds"\n`,
  );
  writeFileSync(
    plant,
    `[plant]\nseed = 1\n[bus.field]\n[[device]]\nbus = "field"\nname = ${toml(device)}\neds = "device.eds"\n` +
      'serial = 1\nresponse = "0.1 ms"\n',
  );
  return { files: [machine, plant], end: () => rmSync(folder, { recursive: true, force: true }) };
}

/** A description of `objects` objects beside the sensor's, filled up with comments to this many bytes. */
export function bigMachine(objects, bytes) {
  const numbers = Array.from({ length: objects }, (_, i) => (0x2000 + i).toString(16).toUpperCase());
  const list = numbers.map((number, i) => `${i + 1}=0x${number}`).join("\n");
  const sections = numbers.map(
    (number, i) =>
      `[${number}]\nParameterName=Limit ${i}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=${i}\nPDOMapping=0\n`,
  );
  const head = sensor().replace(/\[ManufacturerObjects\][\s\S]*$/, "");
  const text = `${head}\n[ManufacturerObjects]\nSupportedObjects=${objects}\n${list}\n\n${sections.join("\n")}`;
  const comment = `;${"x".repeat(199)}\n`;
  const eds = text + comment.repeat(Math.max(0, Math.ceil((bytes - text.length) / comment.length)));
  return { bytes: eds.length, ...machineOf(eds, { name: "big", slot: "big", device: "big" }) };
}

/** What a browser would run, and what a terminal or a reader of text would obey. */
export const odd = {
  machine: "<img src=x onerror=alert(1)>",
  slot: "<b onclick=alert(2)>quay<b> \u202Eback",
  device: "'\"><script>alert(3)<script> ${alert(4)}",
  told: "<svg onload=alert(5)>\x07\x1b[31m<i>red</i>",
};

/** Names of machine, slot and device that are HTML; the device tells such a name and control characters in 1008h. */
export function oddMachine() {
  const eds = sensor().replace(/^(\[1008\][\s\S]*?DefaultValue=).*$/m, (_, before) => before + odd.told);
  return machineOf(eds, { name: odd.machine, slot: odd.slot, device: odd.device });
}
