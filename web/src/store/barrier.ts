import { roles, type Role } from "../protocol/messages";
import type { State } from "./state";

export const roleSuffices = (mine: Role, needed: Role): boolean => roles.indexOf(mine) >= roles.indexOf(needed);

/** Why a verb cannot be asked for now; null: it can. The plant's own verb, "sim", is not among the server's. */
export function barrier(state: State, verb: string): string | null {
  if (state.connection.phase !== "open") return "Not connected.";
  const { lock, role, verbs } = state.data;
  const entry = verbs.find(({ name }) => name === verb) ?? { changes: true, role: "operate" as const };
  if (!roleSuffices(role, entry.role)) return `This needs the role ${entry.role}. Yours is ${role}.`;
  if (entry.changes && lock.real && lock.unlocked_until_s === null)
    return "Real buses are read-only. Unlock them first.";
  return null;
}
