import { useEffect, useMemo, useRef, useState, type KeyboardEvent } from "react";
import { visible } from "../protocol/text";
import { act, useData, useStudio, type Studio } from "./context";
import { entriesOf, found as foundBy, type Entry } from "./entries";
import { usePanes } from "./Panes";

/** What there is while the list is open; not the frames, which come all the time. */
function useEntries(): Entry[] {
  const { store } = useStudio();
  const panes = usePanes();
  const parts = useData(
    ({ data, machine, dictionary, world, view }) =>
      [
        data.slots,
        data.verbs,
        data.questions,
        data.role,
        data.lock,
        machine,
        dictionary.objects,
        world,
        view.slot,
      ] as const,
  );
  return useMemo(() => (parts ? entriesOf(store.get(), panes) : []), [store, panes, parts]);
}

function copyLink({ store }: Studio) {
  void navigator.clipboard.writeText(window.location.href).then(() => {
    store.dispatch({ type: "window", change: { notice: "The link is copied." } });
  });
}

export function Palette() {
  const studio = useStudio();
  const { store } = studio;
  const entries = useEntries();
  const [text, setText] = useState("");
  const [at, setAt] = useState(0);
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  const close = () => store.dispatch({ type: "window", change: { palette: false } });
  const state = store.get();
  const found = foundBy(entries, text, state);
  const run = (entry: Entry | undefined) => {
    close();
    if (!entry) return;
    if (entry.view) store.dispatch({ type: "view", change: entry.view });
    for (const action of entry.actions ?? []) store.dispatch(action);
    if (entry.asks) act(studio, entry.asks);
    if (entry.copiesLink) copyLink(studio);
  };
  const onKey = (event: KeyboardEvent) => {
    if (event.key === "ArrowDown") setAt(Math.min(found.length - 1, at + 1));
    else if (event.key === "ArrowUp") setAt(Math.max(0, at - 1));
    else if (event.key === "Enter") run(found[at]);
    // The browser tells of a closed dialog later than of the next key: Ctrl K would find it open and close it again.
    else if (event.key === "Escape") close();
    else return;
    event.preventDefault();
  };
  return (
    <dialog ref={dialog} className="palette" onClose={close} aria-label="Find or do">
      <input
        autoFocus
        value={text}
        placeholder="Pane, slot, device, object or act"
        role="combobox"
        aria-expanded="true"
        aria-controls="found"
        aria-label="Find or do"
        aria-activedescendant={found[at] ? `found-${at}` : undefined}
        onKeyDown={onKey}
        onChange={(event) => {
          setText(event.target.value);
          setAt(0);
        }}
      />
      <ul id="found" role="listbox" aria-label="Found">
        {found.map((entry, i) => (
          <li
            key={i}
            id={`found-${i}`}
            role="option"
            aria-selected={i === at}
            onMouseDown={() => run(entry)}
            ref={(element) => {
              if (i === at) element?.scrollIntoView({ block: "nearest" });
            }}
          >
            <span>{visible(entry.title)}</span>
            <span className="quiet">{visible(entry.hint)}</span>
          </li>
        ))}
      </ul>
      {!found.length && (
        <p className="hint" role="status">
          Nothing is found for “{visible(text.trim())}”. Type a pane (Trace), a slot or device (its name, node-ID or
          serial number), an object (1018h:04, or a word of one that was read), a service (nmt, backup, firmware), or an
          act of a simulated world (unplug, pause). Frames are found by the trace&apos;s filter.
        </p>
      )}
    </dialog>
  );
}
