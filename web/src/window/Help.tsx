import { useEffect, useRef } from "react";
import { StateMark, states } from "../parts/StateMark";
import { useData, useStudio } from "../window/context";
import { usePanes } from "./Panes";

const around: [string, string][] = [
  ["Top", "The machine, whether real buses are locked, your role, “Find or do”, help, colours."],
  ["Left", "Buses and slots, each with its state; devices without a slot. A press selects one in every pane."],
  [
    "Right, the inspector",
    "What is selected: facts, what is wrong and what to do, acts. Each act is shown as its command.",
  ],
  ["Below", "Events. “N need somebody” leads to the next slot or device that does."],
];

const keys: [string, string][] = [
  ["?", "this help"],
  ["Ctrl K", "Find or do: panes, slots, devices, objects that were read, acts"],
  ["Alt 1 to Alt 9", "the panes, from left to right"],
  ["/", "the pane's search or filter"],
  ["P", "pause the trace or the plots, or go on"],
  ["M", "set a marker on the selected frame, or take it away"],
  ["Up, Down", "next row: tree, slots, frames, objects"],
  ["Left, Right", "close or open the SDO transfer that is selected"],
  ["Escape", "close a dialog; else select nothing"],
];

const colours: [tone: string, words: string][] = [
  ["good", "Green: it runs. In the trace: heartbeats, PDOs."],
  ["busy", "Blue: Berth is at work on it. In the trace: SDO."],
  ["absent", "Grey: nothing is there. In the trace: SYNC, TIME."],
  ["question", "Amber: it waits for you. In the trace: an SDO abort."],
  ["bad", "Red: something is wrong. In the trace: EMCY, error frames."],
];

const roles: [string, string][] = [
  ["view", "sees everything and may ask, changes nothing"],
  ["operate", "besides: start, stop, reset, replace and locate devices, unlock real buses, hold a simulated machine"],
  ["configure", "everything: also objects, parameters, programs, LSS"],
];

/** docs/studio.md in one page, for who has not read it. */
export function Help() {
  const { store } = useStudio();
  const panes = usePanes();
  const role = useData((state) => state.data.role);
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  const close = () => store.dispatch({ type: "window", change: { help: false } });
  return (
    <dialog ref={dialog} className="help" onClose={close} aria-label="Help">
      <div className="help-head">
        <h2>Help</h2>
        <button type="button" autoFocus onClick={() => dialog.current?.close()}>
          Close
        </button>
      </div>
      <div className="help-body" tabIndex={0} role="region" aria-label="Help text">
        <div className="help-columns">
          <Part title="Panes" rows={panes.map(({ title, about }) => [title, about])} />
          <Part title="Around them" rows={around} />
          <Part title="Keys" rows={keys} className="by-key" />
          <section>
            <h3>States of a slot</h3>
            <dl>
              {states.map(({ state, about }) => (
                <div key={state}>
                  <dt>
                    <StateMark state={state} /> {state}
                  </dt>
                  <dd>{about}</dd>
                </div>
              ))}
            </dl>
          </section>
          <section>
            <h3>Colours</h3>
            <ul>
              {colours.map(([tone, words]) => (
                <li key={tone} className={`tone-${tone}`}>
                  {words}
                </li>
              ))}
            </ul>
          </section>
          <Part title={`Roles; yours is ${role}`} rows={roles} />
          <section>
            <h3>More to read</h3>
            <p>
              In Berth&apos;s folder <code>docs/studio.md</code> describes these pages, and README.md lists all
              documents. On the command line <code>berth help</code> lists the commands;{" "}
              <code>berth help sdo read</code> explains one.
            </p>
          </section>
        </div>
      </div>
    </dialog>
  );
}

function Part({ title, rows, className }: { title: string; rows: [string, string][]; className?: string }) {
  return (
    <section className={className}>
      <h3>{title}</h3>
      <dl>
        {rows.map(([name, words]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{words}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}
