/** What one looks at. It lives in the fragment of the address, so that a link shows a colleague the same. */

export const panes = ["slots", "trace", "machine", "dictionary", "network", "world"] as const;
export type Pane = (typeof panes)[number];

export interface View {
  pane: Pane;
  /** "field/12": bus and node-ID of the slot that is selected everywhere; empty: none */
  slot: string;
  /** Number of the frame that the inspector shows. */
  frame: number | null;
  /** "1018h:04" */
  object: string;
  /** Of the trace. */
  filter: string;
  mode: "chronological" | "latest";
}

export const firstView: View = {
  pane: "machine",
  slot: "",
  frame: null,
  object: "",
  filter: "",
  mode: "chronological",
};

function isPane(text: string | null): text is Pane {
  return panes.some((pane) => pane === text);
}

export function parseView(fragment: string): View {
  const values = new URLSearchParams(fragment.replace(/^#/, ""));
  const pane = values.get("pane");
  const frame = Number(values.get("frame"));
  return {
    pane: isPane(pane) ? pane : firstView.pane,
    slot: values.get("slot") ?? "",
    frame: values.has("frame") && Number.isSafeInteger(frame) && frame >= 0 ? frame : null,
    object: values.get("object") ?? "",
    filter: values.get("filter") ?? "",
    mode: values.get("mode") === "latest" ? "latest" : "chronological",
  };
}

export function fragmentOf(view: View): string {
  const values = new URLSearchParams({ pane: view.pane });
  if (view.slot) values.set("slot", view.slot);
  if (view.frame !== null) values.set("frame", String(view.frame));
  if (view.object) values.set("object", view.object);
  if (view.filter) values.set("filter", view.filter);
  if (view.mode !== firstView.mode) values.set("mode", view.mode);
  return `#${values.toString()}`;
}

/** Selecting a slot lets go of a frame or an object of another one. */
export function changedView(view: View, change: Partial<View>): View {
  const next = { ...view, ...change };
  if (change.slot !== undefined && change.slot !== view.slot) {
    if (change.frame === undefined) next.frame = null;
    if (change.object === undefined) next.object = "";
  }
  return next;
}
