/** What one looks at. It lives in the fragment of the address, so that a link shows a colleague the same. */

export const panes = [
  "slots",
  "trace",
  "machine",
  "dictionary",
  "network",
  "plots",
  "doctor",
  "world",
  "fleet",
] as const;
export type Pane = (typeof panes)[number];

const traceModes = ["chronological", "folded", "latest"] as const;
export type TraceMode = (typeof traceModes)[number];

export const MOST_MARKS = 20;
export const MOST_WATCHED = 16;
export const MOST_SIGNALS = 16;
const signalForm = /^.+\/([0-9A-F]{3}|[0-9A-F]{8}) \d{1,3}$/;
const watchForm = /^.+\/\d{1,3} [0-9A-F]{4}h:[0-9A-F]{2}$/;

const deviceForm = /^.+\/[0-9A-F]{8}(-[0-9A-F]{8}){3}$/;

export interface View {
  pane: Pane;
  /** "field/12": bus and node-ID of the slot that is selected everywhere; empty: none */
  slot: string;
  /** A device without a slot that is selected instead: bus and LSS address; empty: none */
  device: string;
  /** Number of the frame that the inspector shows. */
  frame: number | null;
  /** "1018h:04" */
  object: string;
  /** Of the trace. */
  filter: string;
  mode: TraceMode;
  /** Numbers of the frames that have a marker. */
  marks: readonly number[];
  /** The frame that times count from; null: the machine's start. */
  zero: number | null;
  /** Objects that are watched: "field/12 6041h:00" */
  watch: readonly string[];
  /** Signals of messages that are plotted: "field/185 16", the identifier and the first bit. */
  signals: readonly string[];
}

export const firstView: View = {
  pane: "machine",
  slot: "",
  device: "",
  frame: null,
  object: "",
  filter: "",
  mode: "chronological",
  marks: [],
  zero: null,
  watch: [],
  signals: [],
};

function isPane(text: string | null): text is Pane {
  return panes.some((pane) => pane === text);
}

function frameNumber(text: string | null): number | null {
  const n = Number(text);
  return text !== null && text !== "" && Number.isSafeInteger(n) && n >= 0 ? n : null;
}

/** "812,4711", each once and in order. */
function marksOf(text: string | null): number[] {
  const numbers = (text ?? "").split(",").map(frameNumber);
  const marks = numbers.filter((n) => n !== null);
  return [...new Set(marks)].sort((a, b) => a - b).slice(0, MOST_MARKS);
}

export function parseView(fragment: string): View {
  const values = new URLSearchParams(fragment.replace(/^#/, ""));
  const pane = values.get("pane");
  const mode = traceModes.find((entry) => entry === values.get("mode"));
  return {
    pane: isPane(pane) ? pane : firstView.pane,
    slot: values.get("slot") ?? "",
    device: deviceForm.test(values.get("device") ?? "") ? (values.get("device") ?? "") : "",
    frame: frameNumber(values.get("frame")),
    object: values.get("object") ?? "",
    filter: values.get("filter") ?? "",
    mode: mode ?? firstView.mode,
    marks: marksOf(values.get("marks")),
    zero: frameNumber(values.get("zero")),
    watch: [...new Set(values.getAll("watch"))].filter((key) => watchForm.test(key)).slice(0, MOST_WATCHED),
    signals: [...new Set(values.getAll("signal"))].filter((key) => signalForm.test(key)).slice(0, MOST_SIGNALS),
  };
}

export function fragmentOf(view: View): string {
  const values = new URLSearchParams({ pane: view.pane });
  if (view.slot) values.set("slot", view.slot);
  if (view.device) values.set("device", view.device);
  if (view.frame !== null) values.set("frame", String(view.frame));
  if (view.object) values.set("object", view.object);
  if (view.filter) values.set("filter", view.filter);
  if (view.mode !== firstView.mode) values.set("mode", view.mode);
  if (view.marks.length) values.set("marks", view.marks.join(","));
  if (view.zero !== null) values.set("zero", String(view.zero));
  for (const key of view.watch) values.append("watch", key);
  for (const key of view.signals) values.append("signal", key);
  return `#${values.toString()}`;
}

/** A signal is plotted, or no more; `MOST_SIGNALS` at most. */
export function signalChange({ signals }: Pick<View, "signals">, key: string): Partial<View> {
  if (signals.includes(key)) return { signals: signals.filter((entry) => entry !== key) };
  return signals.length < MOST_SIGNALS ? { signals: [...signals, key] } : {};
}

/** Selecting a slot lets go of a frame or an object of another one, and of a device without a slot. */
export function changedView(view: View, change: Partial<View>): View {
  if (change.device && change.slot === undefined) return changedView(view, { ...change, slot: "" });
  const next = { ...view, ...change };
  if (change.slot !== undefined && change.device === undefined) next.device = "";
  if (change.slot !== undefined && change.slot !== view.slot) {
    if (change.frame === undefined) next.frame = null;
    if (change.object === undefined) next.object = "";
  }
  return next;
}
