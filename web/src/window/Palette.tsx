import { useEffect, useRef, useState, type KeyboardEvent } from "react";
import { visible } from "../protocol/text";
import { slotKey } from "../store/keys";
import { useData, useStudio } from "./context";
import { usePanes } from "./Panes";

interface Entry {
  title: string;
  hint: string;
  run: () => void;
}

const MOST_ENTRIES = 40;

function useEntries(): Entry[] {
  const { store } = useStudio();
  const panes = usePanes();
  const [slots, verbs] = useData((state) => [state.data.slots, state.data.verbs] as const);
  const view = (change: Parameters<typeof store.dispatch>[0] & { type: "view" }) => () => store.dispatch(change);
  return [
    ...panes.map((pane, i) => ({
      title: pane.title,
      hint: `pane, Alt ${i + 1}`,
      run: view({ type: "view", change: { pane: pane.name } }),
    })),
    ...slots.map((slot) => ({
      title: slot.name,
      hint: `slot ${slotKey(slot)}, ${slot.state}`,
      run: view({ type: "view", change: { slot: slotKey(slot) } }),
    })),
    ...verbs.map((verb) => ({
      title: verb.name,
      hint: verb.help,
      run: () => {
        store.dispatch({ type: "network/verb", verb: verb.name });
        store.dispatch({ type: "view", change: { pane: "network" } });
      },
    })),
    {
      title: "Pause or go on with the trace",
      hint: "P",
      run: () => store.dispatch({ type: "trace/pause", paused: !store.get().trace.paused }),
    },
  ];
}

export function Palette() {
  const { store } = useStudio();
  const entries = useEntries();
  const [text, setText] = useState("");
  const [at, setAt] = useState(0);
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  const close = () => store.dispatch({ type: "window", change: { palette: false } });
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const found = entries
    .filter((entry) => words.every((word) => `${entry.title} ${entry.hint}`.toLowerCase().includes(word)))
    .slice(0, MOST_ENTRIES);
  const run = (entry: Entry | undefined) => {
    close();
    entry?.run();
  };
  const onKey = (event: KeyboardEvent) => {
    if (event.key === "ArrowDown") setAt(Math.min(found.length - 1, at + 1));
    else if (event.key === "ArrowUp") setAt(Math.max(0, at - 1));
    else if (event.key === "Enter") run(found[at]);
    else return;
    event.preventDefault();
  };
  return (
    <dialog ref={dialog} className="palette" onClose={close} aria-label="Find or do">
      <input
        autoFocus
        value={text}
        placeholder="Pane, slot or command"
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
    </dialog>
  );
}
