/** P does the same (window/keys.ts). */
export function Pause({ paused, onChange }: { paused: boolean; onChange: (paused: boolean) => void }) {
  return (
    <button type="button" aria-pressed={paused} title="P" onClick={() => onChange(!paused)}>
      {paused ? "▶ Go on" : "▮▮ Pause"}
    </button>
  );
}

export function Check({ on, words, onChange }: { on: boolean; words: string; onChange: (on: boolean) => void }) {
  return (
    <label>
      <input type="checkbox" checked={on} onChange={(event) => onChange(event.target.checked)} />
      {words}
    </label>
  );
}
