import type { Slot } from "../protocol/messages";

/** A slot as an answer tells it. */
export type ToldSlot = Pick<Slot, "bus" | "id" | "name" | "state">;

function isSlot(value: unknown): value is ToldSlot {
  if (typeof value !== "object" || value === null) return false;
  const { bus, id, name, state } = value as Record<string, unknown>;
  return typeof bus === "string" && typeof id === "number" && typeof name === "string" && typeof state === "string";
}

/** What the slot table begins with, as `replace`, `bind` and `configure` print it. */
const tableHead = /^bus +id +slot +state /;

/**
 * An answer in parts: its slots, which the page draws, and the other lines. A table of the terminal is wider than the
 * inspector.
 */
export function toldOf(lines: readonly string[], reply: unknown): { slots: ToldSlot[]; lines: string[] } {
  const head = lines.findIndex((line) => tableHead.test(line));
  const all = isSlot(reply) ? [reply] : ((reply as { slots?: unknown } | null)?.slots ?? []);
  const slots = Array.isArray(all) ? all.filter(isSlot) : [];
  if (head < 0 || !slots.length) return { slots: [], lines: [...lines] };
  const isRow = (line: string) =>
    /^ /.test(line) || slots.some(({ bus, id }) => line.startsWith(bus) && line.includes(` ${id} `));
  const after = lines.slice(head + 1);
  const rest = after.findIndex((line) => !isRow(line));
  return { slots, lines: [...lines.slice(0, head), ...(rest < 0 ? [] : after.slice(rest))] };
}

/** "0.780 s  field/drive  asked  node-ID 1  discovered", of `history`: when, and what. */
export function storyOf(lines: readonly string[]): { when: string; what: string }[] {
  return lines.map((line) => {
    const [when = "", , ...what] = line.trim().split(/ {2,}/);
    return { when, what: what.join(", ") };
  });
}
