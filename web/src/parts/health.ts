import type { BusRates, Slot } from "../protocol/messages";
import { count, visible } from "../protocol/text";

const states = {
  active: "error-active",
  warning: "warning",
  passive: "error-passive",
  "bus-off": "bus-off",
  down: "down",
};

/** "3 error frames, error-passive, TEC 128, REC 0": state and counters are those of Berth's own port. */
export function healthWords({ errors, state, tec, rec }: BusRates): string {
  const frames = errors ? `${count(errors)} error ${errors === 1 ? "frame" : "frames"}` : "no error frames";
  const counters = tec !== undefined && rec !== undefined ? `TEC ${tec}, REC ${rec}` : "";
  return [frames, state && states[state], counters].filter(Boolean).join(", ");
}

/** Why nothing is known of a bus: its port is down or shut, and all of its slots say so. Empty: something is known. */
export function restWords(slots: readonly Pick<Slot, "state" | "reason">[]): string {
  const why = slots[0]?.reason ?? "";
  return slots.every(({ state, reason }) => state === "unknown" && reason === why) ? why : "";
}

/** Of what leads to them. */
export const errorTitle = ({ bus, errors = 0 }: BusRates): string =>
  `${count(errors)} error ${errors === 1 ? "frame" : "frames"} on ${visible(bus)}: show ${errors === 1 ? "it" : "them"} in the trace`;

/** Whether somebody should look: errors come, or the port is no longer error-active. */
export const isUnwell = ({ errors_per_s, state }: BusRates): boolean =>
  (errors_per_s ?? 0) > 0 || (state !== undefined && state !== "active");
