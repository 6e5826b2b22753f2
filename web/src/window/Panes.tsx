import { useMemo, type ComponentType, type KeyboardEvent } from "react";
import { Dictionary } from "../panes/dictionary/Dictionary";
import { Doctor } from "../panes/doctor/Doctor";
import { Fleet } from "../panes/fleet/Fleet";
import { Machine } from "../panes/machine/Machine";
import { Network } from "../panes/network/Network";
import { Plots } from "../panes/plots/Plots";
import { Slots } from "../panes/slots/Slots";
import { Trace } from "../panes/trace/Trace";
import { World } from "../panes/world/World";
import type { Data } from "../store/state";
import type { Pane } from "../store/view";
import { useData, useView } from "./context";

export interface PaneEntry {
  name: Pane;
  title: string;
  /** What it is for, in a line. */
  about: string;
  /** Other words by which "Find or do" finds it. */
  words: string;
  component: ComponentType;
  /** Whether this server can fill it. */
  there: (data: Data) => boolean;
}

const has = (verb: string) => (data: Data) => data.verbs.some((entry) => entry.name === verb);

/** The table of panes: a new one is a folder and a line here. */
const table: PaneEntry[] = [
  {
    name: "machine",
    title: "Machine",
    about: "Buses, slots and devices as a drawing; load; what the search for devices has found.",
    words: "bus cable topology discovery address load gateway",
    component: Machine,
    there: () => true,
  },
  {
    name: "slots",
    title: "Slots",
    about: "The state of each slot, its device, what is wrong; replace a device.",
    words: "table replace spare reason serial number emcy history",
    component: Slots,
    there: () => true,
  },
  {
    name: "dictionary",
    title: "Dictionary",
    about: "The objects of the selected device: read, search, write, compare, watch; notes.",
    words: "object sdo read write note index differences defaults",
    component: Dictionary,
    there: has("sdo dump"),
  },
  {
    name: "network",
    title: "Network access",
    about: "Boot log, backup and restore, and a form for each service: scan, NMT, LSS, programs.",
    words: "backup restore dcf firmware program update nmt lss scan boot service",
    component: Network,
    there: has("scan"),
  },
  {
    name: "trace",
    title: "Trace",
    about: "Frames and errors as they come, with their meaning; filter, markers, export; open a log.",
    words: "frames filter log candump pcapng export record error marker bits",
    component: Trace,
    there: () => true,
  },
  {
    name: "plots",
    title: "Plots",
    about: "Signals of PDOs, load, heartbeat intervals and watched objects over time; export.",
    words: "signals chart export csv watch heartbeat load pdo link",
    component: Plots,
    there: () => true,
  },
  {
    name: "doctor",
    title: "Doctor",
    about: "What is wrong on the buses, how surely, what to do; examines a device by CiA 301.",
    words: "diagnose errors findings conformance test",
    component: Doctor,
    there: has("doctor"),
  },
  {
    name: "world",
    title: "World",
    about: "Of a simulated machine: pause and speed; unplug, damage, slow or deaf devices; cut cables.",
    words: "simulation plug unplug power fault cable cut time pause step speed",
    component: World,
    there: (data) => data.machine.simulated,
  },
  {
    name: "fleet",
    title: "Fleet",
    about: "The machines of this one's group at its MQTT broker: which need somebody, and why.",
    words: "mqtt sparkplug broker machines group hall plant others",
    component: Fleet,
    there: (data) => Boolean(data.machine.fleet),
  },
];

export function usePanes(): PaneEntry[] {
  const names = useData((state) => table.filter((entry) => entry.there(state.data)).map((entry) => entry.name));
  return useMemo(() => table.filter((entry) => names.includes(entry.name)), [names]);
}

export function PaneTabs() {
  const [view, setView] = useView();
  const panes = usePanes();
  const move = (event: KeyboardEvent) => {
    const step = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (!step) return;
    const at = panes.findIndex((pane) => pane.name === view.pane);
    const next = panes[(at + step + panes.length) % panes.length];
    if (!next) return;
    setView({ pane: next.name });
    document.getElementById(`tab-${next.name}`)?.focus();
  };
  return (
    <div className="tabs" role="tablist" aria-label="Panes" onKeyDown={move}>
      {panes.map((pane) => (
        <button
          key={pane.name}
          type="button"
          role="tab"
          id={`tab-${pane.name}`}
          aria-selected={pane.name === view.pane}
          aria-controls="pane"
          tabIndex={pane.name === view.pane ? 0 : -1}
          onClick={() => setView({ pane: pane.name })}
        >
          {pane.title}
        </button>
      ))}
    </div>
  );
}

export function PaneBody() {
  const [view] = useView();
  const pane = usePanes().find((entry) => entry.name === view.pane);
  if (!pane) return <div className="pane" id="pane" />;
  const Body = pane.component;
  return (
    <div className={`pane pane-${pane.name}`} id="pane" role="tabpanel" aria-labelledby={`tab-${pane.name}`}>
      <Body />
    </div>
  );
}
