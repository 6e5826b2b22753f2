import { commandLine } from "../protocol/command";
import { visible } from "../protocol/text";
import type { Connection, Window } from "../store/state";
import { barrier } from "../store/barrier";
import { act, useData, useStudio } from "./context";

const themes: Record<Window["theme"], Window["theme"]> = { system: "light", light: "dark", dark: "system" };

function connectionWords(connection: Connection): string {
  switch (connection.phase) {
    case "open":
      return "";
    case "waiting":
      return `No connection. Next try in ${connection.seconds} s`;
    case "gap":
      return "A change was missed: reading everything again";
    default:
      return "Connecting …";
  }
}

export function TopBar() {
  const { store } = useStudio();
  const [machine, connection, window_, leftOut] = useData(
    (state) => [state.data.machine, state.connection, state.window, state.rates?.left_out ?? 0] as const,
  );
  const set = (change: Partial<Window>) => store.dispatch({ type: "window", change });
  const trouble = connectionWords(connection);
  return (
    <header className="top-bar">
      <button
        type="button"
        className="icon"
        aria-label="Tree of the machine"
        aria-pressed={window_.treeOpen}
        onClick={() => set({ treeOpen: !window_.treeOpen })}
      >
        ☰
      </button>
      <h1>
        berth <span aria-hidden="true">▸</span> <b>{visible(machine.name)}</b>
      </h1>
      {trouble && (
        <span className="trouble" role="alert">
          {trouble}
        </span>
      )}
      {leftOut > 0 && <span className="hint">slow connection: {leftOut} frames not sent here</span>}
      <span className="space" />
      <WorldPaused />
      <RoleMark />
      <Lock />
      <button type="button" className="find" onClick={() => set({ palette: true })}>
        <span>Find or do</span> <kbd className="by-key">Ctrl K</kbd>
      </button>
      <button
        type="button"
        className="icon"
        aria-label="Help"
        title="Help: ?"
        aria-haspopup="dialog"
        onClick={() => set({ help: true })}
      >
        ?
      </button>
      <button
        type="button"
        className="icon"
        onClick={() => set({ theme: themes[window_.theme] })}
        aria-label={`Colours: ${window_.theme}. Change`}
        title={`Colours: ${window_.theme}`}
      >
        {window_.theme === "system" ? "◐" : window_.theme === "light" ? "○" : "●"}
      </button>
      <button
        type="button"
        className="icon"
        aria-label="Inspector"
        aria-pressed={window_.inspectorOpen}
        onClick={() => set({ inspectorOpen: !window_.inspectorOpen })}
      >
        ▤
      </button>
    </header>
  );
}

/** Who may everything is not told so. */
function RoleMark() {
  const [role, open] = useData((state) => [state.data.role, state.connection.phase === "open"] as const);
  if (!open || role === "configure") return null;
  return (
    <span
      className="lock"
      title="The address that you opened has this role. The person who started Studio has the addresses of the other roles."
    >
      role: {role}
    </span>
  );
}

/** While time stands nothing answers, whatever pane one looks at. */
function WorldPaused() {
  const studio = useStudio();
  const [paused, why, command] = useData((state) => {
    const { world, verbs, machine } = state.data;
    return [
      world?.paused ?? false,
      barrier(state, "world run"),
      commandLine("world run", {}, verbs, machine.file),
    ] as const;
  });
  if (!paused) return null;
  return (
    <span className="lock" role="status">
      <span className="lock-open">▮▮ the world is paused</span>
      <button
        type="button"
        disabled={why !== null}
        title={why ?? command}
        onClick={() => act(studio, [{ verb: "world run", values: {}, owner: "world" }])}
      >
        Run the world
      </button>
    </span>
  );
}

function Lock() {
  const { socket } = useStudio();
  const [lock, simulated, time, role] = useData(
    (state) => [state.data.lock, state.data.machine.simulated, state.data.time, state.data.role] as const,
  );
  if (!lock.real) return simulated ? <span className="lock">simulated</span> : null;
  if (lock.unlocked_until_s === null) {
    return (
      <span className="lock">
        <span className="lock-shut">■ real buses: read-only</span>
        {role !== "view" && (
          <button type="button" onClick={() => socket.send({ type: "unlock", minutes: 10 })}>
            Unlock for 10 min
          </button>
        )}
      </span>
    );
  }
  const left = Math.max(0, Math.ceil((lock.unlocked_until_s - time) / 60));
  return (
    <span className="lock">
      <span className="lock-open">▲ real buses: unlocked, {left} min</span>
      {role !== "view" && (
        <button type="button" onClick={() => socket.send({ type: "lock" })}>
          Lock
        </button>
      )}
    </span>
  );
}
