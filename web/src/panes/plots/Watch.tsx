import { CommandLine } from "../../parts/Act";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { MOST_WATCHED } from "../../store/view";
import { useData, useStudio, useView } from "../../window/context";
import { Swatch } from "./Chart";
import { LEAST_EVERY_S, MOST_FAILURES, watchKey, watchParts } from "./reducer";

/** Puts an object on the watch list, or takes it away. */
export function WatchButton({ slot, object }: { slot: string; object: string }) {
  const [view, setView] = useView();
  const key = watchKey(slot, object);
  const there = view.watch.includes(key);
  const full = !there && view.watch.length >= MOST_WATCHED;
  const watch = there ? view.watch.filter((entry) => entry !== key) : [...view.watch, key];
  return (
    <button
      type="button"
      aria-pressed={there}
      disabled={full}
      title={full ? `${MOST_WATCHED} objects are watched: take one away first` : ""}
      onClick={() => setView({ watch })}
    >
      {there ? "Do not watch" : "Watch"}
    </button>
  );
}

export function WatchBar() {
  const { store } = useStudio();
  const [every, failures] = useData((state) => [state.plots.every, state.plots.failures] as const);
  const set = (text: string) => store.dispatch({ type: "plots/every", seconds: Number(text) });
  return (
    <>
      <label>
        Read each every
        <input
          type="number"
          className="seconds"
          min={LEAST_EVERY_S}
          step={0.5}
          value={every}
          onChange={(event) => set(event.target.value)}
        />
        s
      </label>
      {failures >= MOST_FAILURES && (
        <span className="bad-text" role="status">
          Reading stopped: {MOST_FAILURES} answers in a row were errors.{" "}
          <button type="button" onClick={() => store.dispatch({ type: "plots/again" })}>
            Read on
          </button>
        </span>
      )}
    </>
  );
}

/** The watch list: it is the legend of its plot, too. */
export function WatchTable() {
  const [view, setView] = useView();
  const [slots, watched, objects] = useData(
    (state) => [state.data.slots, state.plots.watched, state.dictionary.objects] as const,
  );
  return (
    <table className="rows watch">
      <thead>
        <tr>
          <th>Line</th>
          <th>Device</th>
          <th>Object</th>
          <th className="right">Value</th>
          <th>As command</th>
          <th>
            <span className="unseen">Take away</span>
          </th>
        </tr>
      </thead>
      <tbody>
        {view.watch.map((key, i) => {
          const { slot: at, object } = watchParts(key);
          const slot = slots.find((entry) => slotKey(entry) === at);
          const name = objects[at]?.find((row) => row.key === object)?.name ?? "";
          const last = watched[key];
          return (
            <tr key={key} onClick={() => setView({ slot: at, object })}>
              <td>
                <Swatch i={i} />
              </td>
              <td>{visible(slot?.name ?? `${at}: no such slot`)}</td>
              <td>
                {object} <span className="quiet">{visible(name)}</span>
              </td>
              <td className={last?.error ? "bad-text" : "number right"} title={visible(last?.text ?? "")}>
                {visible(last?.error || last?.text || "")}
              </td>
              <td>{slot && <CommandLine verb="sdo read" values={{ bus: slot.bus, node: slot.name, object }} />}</td>
              <td>
                <WatchAway watchKey={key} />
              </td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}

function WatchAway({ watchKey: key }: { watchKey: string }) {
  const [view, setView] = useView();
  const away = (event: { stopPropagation: () => void }) => {
    event.stopPropagation();
    setView({ watch: view.watch.filter((entry) => entry !== key) });
  };
  return (
    <button type="button" className="small" aria-label={`Do not watch ${visible(key)}`} onClick={away}>
      ×
    </button>
  );
}
