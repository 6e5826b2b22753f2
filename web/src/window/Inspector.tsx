import { ObjectInspector } from "../panes/dictionary/ObjectInspector";
import { SlotInspector } from "../panes/slots/SlotInspector";
import { FrameInspector } from "../panes/trace/FrameInspector";
import { slotKey } from "../store/keys";
import { useData, useView } from "./context";

/** What is selected, its facts, its acts: the frame or the object first, then the slot that it belongs to. */
export function Inspector() {
  const [view] = useView();
  const slot = useData((state) => state.data.slots.find((entry) => slotKey(entry) === view.slot));
  const nothing = !slot && view.frame === null;
  return (
    <aside className={`inspector ${nothing ? "nothing" : ""}`} aria-label="Inspector" tabIndex={0}>
      {view.frame !== null && <FrameInspector n={view.frame} />}
      {slot && view.object && <ObjectInspector slot={slot} object={view.object} />}
      {slot && <SlotInspector slot={slot} key={slotKey(slot)} />}
      {nothing && <p className="hint">Select a slot, a frame or an object. Ctrl K finds everything.</p>}
    </aside>
  );
}
