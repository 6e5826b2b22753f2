import { changes } from "../protocol/command";
import { roles, type Role } from "../protocol/messages";
import { beneathBarrier } from "./beneath";
import type { State } from "./state";

export const roleSuffices = (mine: Role, needed: Role): boolean => roles.indexOf(mine) >= roles.indexOf(needed);

/** Why a verb cannot be asked for now; null: it can. The plant's own verb, "sim", is not among the server's. */
export function barrier(state: State, verb: string, values: Record<string, string> = {}): string | null {
  if (state.connection.phase !== "open") return "Not connected.";
  const { lock, role, verbs, buses, slots } = state.data;
  const entry = verbs.find(({ name }) => name === verb);
  const moves = entry === undefined || changes(entry, values);
  const needed = entry && !(moves && entry.role === "view") ? entry.role : "operate";
  if (!roleSuffices(role, needed)) return `This needs the role ${needed}. Yours is ${role}.`;
  if (moves && lock.real && lock.unlocked_until_s === null) return "Real buses are read-only. Unlock them first.";
  return beneathBarrier(verb, values, buses, slots);
}
