import { objectNamed } from "../panes/dictionary/reducer";
import { deviceKey, deviceName, straysOf, whyWords } from "../panes/machine/strays";
import { BACKUP, BOOT_LOG } from "../panes/network/reducer";
import { damageAct, deviceActs, mendAct, timeActs, type WorldAct } from "../panes/world/acts";
import { wordOf } from "../panes/world/cable";
import { barrier } from "../store/barrier";
import { slotKey } from "../store/keys";
import type { Action, Ask, State } from "../store/state";
import type { Pane, View } from "../store/view";

/** What "Find or do" offers: where it leads, and what it asks there. */
export interface Entry {
  title: string;
  hint: string;
  /** It is found by these, too. */
  words: string;
  view?: Partial<View>;
  actions?: readonly Action[];
  asks?: readonly Ask[];
  /** The address of this view is copied. */
  copiesLink?: true;
}

interface PaneWords {
  name: Pane;
  title: string;
  about: string;
  words: string;
}

const MOST_FOUND = 40;

/** Other words for services: what somebody types who does not know CANopen's. */
const serviceWords: [name: RegExp, words: string][] = [
  [/^program /, "firmware update flash software"],
  [/^store$/, "save parameters"],
  [/^restore$/, "factory defaults"],
  [/^upload$/, "save dcf backup export configuration"],
  [/^(nmt|boot)$/, "start stop reset"],
  [/^(scan|bind)$/, "find search devices"],
  [/^lss /, "node-id bit rate"],
];

/** All but objects that nobody has read. In the order in which equals are listed. */
export function entriesOf(state: State, panes: readonly PaneWords[]): Entry[] {
  return [
    ...panes.map(({ name, title, about, words }, i) => ({
      title,
      hint: `pane, Alt ${i + 1}`,
      words: `${about} ${words}`,
      view: { pane: name },
    })),
    ...windowEntries(panes),
    ...state.data.slots.map((slot) => ({
      title: slot.name,
      hint: `slot ${slotKey(slot)}, ${slot.state}`,
      words: "",
      view: { slot: slotKey(slot) },
    })),
    ...straysOf(state).map((device) => ({
      title: deviceName(device),
      hint: `device without a slot, ${whyWords(device)}`,
      words: device.address,
      view: { pane: "machine" as const, device: deviceKey(device) },
    })),
    ...serviceEntries(state, panes),
    ...worldEntries(state),
    ...objectEntries(state),
  ];
}

function windowEntries(panes: readonly PaneWords[]): Entry[] {
  const has = (name: Pane) => panes.some((pane) => pane.name === name);
  const help = { title: "Help", hint: "panes, keys, states, roles: ?", words: "manual documentation colours legend" };
  const link = { title: "Copy the link to this view", hint: "the address, without the token", words: "share url" };
  const log = { title: "Open a log", hint: "trace", words: "file candump pcapng asc trc import" };
  const pause = { title: "Pause or go on with the trace", hint: "P", words: "stop" };
  return [
    { ...help, actions: [{ type: "window", change: { help: true } }] },
    { ...link, copiesLink: true },
    ...(has("trace")
      ? [
          { ...log, view: { pane: "trace" as const } },
          { ...pause, ...toggled },
        ]
      : []),
  ];
}

/** Whether it is paused is known when it is done. */
const toggled = { view: { pane: "trace" as const }, actions: [{ type: "trace/toggle" } as const] };

function serviceEntries({ data }: State, panes: readonly PaneWords[]): Entry[] {
  const open = (verb: string): Pick<Entry, "actions" | "view"> => ({
    actions: [{ type: "network/verb", verb }],
    view: { pane: "network" },
  });
  const own: Entry[] = [];
  if (panes.some(({ name }) => name === "network")) {
    own.push({ title: "Boot log", hint: "each boot-up, step by step", words: "start", ...open(BOOT_LOG) });
  }
  if (data.verbs.some(({ name }) => name === "backup save")) {
    const words = "dcf export save values all devices";
    own.push({ title: "Backup and restore", hint: "values as DCFs, compared and restored", words, ...open(BACKUP) });
  }
  // What holds the world's time is an act of the world.
  const verbs = data.verbs.filter(({ name }) => !name.startsWith("world "));
  return [
    ...own,
    ...verbs.map(({ name, help }) => ({
      title: name,
      hint: help,
      words: serviceWords.flatMap(([verb, words]) => (verb.test(name) ? [words] : [])).join(" "),
      ...open(name),
    })),
  ];
}

/** What World has buttons for. */
function worldEntries(state: State): Entry[] {
  const { data, world } = state;
  if (!data.machine.simulated) return [];
  const entry = (act: WorldAct, title: string, view: Partial<View> = {}, device = ""): Entry => {
    const why = barrier(state, act.verb, act.values);
    const chosen: Action[] = device ? [{ type: "world", change: { device } }] : [];
    return {
      title,
      hint: why ?? "in the simulated world",
      words: "world simulation fault",
      view: { ...view, pane: "world" },
      actions: chosen,
      ...(why === null && { asks: [{ verb: act.verb, values: act.values, owner: "world" }] }),
    };
  };
  const has = (verb: string) => data.verbs.some(({ name }) => name === verb);
  const time = timeActs.filter(({ verb }) => has(verb));
  const ofSlots = data.slots.flatMap((slot) => {
    const device = world.devices.find((each) => each.bus === slot.bus && each.slot === slot.name);
    const word = device ? wordOf(device, data.slots) : slot.name;
    const view = { slot: slotKey(slot) };
    const damage = damageAct(slot.bus, "1", word);
    return [
      ...deviceActs(word, device ?? null).map((act) => entry(act, `${act.label}: ${slot.name}`, view)),
      ...(has("world damage") ? [entry(damage, `${damage.label}: ${slot.name}`, view)] : []),
    ];
  });
  const others = world.devices.filter((device) => !device.slot);
  return [
    ...time.map((act) => entry(act, `${act.label.replace(/^[▮▶▸ ]+/, "")} the world`)),
    ...data.buses.flatMap(({ name }) => [
      ...(has("world damage") ? [damageAct(name, "1")].map((act) => entry(act, act.label)) : []),
      ...world.cables
        .filter(({ bus, pieces }) => bus === name && pieces.length > 1)
        .map(() => entry(mendAct(name), mendAct(name).label)),
    ]),
    ...ofSlots,
    ...others.flatMap((device) =>
      deviceActs(wordOf(device, data.slots), device).map((act) =>
        entry(act, `${act.label}: ${device.name}`, { slot: "" }, device.name),
      ),
    ),
  ];
}

function objectEntries({ data, dictionary }: State): Entry[] {
  return data.slots.flatMap((slot) => {
    const key = slotKey(slot);
    return (dictionary.objects[key] ?? []).map((row) => ({
      title: `${row.key} ${row.name}`.trim(),
      hint: `object of ${slot.name}`,
      words: "",
      view: { pane: "dictionary" as const, slot: key, object: row.key },
    }));
  });
}

/** An object that is named and was not read, of the selected slot. */
function readEntry(text: string, { data, dictionary, view }: State): Entry[] {
  const object = objectNamed(text);
  const slot = data.slots.find((entry) => slotKey(entry) === view.slot);
  if (!object || !slot || !data.verbs.some(({ name }) => name === "sdo read")) return [];
  if (dictionary.objects[view.slot]?.some((row) => row.key === object)) return [];
  const values = { bus: slot.bus, node: slot.name, object };
  return [
    {
      title: `Read ${object} of ${slot.name}`,
      hint: "object",
      words: "",
      view: { pane: "dictionary", object },
      asks: [{ verb: "sdo read", values, owner: `dictionary:${view.slot}` }],
    },
  ];
}

/** Those that have every word; what is called so comes first. */
export function found(entries: readonly Entry[], text: string, state: State): Entry[] {
  const typed = text.trim().toLowerCase();
  const words = typed.split(/\s+/).filter(Boolean);
  const rank = ({ title, hint, words: more }: Entry): number => {
    const name = title.toLowerCase();
    if (name === typed) return 0;
    if (name.startsWith(typed)) return 1;
    if (words.every((word) => name.includes(word))) return 2;
    return words.every((word) => `${name} ${hint} ${more}`.toLowerCase().includes(word)) ? 3 : -1;
  };
  const ranked = entries.map((entry) => ({ entry, rank: rank(entry) })).filter((each) => each.rank >= 0);
  // The sorting is stable.
  const sorted = ranked.sort((a, b) => a.rank - b.rank).map(({ entry }) => entry);
  return [...readEntry(text, state), ...sorted].slice(0, MOST_FOUND);
}
