import { useState } from "react";
import { crcOf, fieldMeaning, fieldRuns, fieldValue, wireBits, type FieldRun } from "../../can/bits";
import { clauses } from "../../can/words";
import { count, hex, visible } from "../../protocol/text";
import { useData, useView } from "../../window/context";
import { frameNumbered, knownOf, markChange, meaningIn } from "./reducer";

export function FrameInspector({ n }: { n: number }) {
  const [view, setView] = useView();
  const [trace, buses, known] = useData((state) => [state.trace, state.data.buses, knownOf(state)] as const);
  const frame = frameNumbered(trace.paused?.pieces ?? trace.pieces, n) ?? frameNumbered(trace.pieces, n);
  if (!frame) return <p className="hint">Frame {count(n)} is not on this page any more.</p>;
  const meaning = meaningIn(frame, known);
  const bus = buses[frame.bus];
  const wire = wireBits(frame);
  const stuffBits = wire.filter((bit) => bit.stuff).length;
  const micros = bus ? (wire.length / bus.bit_rate) * 1e6 : 0;
  const facts: [string, string][] = [
    ["Identifier", `${hex(frame.id, frame.extended ? 8 : 3)}, ${frame.extended ? 29 : 11} bits`],
    ["Message", `${meaning.service}${meaning.node ? `, node ${meaning.node}` : ""}`],
    ["Described in", clauses[meaning.service]],
    ["Time", `${frame.seconds.toFixed(6)} s on ${visible(bus?.name ?? "")}`],
    ["On the wire", `${wire.length} bits, ${stuffBits} of them stuff bits, ${micros.toFixed(0)} µs`],
    ["CRC", hex(crcOf(frame), 4)],
  ];
  return (
    <section>
      <h2>Frame {count(frame.n)}</h2>
      <p>{visible(trace.texts.get(frame.n) ?? meaning.text)}</p>
      {meaning.object && (
        <button type="button" onClick={() => setView({ pane: "dictionary", object: meaning.object ?? "" })}>
          Object {meaning.object} in the dictionary
        </button>
      )}
      <button
        type="button"
        title="M"
        aria-pressed={view.marks.includes(n)}
        onClick={() => setView(markChange(view, n))}
      >
        {view.marks.includes(n) ? "Take the marker away" : "Set a marker"}
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
      {frame.data.length > 0 && <DataBytes data={frame.data} />}
      <h3>Bits on the wire</h3>
      <Bits runs={fieldRuns(wire)} />
    </section>
  );
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
