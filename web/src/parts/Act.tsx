import { useState } from "react";
import { commandLine } from "../protocol/command";
import { visible } from "../protocol/text";
import type { Sent } from "../store/state";
import { barrier } from "../store/barrier";
import { act, useData, useStudio } from "../window/context";

/** The request as a command line, and a button that copies it. */
export function CommandLine({ verb, values }: { verb: string; values: Record<string, string> }) {
  const [verbs, file] = useData((state) => [state.data.verbs, state.data.machine.file] as const);
  return <Command command={commandLine(verb, values, verbs, file)} />;
}

export function Command({ command }: { command: string }) {
  const { store } = useStudio();
  const file = useData((state) => state.data.machine.file);
  const [copied, setCopied] = useState(false);
  // The whole path is copied, and its end is shown.
  const shown = file ? command.replace(file, file.slice(file.lastIndexOf("/") + 1)) : command;
  const copy = () => {
    void navigator.clipboard.writeText(command).then(() => {
      setCopied(true);
      store.dispatch({ type: "window", change: { notice: "Command copied." } });
      setTimeout(() => setCopied(false), 1500);
    });
  };
  return (
    <div className="command">
      <code title={visible(command)}>{visible(shown)}</code>
      <button type="button" className="small" onClick={copy} aria-label={`Copy command: ${visible(command)}`}>
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
  if (!sent) return null;
  if (!sent.done) return <p className="answer busy">Asked: {sent.verb} …</p>;
  const failed = sent.status !== 0;
  return (
    <div className={`answer ${failed ? "bad" : "good"}`} role="status">
      <p>{failed ? `✕ ${sent.verb}: no (${sent.status})` : `✓ ${sent.verb}: done`}</p>
      {sent.error && <p>{visible(sent.error)}</p>}
      {sent.lines.length > 0 && <pre tabIndex={0}>{sent.lines.map(visible).join("\n")}</pre>}
    </div>
  );
}

export function useLastOf(owner: string): Sent | undefined {
  return useData((state) => state.requests.findLast((sent) => sent.owner === owner));
}
