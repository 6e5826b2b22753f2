import { ObjectInspector } from "../panes/dictionary/ObjectInspector";
import { DeviceInspector } from "../panes/machine/DeviceInspector";
import { SlotInspector } from "../panes/slots/SlotInspector";
import { FrameInspector } from "../panes/trace/FrameInspector";
import { listedOf } from "../panes/trace/reducer";
import { slotKey } from "../store/keys";
import { useData, useView } from "./context";

/** In the trace rows are long: there the inspector takes no room while nothing is chosen. */
export function useInspected(): boolean {
  return useData((state) => {
    const { window, view, data } = state;
    if (!window.inspectorOpen || view.pane !== "trace") return window.inspectorOpen;
    const chosen = view.device !== "" || data.slots.some((entry) => slotKey(entry) === view.slot);
    return chosen || listedOf(state).picked.frame !== null;
  });
}

/** What is selected, its facts, its acts: the frame or the object first, then the slot that it belongs to. */
export function Inspector() {
  const [view] = useView();
  const slot = useData((state) => state.data.slots.find((entry) => slotKey(entry) === view.slot));
  const frame = useData((state) => listedOf(state).picked.frame);
  const nothing = !slot && !view.device && frame === null;
  return (
    <aside className={`inspector ${nothing ? "nothing" : ""}`} aria-label="Inspector" tabIndex={0}>
      {frame !== null && <FrameInspector n={frame} />}
      {slot && view.object && <ObjectInspector slot={slot} object={view.object} />}
      {slot && <SlotInspector slot={slot} key={slotKey(slot)} />}
      {view.device && <DeviceInspector of={view.device} key={view.device} />}
      {nothing && (
        <p className="hint">
          <span>
            Select a slot, a frame or an object. “Find or do” at the top finds panes, slots, services and objects
            <span className="by-key"> (Ctrl K)</span>.
          </span>
        </p>
      )}
    </aside>
  );
}
