import { Act, Answer, useLastOf } from "../../parts/Act";
import type { Slot } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio } from "../../window/context";
import { bitIsSet, integerOf, noteValues, sorted, wrongNames, type Note, type NoteDraft } from "./note";
import { noteOwner, type ObjectRow } from "./reducer";

/** Names of values and bits; those that the value has now are marked. */
export function NoteTables({ row }: { row: ObjectRow }) {
  const { note } = row;
  if (!note) return null;
  const number = integerOf(row.value);
  const values = sorted(note.values);
  const bits = sorted(note.bits);
  return (
    <>
      {values.length > 0 && (
        <NameTable
          title="Values"
          names={values}
          marked={(each) => number !== null && String(number) === each}
          marks={["●", "is the value"]}
        />
      )}
      {bits.length > 0 && (
        <NameTable
          title="Bits"
          names={bits}
          marked={(each) => number !== null && bitIsSet(number, Number(each))}
          marks={["■", "is set"]}
        />
      )}
    </>
  );
}

interface TableProps {
  title: string;
  names: readonly (readonly [string, string])[];
  marked: (number: string) => boolean;
  marks: readonly [string, string];
}

function NameTable({ title, names, marked, marks: [mark, words] }: TableProps) {
  return (
    <table className="names" aria-label={title}>
      <tbody>
        {names.map(([number, name]) => {
          const on = marked(number);
          return (
            <tr key={number} className={on ? "on" : ""}>
              <td>{on ? <span title={words}>{mark}</span> : <span aria-hidden="true">·</span>}</td>
              <td className="number">
                {title === "Bits" && "bit "}
                {number}
              </td>
              <td>
                {visible(name)}
                {on && <span className="unseen"> {words}</span>}
              </td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}

/** One of the names that a value may have; its number becomes the new value. */
export function NamedValues({ note, draft, onPick }: { note: Note; draft: string; onPick: (value: string) => void }) {
  const values = sorted(note.values);
  if (!values.length) return null;
  return (
    <label className="line">
      By name
      <select value={draft in note.values ? draft : ""} onChange={(event) => onPick(event.target.value)}>
        <option value="">Select a name</option>
        {values.map(([number, name]) => (
          <option key={number} value={number}>
            {visible(name)} ({number})
          </option>
        ))}
      </select>
    </label>
  );
}

/** The note of an object in the file beside its description: read, then edited, then written. */
export function NoteEditor({ slot, object }: { slot: Slot; object: string }) {
  const { store } = useStudio();
  const owner = noteOwner(slotKey(slot), object);
  const held = useData((state) => state.dictionary.note);
  const last = useLastOf(owner);
  const target = { bus: slot.bus, node: slot.name, object };
  const draft = held?.of === owner ? held : null;
  const failed = last?.done && last.status !== 0;
  if (!draft) {
    return (
      <>
        <Act verb="note read" values={target} owner={owner} label="Edit note" />
        {failed && <Answer sent={last} />}
      </>
    );
  }
  const change = (to: Partial<NoteDraft>) => store.dispatch({ type: "dictionary/note", change: to });
  const values = noteValues(draft);
  const wrong = wrongNames(draft.values, false) || wrongNames(draft.bits, true);
  return (
    <fieldset className="note">
      <legend>Note</legend>
      <Field label="Text" value={draft.text} onChange={(text) => change({ text })} />
      <Field label="Unit" value={draft.unit} hint="°C" onChange={(unit) => change({ unit })} />
      <Field label="One count is" value={draft.scale} hint="1" onChange={(scale) => change({ scale })} />
      <Field label="Values" rows value={draft.values} hint="0 = off" onChange={(text) => change({ values: text })} />
      <Field label="Bits" rows value={draft.bits} hint="3 = fault" onChange={(text) => change({ bits: text })} />
      {wrong && <p className="bad-text">{visible(wrong)}</p>}
      {values && !wrong && (
        <Act verb="note write" values={{ ...target, ...values }} owner={owner} label="Write note" primary />
      )}
      {!values && draft.inFile && <Act verb="note remove" values={target} owner={owner} label="Remove note" />}
      {last?.verb !== "note read" && <Answer sent={last} />}
      {draft.file && <p className="hint">File: {visible(draft.file)}</p>}
    </fieldset>
  );
}

interface FieldProps {
  label: string;
  value: string;
  hint?: string;
  /** Several lines. */
  rows?: boolean;
  onChange: (text: string) => void;
}

function Field({ label, value, hint = "", rows = false, onChange }: FieldProps) {
  return (
    <label className="line">
      {label}
      {rows ? (
        <textarea
          aria-label={label}
          rows={Math.min(8, Math.max(2, value.split("\n").length + 1))}
          value={value}
          placeholder={hint}
          spellCheck={false}
          onChange={(event) => onChange(event.target.value)}
        />
      ) : (
        <input value={value} placeholder={hint} onChange={(event) => onChange(event.target.value)} />
      )}
    </label>
  );
}
