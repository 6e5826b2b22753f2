import { messageKey, signalKey, valueWords, type Message, type Signal } from "../../can/signals";
import type { Frame } from "../../protocol/batch";
import { visible } from "../../protocol/text";
import { MOST_SIGNALS, signalChange } from "../../store/view";
import { useData, useStudio, useView } from "../../window/context";
import { useGoToTime } from "../plots/going";
import { listedOf, type Known } from "./reducer";

/** The message that a frame is; null: nobody said what it carries. */
export function useMessageOf(): (frame: Frame, known: Known) => Carried | null {
  const layouts = useData((state) => state.signals.layouts);
  return (frame, known) => {
    if (frame.error || frame.remote) return null;
    const key = messageKey(known.buses[frame.bus] ?? "", frame.id, frame.extended);
    const message = layouts.get(key);
    return message ? { key, message } : null;
  };
}

/** What a frame carries, and the key of its message. */
export interface Carried {
  key: string;
  message: Message;
}

export const isPdo = ({ message }: Carried): boolean => message.name.includes("PDO");

/** Short, to leave room for the signals: "TPDO 1 of belt". */
const pdoParts = ({ message: { name, sender } }: Carried): [string, string] => [name, sender ? ` of ${sender}` : ""];

interface Told {
  signal: Signal;
  words: string;
}

/** Those that are in the frame. */
const toldOf = (frame: Frame, { message }: Carried): Told[] =>
  message.signals.map((signal) => ({ signal, words: valueWords(frame.data, signal) })).filter(({ words }) => words);

/** "TPDO 1 of belt: Speed 12 rpm, Drive.State 3": what a row has, also what it has no room for. */
export function carriedWords(frame: Frame, of: Carried): string {
  const told = toldOf(frame, of).map(({ signal, words }) => `${signal.name} ${words}`);
  return pdoParts(of).join("") + (told.length ? `: ${told.join(", ")}` : "");
}

/** A name is cut in its middle: its record gives way before its own part. */
function SignalWords({ signal: { name }, words }: Told) {
  const dot = name.lastIndexOf(".") + 1;
  return (
    <>
      <span>{visible(name.slice(0, dot))}</span>
      <span>{visible(name.slice(dot))}</span>
      <b>{visible(words)}</b>
    </>
  );
}

/** What a PDO carries, in its row; a press on a signal plots it. While rows run by, they are only shown. */
export function PdoWords({ frame, of, still }: { frame: Frame; of: Carried; still: boolean }) {
  const { store } = useStudio();
  const plotted = useData((state) => state.view.signals);
  const [name, sender] = pdoParts(of);
  return (
    <>
      <span className="kept">{visible(name)}</span>
      <span className="gives">{visible(sender)}</span>
      {toldOf(frame, of).map((told) => {
        const key = signalKey(of.key, told.signal);
        if (!still)
          return (
            <span key={key} className="signal passing">
              <SignalWords {...told} />
            </span>
          );
        return (
          <button
            key={key}
            type="button"
            className="signal"
            tabIndex={-1}
            aria-pressed={plotted.includes(key)}
            title={`${visible(told.signal.name)}: ${plotted.includes(key) ? "do not plot it" : "plot it"}`}
            onClick={(event) => {
              event.stopPropagation();
              store.dispatch({ type: "view", change: signalChange(store.get().view, key) });
            }}
          >
            <SignalWords {...told} />
          </button>
        );
      })}
    </>
  );
}

/** The signals of the frame that the inspector shows: their values, and the way to the plot. */
export function FrameSignals({ frame, known }: { frame: Frame; known: Known }) {
  const [view, setView] = useView();
  const ofFile = useData((state) => listedOf(state).file !== null);
  const goToTime = useGoToTime();
  const of = useMessageOf()(frame, known);
  if (!of) return null;
  const full = view.signals.length >= MOST_SIGNALS;
  const keys = of.message.signals.map((signal) => signalKey(of.key, signal));
  const plotted = keys.some((key) => view.signals.includes(key));
  return (
    <>
      <h3>
        Signals <span className="quiet">{visible(`${of.message.name} ${of.message.sender}`)}</span>
      </h3>
      <table className="rows signals">
        <tbody>
          {of.message.signals.map((signal, i) => {
            const key = keys[i] ?? "";
            const on = view.signals.includes(key);
            return (
              <tr key={key}>
                <td>
                  {visible(signal.name)} <span className="quiet">{signal.object}</span>
                </td>
                <td className="number right">{visible(valueWords(frame.data, signal) || "not in it")}</td>
                <td>
                  {!ofFile && (
                    <button
                      type="button"
                      aria-pressed={on}
                      disabled={full && !on}
                      title={full && !on ? `${MOST_SIGNALS} signals are plotted: take one away first` : ""}
                      aria-label={`${on ? "Do not plot" : "Plot"} ${visible(signal.name)}`}
                      onClick={() => setView(signalChange(view, key))}
                    >
                      {on ? "Do not plot" : "Plot"}
                    </button>
                  )}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
      {plotted && !ofFile && (
        <button type="button" onClick={() => goToTime(frame.seconds)}>
          Its place in the plot
        </button>
      )}
    </>
  );
}
