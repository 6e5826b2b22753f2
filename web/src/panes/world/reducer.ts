import type { Action, State } from "../../store/state";

/** A device of the plant, as it is, whatever Berth believes. */
export interface PlantDevice {
  name: string;
  bus: string;
  plugged: boolean;
  powered: boolean;
  deaf: boolean;
  /** It answers so much later than it would. */
  late: number;
  /** The name of the slot in which it sits, or sat last; empty: in none. */
  slot: string;
  /** Its LSS address. */
  address: string;
}

/** The pieces of a bus's cable: the nodes on each. One piece: it is whole. */
export interface Cable {
  bus: string;
  pieces: string[][];
}

export interface WorldState {
  devices: readonly PlantDevice[];
  cables: readonly Cable[];
  /** The bus time when the plant was told. */
  toldS: number;
  /** A device without a slot that was chosen in the pane; one with a slot is chosen as the slot. */
  device: string;
  /** How many frames are damaged by one press. */
  frames: string;
}

export type WorldAction = { type: "world"; change: Partial<Pick<WorldState, "device" | "frames">> };

export const firstWorld: WorldState = { devices: [], cables: [], toldS: 0, device: "", frames: "1" };

/** Who asks for the plant's truth. */
export const PLANT_OWNER = "look:plant";

export function worldReducer(world: WorldState, action: Action, state: State): WorldState {
  if (action.type === "world") return { ...world, ...action.change };
  if (action.type === "view") return action.change.slot ? { ...world, device: "" } : world;
  if (action.type !== "message" || action.message.type !== "reply") return world;
  const { id } = action.message;
  const sent = state.requests.find((entry) => entry.id === id);
  if (sent?.owner !== PLANT_OWNER || sent.status !== 0 || !isJson(sent.reply)) return world;
  const next = {
    devices: placed(listOf(sent.reply.devices).filter(isJson).map(deviceOf), world.devices),
    cables: listOf(sent.reply.cables).filter(isJson).map(cableOf),
  };
  const same = JSON.stringify(next) === JSON.stringify({ devices: world.devices, cables: world.cables });
  return { ...(same ? world : { ...world, ...next }), toldS: state.data.time };
}

/**
 * A device stays where it was on the cable when Berth has emptied its slot: until another one sits there, or it sits in
 * another. A page that is opened later does not know its place.
 */
function placed(devices: PlantDevice[], before: readonly PlantDevice[]): PlantDevice[] {
  const taken = new Set(devices.map(({ bus, slot }) => `${bus}/${slot}`));
  const was = new Map(before.map(({ name, bus, slot }) => [name, taken.has(`${bus}/${slot}`) ? "" : slot]));
  return devices.map((device) => (device.slot ? device : { ...device, slot: was.get(device.name) ?? "" }));
}

type Json = Record<string, unknown>;
const isJson = (value: unknown): value is Json => typeof value === "object" && value !== null;
const textOf = (value: unknown): string => (typeof value === "string" ? value : "");
const listOf = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);

function deviceOf(json: Json): PlantDevice {
  return {
    name: textOf(json.device),
    bus: textOf(json.bus),
    plugged: json.plugged === true,
    powered: json.powered === true,
    deaf: json.deaf === true,
    late: typeof json.late_s === "number" ? json.late_s : 0,
    slot: textOf(json.slot),
    address: textOf(json.lss_address).toUpperCase(),
  };
}

function cableOf(json: Json): Cable {
  return { bus: textOf(json.bus), pieces: listOf(json.pieces).map((piece) => listOf(piece).map(textOf)) };
}

/** Frames that a press damages: 1 to 10000; null: it is no such number. */
export function framesOf(text: string): string | null {
  const frames = Number(text);
  return Number.isInteger(frames) && frames >= 1 && frames <= 10_000 ? String(frames) : null;
}
