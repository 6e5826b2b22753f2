import type { Bus, Slot } from "../protocol/messages";
import { visible } from "../protocol/text";

/** Berth has a port there, and hears its frames. The others it reaches by SDO through their gateway, and by its NMT master. */
export const isHeard = (bus: Pick<Bus, "port"> | undefined): boolean => bus?.port !== "gateway";

/** Verbs that need a port. SDO, NMT and programs go through the gateway. */
const needPort = new Set([
  ...["bind", "replace", "forget", "poll", "locate", "boot", "configure", "upload", "history", "send", "doctor"],
  ...["sdo connect", "sdo release", "sdo channels"],
]);

const instead: Record<string, string> = {
  replace: "Put the new device in: the gateway's own NMT master gives it the node-ID.",
  upload: "Backup and restore reads its values by SDO.",
  history: "The gateway's own NMT master gives the node-IDs, and Berth keeps no history of it.",
};

/** Arguments that name a slot or a node. */
const names = ["slot", "node", "target", "conformance", "client", "server"];

function busOf(values: Record<string, string>, slots: readonly Slot[]): string {
  if (values.bus) return values.bus;
  const named = names.flatMap((name) => values[name] ?? []);
  const found = slots.filter((slot) => named.includes(slot.name));
  return found.length === 1 ? (found[0]?.bus ?? "") : "";
}

/** Why a verb is refused beneath a gateway; null: it is not. */
export function beneathBarrier(
  verb: string,
  values: Record<string, string>,
  buses: readonly Bus[],
  slots: readonly Slot[],
): string | null {
  if (!needPort.has(verb) && !verb.startsWith("lss ")) return null;
  const bus = buses.find((entry) => entry.name === busOf(values, slots));
  if (!bus?.beneath || isHeard(bus)) return null;
  const { bus: above, slot: gateway } = bus.beneath;
  const id = slots.find((slot) => slot.bus === above && slot.name === gateway)?.id;
  const where = `Beneath gateway ${id ?? visible(gateway)} of bus ${visible(above)}: Berth has no port there.`;
  return `${where} ${instead[verb] ?? "Ask the gateway's own NMT master."}`;
}
