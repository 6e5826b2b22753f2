/** Trace files as the server writes and reads them, in one format: candump's. */
const LINE = /^\((\d+\.\d+)\) (\S+) ([0-9A-F]{3}|[0-9A-F]{8})#(R\d?|(?:[0-9A-F]{2})*)(?: [RT])?$/;

const ERROR = 0x20000000;

export function candump(rows) {
  return rows
    .map((row) => {
      const id = row.id
        .toString(16)
        .toUpperCase()
        .padStart(row.ext ? 8 : 3, "0");
      const data = row.rtr ? `R${row.dlc || ""}` : row.data;
      return `(${row.t_s.toFixed(6).padStart(17, "0")}) ${row.bus.replace(/\s+/g, "_")} ${id}#${data} R\n`;
    })
    .join("");
}

/** The answer of /api/v1/read; null: no line is a frame. */
export function readCandump(name, text) {
  const rows = [];
  const findings = [];
  text.split("\n").forEach((line, i) => {
    if (!line.trim()) return;
    const [, seconds, bus, id, data] = LINE.exec(line) ?? [];
    if (!id) return findings.push(`${name}:${i + 1}:1: error: this is no frame`);
    const rtr = data.startsWith("R");
    const number = parseInt(id, 16);
    const error = id.length === 8 && (number & ERROR) !== 0;
    rows.push({
      n: rows.length,
      t_s: Number(seconds),
      bus,
      id: number & 0x1fffffff,
      ext: id.length === 8 && !error,
      rtr,
      data: rtr ? "" : data,
      text: "",
      ...(rtr ? { dlc: Number(data.slice(1)) } : {}),
      ...(error ? { error: true } : {}),
    });
  });
  if (!rows.length) return null;
  const buses = [...new Set(rows.map((row) => row.bus))];
  const some = findings.slice(0, 100);
  return {
    ...{ name, format: "candump", buses, frames: rows.length, rows: rows.slice(0, 100_000) },
    ...{ findings: some, more_findings: findings.length - some.length },
  };
}

/** Nobody said what the recorded PDOs carry: words of 16 bits. */
export function signals(machine) {
  const lengths = new Map(machine.frames.map((frame) => [frame.ext ? -1 : frame.id, frame.data.length / 2]));
  const messages = [...lengths]
    .filter(([id, length]) => id > 0x180 && id < 0x580 && length >= 2)
    .map(([id, length]) => ({
      id,
      ext: false,
      name: `${id & 0x80 ? "TPDO" : "RPDO"} ${((id - 0x180) >> 8) + 1}`,
      sender: machine.slots.find((slot) => slot.id === (id & 0x7f))?.name ?? "",
      signals: Array.from({ length: length >> 1 }, (_, i) => ({
        ...{ name: `word ${i + 1}`, at: 16 * i, bits: 16, type: "unsigned", object: `6${i}00h:01` },
      })),
    }))
    .sort((a, b) => a.id - b.id);
  return { buses: machine.buses.map((bus) => ({ bus: bus.name, messages })) };
}
