import { useMemo, useState } from "react";
import { commandLine } from "../protocol/command";
import { visible } from "../protocol/text";
import type { Sent } from "../store/state";
import { barrier } from "../store/barrier";
import { overtaken, type Since } from "../store/overtaken";
import { act, useData, useStudio } from "../window/context";
import { StateWord } from "./StateMark";
import { storyOf, toldOf } from "./told";

/** The request as a command line, and a button that copies it. */
export function CommandLine({ verb, values }: { verb: string; values: Record<string, string> }) {
  const [verbs, file] = useData((state) => [state.data.verbs, state.data.machine.file] as const);
  return <Command command={commandLine(verb, values, verbs, file)} />;
}

/** `what` it is: a command, or a line of a file. */
export function Command({ command, what = "command" }: { command: string; what?: "command" | "line" }) {
  const { store } = useStudio();
  const file = useData((state) => state.data.machine.file);
  const [copied, setCopied] = useState(false);
  // The whole path is copied, and its end is shown.
  const shown = file ? command.replace(file, file.slice(file.lastIndexOf("/") + 1)) : command;
  const copy = () => {
    void navigator.clipboard.writeText(command).then(() => {
      setCopied(true);
      store.dispatch({ type: "window", change: { notice: `The ${what} is copied.` } });
      setTimeout(() => setCopied(false), 1500);
    });
  };
  return (
    <div className="command">
      <code title={visible(command)}>{visible(shown)}</code>
      <button type="button" className="small" onClick={copy} aria-label={`Copy ${what}: ${visible(command)}`}>
        {copied ? "Copied" : "Copy"}
      </button>
    </div>
  );
}

interface ActProps {
  verb: string;
  values: Record<string, string>;
  owner: string;
  label: string;
  primary?: boolean;
  then?: () => void;
}

/** A button that sends a request, with its command line beneath. Not shown when the server does not have the verb. */
export function Act({ verb, values, owner, label, primary, then }: ActProps) {
  const studio = useStudio();
  const [known, blocked] = useData((state) => {
    const ofPlant = verb === "sim" && state.data.machine.simulated;
    return [ofPlant || state.data.verbs.some(({ name }) => name === verb), barrier(state, verb, values)] as const;
  });
  if (!known) return null;
  const run = () => {
    act(studio, [{ verb, values, owner }]);
    then?.();
  };
  return (
    <div className="act">
      <button
        type="button"
        className={primary ? "primary" : ""}
        disabled={blocked !== null}
        title={blocked ?? ""}
        onClick={run}
      >
        {label}
      </button>
      <CommandLine verb={verb} values={values} />
      {blocked && <p className="hint">{blocked}</p>}
    </div>
  );
}

/** The answer of the last request of an owner. */
export function Answer({ sent }: { sent: Sent | undefined }) {
  const slots = useData((state) => state.data.slots);
  const since = useMemo(() => (sent ? overtaken(sent, slots) : null), [sent, slots]);
  if (!sent) return null;
  if (!sent.done) return <p className="answer busy">Asked: {sent.verb} …</p>;
  if (since) return <Past sent={sent} since={since} />;
  const failed = sent.status !== 0;
  return (
    <div className={`answer ${failed ? "bad" : "good"}`} role="status">
      <p>{failed ? `✕ ${sent.verb}: no (${sent.status})` : `✓ ${sent.verb}: done`}</p>
      {sent.error && <p>{visible(sent.error)}</p>}
      <Told sent={sent} />
    </div>
  );
}

function Told({ sent }: { sent: Sent }) {
  const { slots, lines } = useMemo(() => toldOf(sent.lines, sent.reply), [sent]);
  if (sent.verb === "history" && lines.length)
    return (
      <ol className="story">
        {storyOf(lines).map(({ when, what }, i) => (
          <li key={i}>
            <span className="number">{visible(when)}</span> {visible(what)}
          </li>
        ))}
      </ol>
    );
  return (
    <>
      {slots.map(({ bus, id, name, state }) => (
        <p key={`${bus}/${id}`}>
          <StateWord state={state} /> {visible(name)}, node-ID {id} on {visible(bus)}
        </p>
      ))}
      {lines.length > 0 && <pre tabIndex={0}>{lines.map(visible).join("\n")}</pre>}
    </>
  );
}

/** An answer that tells no longer how things are. */
function Past({ sent, since }: { sent: Sent; since: Since }) {
  const who = since.name ? `${visible(since.name)} has` : "All slots have";
  return (
    <div className="answer past" role="status">
      <p>
        {who} become {since.state} since ({since.sinceS.toFixed(3)} s).
        {sent.verb !== "replace" && " Ask again if you still want it."}
      </p>
      <details>
        <summary>
          What {sent.verb} answered at {sent.answeredS.toFixed(3)} s
        </summary>
        {sent.error && <p>{visible(sent.error)}</p>}
        <Told sent={sent} />
      </details>
    </div>
  );
}

export function useLastOf(owner: string): Sent | undefined {
  return useData((state) => state.requests.findLast((sent) => sent.owner === owner));
}
