import { useEffect, useMemo, useState } from "react";
import { signalOf, valueWords, type FoundSignal } from "../../can/signals";
import { visible } from "../../protocol/text";
import { signalChange } from "../../store/view";
import { useData, useStudio, useView } from "../../window/context";
import { frameNumbered } from "../trace/reducer";
import { Chart, Swatch } from "./Chart";
import { useGoToFrame } from "./going";
import { endOf, frameNear, held, type SignalLine, type SignalLines } from "./signals";

const EVERY_MS = 200;

/** The lines as they are, five times a second: frames come oftener. */
function useLines(): SignalLines {
  const { store } = useStudio();
  const paused = useData((state) => state.signals.paused);
  const chosen = useData((state) => state.view.signals);
  const [live, setLive] = useState(() => store.get().signals.lines);
  useEffect(() => {
    setLive(store.get().signals.lines);
    const timer = setInterval(() => setLive(store.get().signals.lines), EVERY_MS);
    return () => clearInterval(timer);
  }, [store, chosen]);
  return paused ?? live;
}

/** Bus time at the right edge of all plots. */
function useNow(): number {
  const { store } = useStudio();
  const paused = useData((state) => (state.signals.paused ? state.signals.pausedNow : null));
  const [live, setLive] = useState(() => store.get().signals.now);
  useEffect(() => {
    const timer = setInterval(() => setLive(store.get().signals.now), EVERY_MS);
    return () => clearInterval(timer);
  }, [store]);
  return paused ?? live;
}

interface Drawn {
  key: string;
  /** Its place in the list: colour and shape. */
  i: number;
  found: FoundSignal | null;
  line: SignalLine;
}

const none: SignalLine = { points: [], frames: [] };

/** Signals of messages, from the frames as they come: a plot for each unit. */
export function SignalPlots({ span }: { span: number }) {
  const lines = useLines();
  const [chosen, layouts] = useData((state) => [state.view.signals, state.signals.layouts] as const);
  const drawn = useMemo(
    () => chosen.map((key, i): Drawn => ({ key, i, found: signalOf(layouts, key), line: lines.get(key) ?? none })),
    [chosen, layouts, lines],
  );
  const units = [...new Set(drawn.map(({ found }) => found?.signal.unit ?? ""))];
  return (
    <section className="wide">
      <h2>
        Signals <span className="quiet">from the frames, bus time</span>
      </h2>
      {chosen.length === 0 ? (
        <p className="hint">Select a frame in the trace and press Plot beside one of its signals.</p>
      ) : (
        <>
          <SignalTable drawn={drawn} />
          {units.map((unit) => (
            <UnitPlot
              key={unit}
              unit={unit}
              drawn={drawn.filter(({ found }) => (found?.signal.unit ?? "") === unit)}
              span={span}
            />
          ))}
        </>
      )}
    </section>
  );
}

const nameOf = ({ found, key }: Drawn): string => (found ? `${found.of.sender} ${found.signal.name}`.trim() : key);

function UnitPlot({ unit, drawn, span }: { unit: string; drawn: Drawn[]; span: number }) {
  const goTo = useGoToFrame();
  const [at, mark] = useData((state) => {
    const { frame } = state.view;
    const chosen = frame === null ? null : frameNumbered(state.trace.pieces, frame);
    return [state.signals.at, state.signals.at ?? chosen?.seconds ?? null] as const;
  });
  const now = useNow();
  const end = endOf(now, at, span);
  const lines = useMemo(
    () =>
      drawn.map((each) => ({ label: nameOf(each), style: each.i, points: held(each.line.points, end - span, end) })),
    [drawn, end, span],
  );
  const pick = (seconds: number) => {
    const frame = frameNear(
      drawn.map(({ line }) => line),
      seconds,
    );
    if (frame !== null) goTo(frame);
  };
  const title = drawn.map(nameOf).join(", ");
  return <Chart title={title} unit={unit} lines={lines} span={span} end={end} mark={mark} steps onPick={pick} />;
}

/** The legend, the newest values, and a way to the newest frame of each for who has no mouse. */
function SignalTable({ drawn }: { drawn: Drawn[] }) {
  const { store } = useStudio();
  const [view, setView] = useView();
  const goTo = useGoToFrame();
  const newest = ({ found, line }: Drawn): string => {
    const n = line.frames[line.frames.length - 1];
    const frame = n === undefined ? null : frameNumbered(store.get().trace.pieces, n);
    if (found && frame) return valueWords(frame.data, found.signal);
    const last = line.points[line.points.length - 1];
    return last ? `${last[1]} ${found?.signal.unit ?? ""}` : "no frame yet";
  };
  return (
    <table className="rows watch signal-list">
      <thead>
        <tr>
          <th>Line</th>
          <th>Sender</th>
          <th>Signal</th>
          <th className="right">Value</th>
          <th>Message</th>
          <th>
            <span className="unseen">Acts</span>
          </th>
        </tr>
      </thead>
      <tbody>
        {drawn.map((each) => {
          const { key, i, found, line } = each;
          const last = line.frames[line.frames.length - 1];
          return (
            <tr key={key}>
              <td>
                <Swatch i={i} />
              </td>
              <td>{visible(found?.of.sender ?? "")}</td>
              <td>
                {visible(found?.signal.name ?? "The machine has no such signal")}{" "}
                <span className="quiet">{found?.signal.object}</span>
              </td>
              <td className="number right">{visible(newest(each))}</td>
              <td>
                {visible(found?.of.name ?? "")} <span className="quiet">{visible(key)}</span>
              </td>
              <td>
                {last !== undefined && (
                  <button type="button" onClick={() => goTo(last)}>
                    In the trace
                  </button>
                )}
                <button
                  type="button"
                  aria-label={`Do not plot ${visible(nameOf(each))}`}
                  onClick={() => setView(signalChange(view, key))}
                >
                  ×
                </button>
              </td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
