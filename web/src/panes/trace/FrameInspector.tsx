import { useState } from "react";
import { crcOf, fieldMeaning, fieldRuns, fieldValue, wireBits, type FieldRun } from "../../can/bits";
import { busErrorOf, clauses } from "../../can/words";
import type { Frame } from "../../protocol/batch";
import { count, hex, visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio, useView } from "../../window/context";
import { FrameSignals } from "./SignalChips";
import { choose, useListed } from "./listed";
import { frameNumbered, markChange, meaningIn } from "./reducer";

export function FrameInspector({ n }: { n: number }) {
  const { store } = useStudio();
  const [view, setView] = useView();
  const { list: trace, known, picked } = useListed();
  const [buses, slots] = useData((state) => [state.data.buses, state.data.slots] as const);
  const frame = frameNumbered(trace.paused?.pieces ?? trace.pieces, n) ?? frameNumbered(trace.pieces, n);
  if (!frame) return <p className="hint">Frame {count(n)} is not on this page any more.</p>;
  const meaning = meaningIn(frame, known);
  const busName = known.buses[frame.bus] ?? "";
  const bus = buses.find((entry) => entry.name === busName);
  // Of an opened file the machine may not have the node.
  const object = slots.some((slot) => slotKey(slot) === view.slot && slot.bus === busName) ? meaning.object : undefined;
  const drawn = !frame.error && !frame.cut;
  const wire = drawn ? wireBits(frame) : [];
  const stuffBits = wire.filter((bit) => bit.stuff).length;
  const micros = bus ? (wire.length / bus.bit_rate) * 1e6 : 0;
  const facts: [string, string][] = [
    ["Identifier", frame.error ? "" : `${hex(frame.id, frame.extended ? 8 : 3)}, ${frame.extended ? 29 : 11} bits`],
    ["Message", `${meaning.service}${meaning.node ? `, node ${meaning.node}` : ""}`],
    ["Described in", clauses[meaning.service]],
    ["Time", `${frame.seconds.toFixed(6)} s on ${visible(busName)}`],
    ...(frame.error ? errorFacts(frame) : []),
    [
      "On the wire",
      drawn ? `${wire.length} bits, ${stuffBits} of them stuff bits${bus ? `, ${micros.toFixed(0)} µs` : ""}` : "",
    ],
    ["CRC", drawn ? hex(crcOf(frame), 4) : ""],
  ];
  return (
    <section>
      <h2>
        {frame.error ? "Error" : "Frame"} {count(frame.n)}
      </h2>
      <p>{visible(trace.texts.get(frame.n) ?? meaning.text)}</p>
      {frame.error && alone(frame) && (
        <p className="hint">
          No node acknowledged the frame: no other node was on the bus at this time. It is sent again. One such error
          when a machine is switched on is harmless: Berth was there before the devices.
        </p>
      )}
      {object && (
        <button type="button" onClick={() => setView({ pane: "dictionary", object })}>
          Object {object} in the dictionary
        </button>
      )}
      <button
        type="button"
        title="M"
        aria-pressed={picked.marks.includes(n)}
        onClick={() => choose(store, markChange(picked, n))}
      >
        {picked.marks.includes(n) ? "Take the marker away" : "Set a marker"}
      </button>
      <dl>
        {facts
          .filter(([, value]) => value)
          .map(([name, value]) => (
            <div key={name}>
              <dt>{name}</dt>
              <dd className="number">{value}</dd>
            </div>
          ))}
      </dl>
      <FrameSignals frame={frame} known={known} />
      {frame.data.length > 0 && !frame.error && <DataBytes data={frame.data} />}
      {frame.cut && <p className="hint">An FD frame: these are its first eight bytes.</p>}
      {drawn && <h3>Bits on the wire</h3>}
      {drawn && <Bits runs={fieldRuns(wire)} />}
    </section>
  );
}

function errorFacts(frame: Frame): [string, string][] {
  const { kind, place, sending, counters } = busErrorOf(frame.id, frame.data);
  return [
    ["What", kind],
    ["Where", place],
    ["Seen by", sending ? "who sent the frame" : "a receiver"],
    ["Its counters", counters ? `TEC ${counters[0]}, REC ${counters[1]}` : ""],
  ];
}

/** A sender that got no acknowledgement. */
function alone(frame: Frame): boolean {
  const { place, sending } = busErrorOf(frame.id, frame.data);
  return sending && place === "ACK slot";
}

function DataBytes({ data }: { data: Uint8Array }) {
  return (
    <table className="bytes">
      <thead>
        <tr>
          <th>Byte</th>
          <th>Hex</th>
          <th>Dec</th>
          <th>Bits 7 … 0</th>
        </tr>
      </thead>
      <tbody>
        {[...data].map((byte, i) => (
          <tr key={i}>
            <td>{i}</td>
            <td>{hex(byte, 2)}</td>
            <td>{byte}</td>
            <td>{byte.toString(2).padStart(8, "0")}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function runName(run: FieldRun): string {
  return run.field === "data" ? `byte ${run.byte ?? 0}` : run.field;
}

function Bits({ runs }: { runs: FieldRun[] }) {
  const [chosen, setChosen] = useState(0);
  const run = runs[chosen];
  return (
    <>
      {run && (
        <p className="meaning">
          <b>{runName(run)}</b> = {hex(fieldValue(run))}, from bit {run.at} on. {fieldMeaning[run.field]}
        </p>
      )}
      <div className="bits">
        {runs.map((entry, i) => (
          <button
            key={entry.at}
            type="button"
            className={`field field-${entry.field.replace(/\W/g, "-")}`}
            aria-pressed={i === chosen}
            onClick={() => setChosen(i)}
          >
            <span className="field-name">{runName(entry)}</span>
            <span className="field-bits">
              {entry.bits.map((bit, k) => (
                <span key={k} className={`bit ${bit.stuff ? "stuff" : ""}`}>
                  {bit.value}
                </span>
              ))}
            </span>
          </button>
        ))}
      </div>
      <p className="hint">
        0 dominant, 1 recessive. <span className="bit stuff">1</span> A stuff bit, put in after five equal bits.
      </p>
    </>
  );
}
