/** Size of the built pages, as they are and by gzip: node tools/size.mjs. More than 700 kB compressed is an error. */
import { readdirSync, readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";

const MOST = 700_000;
const files = (folder) =>
  readdirSync(folder).flatMap((name) => {
    const path = join(folder, name);
    return statSync(path).isDirectory() ? files(path) : [path];
  });
let plain = 0;
let packed = 0;
for (const path of files("dist")) {
  const content = readFileSync(path);
  plain += content.length;
  packed += gzipSync(content, { level: 9 }).length;
}
console.log(`web/dist: ${plain} bytes, ${packed} by gzip`);
process.exitCode = packed > MOST ? 1 : 0;
