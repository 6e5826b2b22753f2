import { Act, Answer, useLastOf } from "../../parts/Act";
import { StateMark } from "../../parts/StateMark";
import type { Parameter, Verb } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio, useView } from "../../window/context";
import { bootWords } from "../slots/reducer";
import { BackupRestore } from "./BackupRestore";
import { BACKUP, BOOT_LOG, bootStories, groupsOf, missingOf } from "./reducer";

export function Network() {
  const { store } = useStudio();
  const [verbs, chosen] = useData((state) => [state.data.verbs, state.network.verb] as const);
  const verb = verbs.find((entry) => entry.name === chosen);
  const item = (name: string, help: string) => (
    <button
      key={name}
      type="button"
      aria-pressed={name === chosen}
      title={help}
      onClick={() => store.dispatch({ type: "network/verb", verb: name })}
    >
      {name}
    </button>
  );
  return (
    <div className="columns">
      <nav className="tools" aria-label="Services">
        {item(BOOT_LOG, "each boot-up, step by step")}
        {verbs.some(({ name }) => name === "backup save") &&
          item(BACKUP, "devices' values as DCFs, compared and restored")}
        {groupsOf(verbs).map((group) => (
          <section key={group.title}>
            <h3>{group.title}</h3>
            {group.verbs.map((entry) => item(entry.name, entry.help))}
          </section>
        ))}
      </nav>
      <div className="scroll" tabIndex={0} role="region" aria-label="Service">
        {verb ? <VerbForm verb={verb} key={verb.name} /> : chosen === BACKUP ? <BackupRestore /> : <BootLog />}
      </div>
    </div>
  );
}

const choices: Record<string, string[]> = {
  "nmt command": ["start", "stop", "preop", "reset-node", "reset-comm"],
  "lss global state": ["waiting", "configuration"],
};

function VerbForm({ verb }: { verb: Verb }) {
  const values = useData((state) => state.network.values);
  const [selected, buses] = useData(
    (state) => [state.data.slots.find((slot) => slotKey(slot) === state.view.slot), state.data.buses] as const,
  );
  const last = useLastOf(`network:${verb.name}`);
  const offered: Record<string, string> = {};
  for (const { name } of verb.parameters) {
    if (name === "bus") offered.bus = selected?.bus ?? buses[0]?.name ?? "";
    if (selected && /^(node|slot|target)$/.test(name)) offered[name] = selected.name;
  }
  const whole = Object.fromEntries(Object.entries({ ...offered, ...values }).filter(([, value]) => value !== ""));
  const missing = missingOf(verb, whole);
  return (
    <div className="form">
      <h2>{verb.name}</h2>
      <p>{verb.help}</p>
      {verb.parameters.map((parameter) => (
        <Field key={parameter.name} verb={verb.name} parameter={parameter} offered={offered[parameter.name] ?? ""} />
      ))}
      {missing.length > 0 ? (
        <p className="hint">Still to fill in: {missing.join(", ")}</p>
      ) : (
        <Act verb={verb.name} values={whole} owner={`network:${verb.name}`} label={`Do: ${verb.name}`} primary />
      )}
      <Answer sent={last} />
    </div>
  );
}

function Field({ verb, parameter, offered }: { verb: string; parameter: Parameter; offered: string }) {
  const { store } = useStudio();
  const typed = useData((state) => state.network.values[parameter.name]);
  const buses = useData((state) => state.data.buses);
  const value = typed ?? offered;
  const id = `field-${parameter.name}`;
  const set = (next: string) => store.dispatch({ type: "network/value", name: parameter.name, value: next });
  const list = parameter.name === "bus" ? buses.map((bus) => bus.name) : choices[`${verb} ${parameter.name}`];
  return (
    <div className="field-line">
      <label htmlFor={id}>
        {parameter.name}
        {parameter.required && <span aria-hidden="true"> *</span>}
      </label>
      {parameter.form === "flag" ? (
        <input
          id={id}
          type="checkbox"
          checked={value === "1"}
          onChange={(event) => set(event.target.checked ? "1" : "")}
        />
      ) : list ? (
        <select id={id} value={value} onChange={(event) => set(event.target.value)}>
          <option value="" />
          {list.map((entry) => (
            <option key={entry} value={entry}>
              {visible(entry)}
            </option>
          ))}
        </select>
      ) : (
        <input id={id} value={value} onChange={(event) => set(event.target.value)} />
      )}
      <span className="quiet">{parameter.help}</span>
    </div>
  );
}

function BootLog() {
  const [view, setView] = useView();
  const [slots, events] = useData((state) => [state.data.slots, state.data.events] as const);
  const chosen = slots.filter((slot) => slotKey(slot) === view.slot);
  const stories = bootStories(chosen.length ? chosen : slots, events);
  return (
    <div className="boot-log">
      {stories.map(({ slot, lines }) => (
        <section key={slotKey(slot)}>
          <h3>
            <button type="button" onClick={() => setView({ slot: slotKey(slot) })}>
              <StateMark state={slot.state} /> {slot.id} {visible(slot.name)}
            </button>
            <span className="quiet">{bootWords(slot) || `${slot.state}, no error`}</span>
          </h3>
          <ol className="story">
            {lines.map((event, i) => (
              <li key={i}>
                <span className="number">{event.at_s.toFixed(3)} s</span> {visible(event.text)}
              </li>
            ))}
          </ol>
        </section>
      ))}
    </div>
  );
}
