/** A bus's cable as it is drawn: Berth's own node at its beginning, then the devices in the order of their slots. */
import type { Slot } from "../../protocol/messages";
import type { Cable, PlantDevice } from "./reducer";

/** Berth's own node, as the plant calls it. */
export const MASTER = "master";

export interface CableNode {
  /** As a command names it. */
  word: string;
  device: PlantDevice | null;
  /** Place of its slot among those of the bus; those without one come last. */
  at: number;
  /** Which piece of the cable it is on. */
  piece: number;
}

/** What is plugged in, from Berth to the last device; empty: nothing is known of the cable. */
export function nodesOf(
  cable: Cable | undefined,
  devices: readonly PlantDevice[],
  slots: readonly Slot[],
): CableNode[] {
  if (!cable) return [];
  const pieceOf = (name: string) => cable.pieces.findIndex((piece) => piece.includes(name));
  const mine = slots.filter((slot) => slot.bus === cable.bus);
  const nodes = devices
    .filter((device) => device.bus === cable.bus && device.plugged && pieceOf(device.name) >= 0)
    .map((device) => {
      const at = mine.findIndex((slot) => slot.name === device.slot);
      const word = wordOf(device, slots);
      return { word, device, at: at < 0 ? mine.length : at, piece: pieceOf(device.name) };
    })
    .sort((a, b) => a.at - b.at);
  const piece = pieceOf(MASTER);
  return piece < 0 ? nodes : [{ word: MASTER, device: null, at: -1, piece }, ...nodes];
}

/** A slot of this name has another device: then the command says that the device is meant. */
export function wordOf(device: PlantDevice, slots: readonly Slot[]): string {
  const name = device.name.toLowerCase();
  const other = slots.some((slot) => slot.name.toLowerCase() === name && slot.name !== device.slot);
  return other ? `device:${device.name}` : device.name;
}

/** The line goes on past it, and its own wire is open. */
export function hangs(nodes: readonly CableNode[], i: number): boolean {
  const mine = nodes[i]?.piece;
  const before = new Set(nodes.slice(0, i).map((node) => node.piece));
  return nodes.slice(i + 1).some((node) => node.piece !== mine && before.has(node.piece));
}

/** The piece that the line has before this node. */
function lineBefore(nodes: readonly CableNode[], i: number): number | undefined {
  for (let k = i - 1; k >= 0; k--) if (!hangs(nodes, k)) return nodes[k]?.piece;
  return undefined;
}

/** The line is cut before this node. */
export function cutBefore(nodes: readonly CableNode[], i: number): boolean {
  let next = i;
  while (next < nodes.length && hangs(nodes, next)) next++;
  const before = lineBefore(nodes, i);
  return next < nodes.length && before !== undefined && nodes[next]?.piece !== before;
}

/** Who loses the rest by a cut before this node: all behind it that the line reaches still. */
export function behind(nodes: readonly CableNode[], i: number): string[] {
  const before = lineBefore(nodes, i);
  return nodes.slice(i).flatMap((node) => (node.piece === before ? [node.word] : []));
}
