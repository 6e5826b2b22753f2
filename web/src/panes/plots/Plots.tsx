import { useMemo, useState } from "react";
import { Pause } from "../../parts/Bar";
import { errorTitle, healthWords } from "../../parts/health";
import { csv, download, fileName } from "../../parts/download";
import { count, visible } from "../../protocol/text";
import { isHeard } from "../../store/beneath";
import { slotKey } from "../../store/keys";
import { useData, useStudio } from "../../window/context";
import { Chart, Legend, type Line } from "./Chart";
import { figuresOf, groupsOf, inUnits, noteOfWatched, plotRows, watchParts, type Point } from "./reducer";
import { useErrorFrames } from "../trace/listed";
import { useLayouts } from "./going";
import { signalRows } from "./signals";
import { SignalPlots } from "./Signals";
import { WatchBar, WatchTable } from "./Watch";
import { useWatching } from "./watching";

const spans = [30, 60, 300, 900];

export function Plots() {
  useWatching();
  useLayouts();
  const { store } = useStudio();
  const [span, setSpan] = useState(60);
  const paused = useData((state) => state.plots.paused !== null);
  // What somebody picked comes first.
  const picked = useData((state) => state.view.signals.length > 0);
  const save = () => {
    const { plots, data, dictionary, signals } = store.get();
    const rows = plotRows(
      plots.paused ?? plots,
      data.buses.map((bus) => bus.name),
      (key) => noteOfWatched(dictionary.objects, key),
    );
    download(
      fileName(`${data.machine.name} plots`, "csv", new Date()),
      csv([...rows, ...signalRows(signals)]),
      "text/csv",
    );
  };
  return (
    <>
      <div className="bar">
        <Pause paused={paused} onChange={(now) => store.dispatch({ type: "plots/pause", paused: now })} />
        <label>
          The last
          <select value={span} onChange={(event) => setSpan(Number(event.target.value))}>
            {spans.map((seconds) => (
              <option key={seconds} value={seconds}>
                {seconds < 60 ? `${seconds} s` : `${seconds / 60} min`}
              </option>
            ))}
          </select>
        </label>
        <WatchBar />
        <button type="button" onClick={save}>
          Export as CSV
        </button>
      </div>
      <div className="scroll plots" tabIndex={0} role="region" aria-label="Plots">
        {picked && <SignalPlots span={span} />}
        <BusPlots span={span} />
        <BeatPlot span={span} />
        {!picked && <SignalPlots span={span} />}
        <WatchPlot span={span} />
      </div>
    </>
  );
}

const linesOf = (of: Readonly<Record<string, readonly Point[]>>): Line[] =>
  Object.entries(of).map(([label, points]) => ({ label, points }));

function BusPlots({ span }: { span: number }) {
  const [load, frames, errors] = useData((state) => {
    const { load, frames, errors } = state.plots.paused ?? state.plots;
    return [load, frames, errors] as const;
  });
  const [rated, buses] = useData((state) => [state.rates?.buses, state.data.buses] as const);
  const unheard = buses.filter((bus) => !isHeard(bus)).map((bus) => visible(bus.name));
  const states = rated?.filter((each) => isHeard(buses.find(({ name }) => name === each.bus)));
  const showErrors = useErrorFrames();
  const loads = useMemo(() => linesOf(load), [load]);
  const rates = useMemo(() => linesOf(frames), [frames]);
  const wrong = useMemo(() => linesOf(errors), [errors]);
  return (
    <>
      <section>
        <h2>Load</h2>
        <Legend lines={loads} />
        {unheard.length > 0 && <p className="quiet">{unheard.join(", ")}: not heard, Berth has no port there.</p>}
        <Chart title="Load of each bus" unit="%" lines={loads} span={span} least={percent} />
      </section>
      <section>
        <h2>Frames a second</h2>
        <Legend lines={rates} />
        <Chart title="Frames a second of each bus" unit="/s" lines={rates} span={span} least={fromZero} />
      </section>
      <section className="wide">
        <h2>Error frames a second</h2>
        <Legend lines={wrong} />
        <p className="number quiet">
          {states?.map((bus, i) => (
            <span key={bus.bus}>
              {i > 0 && " · "}
              {visible(bus.bus)}:{" "}
              {bus.errors ? (
                <button
                  type="button"
                  className="words"
                  aria-label={errorTitle(bus)}
                  onClick={() => showErrors(bus.bus)}
                >
                  {healthWords(bus)}
                </button>
              ) : (
                healthWords(bus)
              )}
            </span>
          ))}
        </p>
        <Chart title="Error frames a second of each bus" unit="/s" lines={wrong} span={span} least={oneAtLeast} />
      </section>
    </>
  );
}

const percent = [0, 100] as const;
const fromZero = [0, 0] as const;
const oneAtLeast = [0, 1] as const;
const none: readonly Point[] = [];

/** How regular the heartbeats of the selected device are. */
function BeatPlot({ span }: { span: number }) {
  const [slot, points] = useData((state) => {
    const chosen = state.data.slots.find((entry) => slotKey(entry) === state.view.slot);
    const bus = state.data.buses.findIndex((entry) => entry.name === chosen?.bus);
    const { beats } = state.plots.paused ?? state.plots;
    return [chosen, beats.get(`${bus}/${chosen?.id ?? 0}`) ?? none] as const;
  });
  const heard = useData((state) => isHeard(state.data.buses.find(({ name }) => name === slot?.bus)));
  const lines = useMemo(() => [{ label: "interval", points }], [points]);
  if (!slot || !heard) {
    return (
      <section className="wide">
        <h2>Heartbeat interval</h2>
        <p className="hint">
          {slot
            ? `The heartbeats of ${visible(slot.name)} are not heard: Berth has no port on bus ${visible(slot.bus)}.`
            : "Select a slot in the tree: its heartbeats are measured."}
        </p>
      </section>
    );
  }
  const last = points[points.length - 1]?.[0] ?? 0;
  const figures = figuresOf(points.filter(([at]) => at > last - span));
  const ms = (value: number) => `${value.toFixed(3)} ms`;
  return (
    <section className="wide">
      <h2>
        Heartbeat interval <span className="quiet">{visible(slot.name)}, bus time</span>
      </h2>
      {figures ? (
        <p className="number quiet">
          {count(figures.count)} intervals: mean {ms(figures.mean)}, {ms(figures.least)} to {ms(figures.most)}, standard
          deviation {ms(figures.spread)}
        </p>
      ) : (
        <p className="hint">Two heartbeats of {visible(slot.name)} are needed. Measured while this pane is open.</p>
      )}
      <Chart title={`Heartbeat interval of ${slot.name}`} unit="ms" lines={lines} span={span} />
    </section>
  );
}

function WatchPlot({ span }: { span: number }) {
  const [watch, values, objects] = useData((state) => {
    const { values } = state.plots.paused ?? state.plots;
    return [state.view.watch, values, state.dictionary.objects] as const;
  });
  const plots = useMemo(() => {
    const noteOf = (key: string) => noteOfWatched(objects, key);
    return groupsOf(watch, noteOf).map(({ unit, keys }) => ({
      unit,
      title: keys.map((key) => watchParts(key).object).join(", "),
      lines: keys.map((key): Line => {
        return { label: key, points: inUnits(values[key] ?? none, noteOf(key)), style: watch.indexOf(key) };
      }),
    }));
  }, [watch, values, objects]);
  return (
    <section className="wide">
      <h2>Watch list</h2>
      {watch.length === 0 ? (
        <p className="hint">Select an object in the dictionary and press Watch.</p>
      ) : (
        <>
          <WatchTable />
          {plots.map(({ unit, title, lines }) => (
            <Chart key={unit} title={title} unit={visible(unit)} lines={lines} span={span} />
          ))}
        </>
      )}
    </section>
  );
}
