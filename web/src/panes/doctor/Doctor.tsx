import { Act, Answer, useLastOf } from "../../parts/Act";
import { Check as CheckBox } from "../../parts/Bar";
import { visible } from "../../protocol/text";
import type { Sent } from "../../store/state";
import { slotKey } from "../../store/keys";
import { useData, useStudio, useView } from "../../window/context";
import { checksOf, examines, findingsOf, questions, requestOf, summaryOf, type Check, type Finding } from "./reducer";

const words: Record<(typeof questions)[number], { label: string; hint: string }> = {
  listen: { label: "Listen only", hint: "Nothing is sent." },
  lss: { label: "Ask by LSS, too", hint: "Devices are selected by LSS, one after the other." },
  sdo: { label: "Ask by LSS and SDO, too", hint: "Another SDO client of these devices is disturbed." },
  conformance: {
    label: "Examine one device (CiA 301)",
    hint: "Some 300 SDO accesses. They write only values that were read, or that must be refused.",
  },
};

export function Doctor() {
  const last = useLastOf("doctor");
  return (
    <div className="columns">
      <div className="scroll" tabIndex={0} role="region" aria-label="Doctor">
        <div className="form doctor">
          <Wish asked={last !== undefined} />
          <Report sent={last} />
        </div>
      </div>
    </div>
  );
}

function Wish({ asked }: { asked: boolean }) {
  const { store } = useStudio();
  const [view] = useView();
  const [doctor, slot, can] = useData(
    (state) =>
      [
        state.doctor,
        state.data.slots.find((entry) => slotKey(entry) === view.slot),
        examines(state.data.verbs),
      ] as const,
  );
  const values = requestOf(doctor, slot?.bus ?? "", slot?.name ?? "");
  const offered = questions.filter((entry) => can || entry !== "conformance");
  const examining = doctor.questions === "conformance";
  return (
    <>
      <div className="field-line">
        <label htmlFor="doctor-questions">What it does</label>
        <select
          id="doctor-questions"
          value={doctor.questions}
          onChange={(event) => {
            const chosen = questions.find((entry) => entry === event.target.value);
            if (chosen) store.dispatch({ type: "doctor", change: { questions: chosen } });
          }}
        >
          {offered.map((entry) => (
            <option key={entry} value={entry}>
              {words[entry].label}
            </option>
          ))}
        </select>
        <span className="quiet">{words[doctor.questions].hint}</span>
      </div>
      {!examining && (
        <div className="field-line">
          <label htmlFor="doctor-seconds">Seconds</label>
          <input
            id="doctor-seconds"
            value={doctor.seconds}
            placeholder="5 heartbeat times, 5 s at least"
            onChange={(event) => store.dispatch({ type: "doctor", change: { seconds: event.target.value } })}
          />
          <span className="quiet">how long it listens: 1 to 600</span>
        </div>
      )}
      {examining && !slot && <p className="hint">Select the device in the tree.</p>}
      {!examining && !values && <p className="bad-text">Seconds: a whole number from 1 to 600, or nothing.</p>}
      {values && (
        <Act verb="doctor" values={values} owner="doctor" label={asked ? "Run it again" : "Run the doctor"} primary />
      )}
    </>
  );
}

function Report({ sent }: { sent: Sent | undefined }) {
  const { store } = useStudio();
  const all = useData((state) => state.doctor.all);
  if (!sent) return <p className="hint">It reports what is wrong on the buses, how it knows, and what to do.</p>;
  if (!sent.done) return <Answer sent={sent} />;
  const findings = findingsOf(sent.reply);
  const checks = checksOf(sent.reply);
  const shown = checks.filter((check) => all || check.verdict !== "passed");
  const summary = summaryOf(sent.reply);
  // "No" with findings is an answer, not a failure.
  if (!summary || sent.status > 1) return <Answer sent={sent} />;
  const wrong = findings.length + checks.filter((check) => check.verdict === "failed").length;
  return (
    <>
      <div className={`answer ${wrong ? "bad" : "good"}`} role="status">
        <p>
          {wrong ? `✕ ${wrong} found` : "✓ nothing wrong"}: {visible(summary)}
        </p>
      </div>
      {findings.map((finding, i) => (
        <FindingBox key={i} finding={finding} />
      ))}
      {checks.length > 0 && (
        <CheckBox
          on={all}
          words="what passed, too"
          onChange={(on) => store.dispatch({ type: "doctor", change: { all: on } })}
        />
      )}
      {shown.length > 0 && <Checks checks={shown} sent={sent} />}
    </>
  );
}

function FindingBox({ finding }: { finding: Finding }) {
  const [, setView] = useView();
  const { bus, node, filter } = finding;
  const slot = useData((state) => state.data.slots.find((entry) => entry.bus === bus && entry.id === node));
  return (
    <section className={`finding ${finding.certainty}`}>
      <h3>
        {visible(finding.what)} <span className="quiet">{finding.certainty}</span>
      </h3>
      <ul>
        {finding.evidence.map((line, i) => (
          <li key={i}>{visible(line)}</li>
        ))}
      </ul>
      <p>
        <b>What to do:</b> {visible(finding.todo)}
      </p>
      <div className="row">
        {slot && (
          <button type="button" className="small" onClick={() => setView({ slot: slotKey(slot) })}>
            Select {visible(slot.name)}
          </button>
        )}
        {filter && (
          <button
            type="button"
            className="small"
            onClick={() => setView({ pane: "trace", filter: `${bus} ${filter}` })}
          >
            Frames {filter.slice(0, -1)}h
          </button>
        )}
        <span className="quiet">
          {finding.kind} on {visible(bus)}
        </span>
      </div>
    </section>
  );
}

function Checks({ checks, sent }: { checks: readonly Check[]; sent: Sent }) {
  const [, setView] = useView();
  const slots = useData((state) => state.data.slots);
  const { bus, conformance } = sent.values;
  const slot = slots.find((entry) => entry.bus === bus && entry.name === conformance);
  return (
    <table className="rows">
      <thead>
        <tr>
          <th>Verdict</th>
          <th>CiA 301</th>
          <th>Object</th>
          <th>What must be so</th>
          <th>The device</th>
        </tr>
      </thead>
      <tbody>
        {checks.map((check, i) => (
          <tr key={i}>
            <td className={check.verdict === "failed" ? "bad-text" : "quiet"}>{check.verdict}</td>
            <td className="number">§{check.paragraph}</td>
            <td>
              {check.object && slot ? (
                <button
                  type="button"
                  className="small number"
                  onClick={() => setView({ pane: "dictionary", slot: slotKey(slot), object: check.object })}
                >
                  {check.object}
                </button>
              ) : (
                check.object
              )}
            </td>
            <td>{visible(check.what)}</td>
            <td>{visible(check.told)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
