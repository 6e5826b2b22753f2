import { csv } from "../../parts/download";
import type { Frame } from "../../protocol/batch";
import { frameOf } from "../../protocol/batch";
import { quoted } from "../../protocol/command";
import { bytes } from "../../protocol/text";
import { meaningIn, type Known, type Piece } from "./reducer";

/** Formats in which the server writes its ring, as `berth trace` does. */
export const ringFormats = [
  { format: "candump", ending: "log", words: "candump log" },
  { format: "pcapng", ending: "pcapng", words: "pcapng" },
  { format: "asc", ending: "asc", words: "Vector ASC" },
  { format: "trc", ending: "trc", words: "PEAK TRC 2.1" },
  { format: "trc1.1", ending: "trc", words: "PEAK TRC 1.1" },
] as const;

export const ringPath = (format: string, filter: string): string =>
  `/api/v1/trace?format=${format}${filter && `&filter=${encodeURIComponent(filter)}`}`;

/** A file that was opened is on the computer of who sits here: its command line writes it in another format. */
export const fileCommand = (name: string): string =>
  `berth trace ${quoted(name)} -o ${quoted(`${name.replace(/(\.[^.]*)?(\.gz)?$/, "")}.pcapng`)}`;

/** For a shell on the server's computer. Tokens stand beside the control socket, by which a machine without a file is found. */
export function ringCommand(filter: string, machineFile: string, tokenFile: string): string {
  const socket = tokenFile.replace(/\.token(\.\w+)?$/, "") || "SOCKET";
  const machine = machineFile ? `-m ${quoted(machineFile)}` : `--control ${quoted(socket)}`;
  const found = filter ? ` --filter ${quoted(filter)}` : "";
  return `berth trace --ring${found} -o run.log ${machine}`;
}

/** The frames that the filter lets through; with `slot` ("field/12") only those of this node. */
export function exported(pieces: readonly Piece[], known: Known, slot = ""): Frame[] {
  const at = slot.lastIndexOf("/");
  const bus = slot.slice(0, at);
  const node = Number(slot.slice(at + 1));
  const frames = pieces.flatMap(({ batch, rows, count }) =>
    Array.from({ length: count }, (_, i) => frameOf(batch, rows ? (rows[i] ?? 0) : i)),
  );
  if (!slot) return frames;
  return frames.filter((frame) => known.buses[frame.bus] === bus && meaningIn(frame, known).node === node);
}

const idOf = (frame: Frame): string =>
  ((frame.error ? 0x20000000 : 0) + frame.id)
    .toString(16)
    .toUpperCase()
    .padStart(frame.extended || frame.error ? 8 : 3, "0");

/** As `candump -L` writes it, error frames too. A name of a bus is one word there. What is cut is no frame: `whole`. */
export function candumpLog(frames: readonly Frame[], known: Known): string {
  return frames
    .map((frame) => {
      const bus = (known.buses[frame.bus] ?? "").replace(/\s+/g, "_") || "can0";
      const data = frame.remote ? `R${frame.data.length || ""}` : bytes(frame.data).replace(/ /g, "");
      return `(${frame.seconds.toFixed(6).padStart(17, "0")}) ${bus} ${idOf(frame)}#${data}\n`;
    })
    .join("");
}

/** Without FD frames of more than eight bytes, of which this page has the first ones. */
export const whole = (frames: readonly Frame[]): Frame[] => frames.filter((frame) => !frame.cut);

export function framesCsv(frames: readonly Frame[], known: Known, texts: ReadonlyMap<number, string>): string {
  const head = ["frame", "time_s", "bus", "identifier", "extended", "remote", "sent", "length", "data", "meaning"];
  const flag = (value: boolean) => (value ? 1 : 0);
  const rows = frames.map((frame) => [
    frame.n,
    frame.seconds.toFixed(6),
    known.buses[frame.bus] ?? "",
    idOf(frame),
    flag(frame.extended),
    flag(frame.remote),
    flag(frame.sent),
    frame.data.length,
    frame.remote ? "" : bytes(frame.data),
    texts.get(frame.n) ?? meaningIn(frame, known).text,
  ]);
  return csv([head, ...rows]);
}
