import { Act, Answer, useLastOf } from "../../parts/Act";
import { StateWord, toneOf } from "../../parts/StateMark";
import type { Event, Slot } from "../../protocol/messages";
import { addressOf, LSS_ADDRESS, serialWords, typeWords, visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio, useView } from "../../window/context";
import { deviceKey, deviceName, straysOf } from "../machine/strays";
import { Backup } from "./Backup";
import {
  bootWords,
  emcyWords,
  eventsOf,
  forgettable,
  isReplaced,
  needOf,
  questionOf,
  replacementSteps,
  savesFirst,
} from "./reducer";

const stepMarks = { done: "✓", now: "▸", later: "·" };

export function SlotInspector({ slot }: { slot: Slot }) {
  const { store } = useStudio();
  const [events, questions, time, replacing] = useData(
    (state) => [state.data.events, state.data.questions, state.data.time, state.slots.replacing] as const,
  );
  const key = slotKey(slot);
  const owner = `slots:${key}`;
  const last = useLastOf(owner);
  const need = needOf(slot);
  // A device that must save first is not to be replaced.
  const saves = savesFirst(slot, events);
  const offersReplace = need?.act === "replace" && !saves;
  const question = questionOf(slot, questions);
  const follows = replacing?.slot === key && !isReplaced(slot, events, replacing.atS);
  // `replace` before the spare is there: no failure, it waits.
  const waitsForSpare = follows && last?.verb === "replace" && last.status === 1 && slot.state === "empty";
  const target = { bus: slot.bus, slot: slot.name };
  const follow = () => store.dispatch({ type: "slots/replacing", replacing: { slot: key, atS: time } });
  const replace = (
    <Act verb="replace" values={target} owner={owner} label="Replace" primary={offersReplace} then={follow} />
  );
  return (
    <section>
      <h2>{visible(slot.name)}</h2>
      <StateWord state={slot.state} />
      {need && (
        <div className={`need-box need-${toneOf(slot.state)}`}>
          <p>
            <b>{need.what}</b> {need.todo}
          </p>
          {!follows && offersReplace && replace}
          {question && <Question question={question} slot={slot} owner={owner} />}
          {slot.state === "empty" && <Others bus={slot.bus} />}
        </div>
      )}
      {saves && <FirstSave slot={slot} owner={owner} />}
      {slot.reason && <p className="reason">{visible(slot.reason)}</p>}
      {follows && <Steps slot={slot} events={events} sinceS={replacing.atS} />}
      {!waitsForSpare && <Answer sent={last} />}
      <Facts slot={slot} />
      <details className="acts" open={!need}>
        <summary>More acts</summary>
        <Act
          verb="locate"
          values={{ bus: slot.bus, target: slot.name, anyway: "1" }}
          owner={owner}
          label="Locate: let it flicker"
        />
        {!offersReplace && replace}
        <Act verb="history" values={target} owner={owner} label="Who sat here before" />
        <Backup slot={slot} />
        {forgettable(slot, events).map((address) => (
          <Act
            key={address}
            verb="forget"
            values={{ bus: slot.bus, device: address }}
            owner={owner}
            label={`Forget ${address}`}
          />
        ))}
      </details>
      <History events={eventsOf(slot, events)} />
    </section>
  );
}

/** `berth up` asks the same on its terminal: "save SLOT". */
function FirstSave({ slot, owner }: { slot: Slot; owner: string }) {
  const target = { bus: slot.bus, node: slot.name };
  return (
    <div className="need-box need-question">
      <p>
        <b>Its memory holds nothing that was saved.</b> Save its parameters, then reset it. If its program ends at that,
        start it again.
      </p>
      <Act verb="store" values={target} owner={owner} label="Save its parameters" primary />
      <Act verb="nmt" values={{ ...target, command: "reset-node", "no-wait": "1" }} owner={owner} label="Reset it" />
    </div>
  );
}

/** Devices that are on the bus and did not get this slot. */
function Others({ bus }: { bus: string }) {
  const [, setView] = useView();
  const strays = useData(straysOf).filter((device) => device.bus === bus);
  if (!strays.length) return null;
  return (
    <>
      <p>On the bus, without a slot:</p>
      {strays.map((device) => (
        <button key={deviceKey(device)} type="button" onClick={() => setView({ device: deviceKey(device) })}>
          {deviceName(device)}
        </button>
      ))}
    </>
  );
}

function Question({ question, slot, owner }: { question: Event; slot: Slot; owner: string }) {
  const devices = question.devices ?? LSS_ADDRESS.exec(question.text)?.slice(0, 1) ?? [];
  return (
    <>
      <p>{visible(question.text)}</p>
      {devices.map((device) => (
        <div key={device} className="choice">
          <p className="number">
            serial number <b>{serialWords(`0x${device.replace(/-/g, "").slice(16)}`).serial}</b>
          </p>
          <Act verb="locate" values={{ bus: slot.bus, target: device }} owner={owner} label="Locate" />
          <Act
            verb="replace"
            values={{ bus: slot.bus, slot: slot.name, device }}
            owner={owner}
            label={`This one is ${visible(slot.name)}`}
            primary
          />
        </div>
      ))}
    </>
  );
}

function Steps({ slot, events, sinceS }: { slot: Slot; events: Event[]; sinceS: number }) {
  return (
    <ol className="steps" aria-label="Replacement">
      {replacementSteps(slot, events, sinceS).map((step) => (
        <li key={step.text} className={step.at}>
          <span aria-hidden="true">{stepMarks[step.at]}</span> {visible(step.text)}
          <span className="unseen">{step.at === "done" ? "done" : ""}</span>
        </li>
      ))}
    </ol>
  );
}

function Facts({ slot }: { slot: Slot }) {
  const { revision, serial } = serialWords(slot.r_sn);
  const facts: [string, string][] = [
    ["Node-ID", `${slot.id} on ${visible(slot.bus)}`],
    ["Vendor / product", typeWords(slot.type)],
    ["Revision", revision],
    ["Serial number", serial],
    ["LSS address", addressOf(slot.type, slot.r_sn) ?? ""],
    ["Since", `${slot.since_s.toFixed(3)} s`],
    ["NMT state", slot.nmt ?? ""],
    ["EMCY", slot.emcy ? `${emcyWords(slot.emcy)} ${visible(slot.emcy.text)}` : ""],
    ["Boot-up", slot.state === "empty" ? "" : bootWords(slot)],
  ];
  return (
    <dl>
      {facts
        .filter(([, value]) => value)
        .map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
    </dl>
  );
}

function History({ events }: { events: Event[] }) {
  if (!events.length) return null;
  return (
    <>
      <h3>What happened here</h3>
      <ol className="story">
        {events
          .slice(-12)
          .reverse()
          .map((event, i) => (
            <li key={i}>
              <span className="number">{event.at_s.toFixed(3)} s</span> {visible(event.text)}
            </li>
          ))}
      </ol>
    </>
  );
}
