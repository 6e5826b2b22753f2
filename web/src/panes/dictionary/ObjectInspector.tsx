import { Act, Answer, useLastOf } from "../../parts/Act";
import type { Slot } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio } from "../../window/context";

export function ObjectInspector({ slot, object }: { slot: Slot; object: string }) {
  const { store } = useStudio();
  const key = slotKey(slot);
  const owner = `dictionary:${key}`;
  const [row, draft] = useData(
    (state) => [state.dictionary.objects[key]?.find((entry) => entry.key === object), state.dictionary.draft] as const,
  );
  const last = useLastOf(owner);
  const target = { bus: slot.bus, node: slot.name, object };
  const number = /^-?\d+$/.test(row?.value ?? "") ? Number(row?.value) : null;
  return (
    <section>
      <h2>
        {object} {visible(row?.name ?? "")}
      </h2>
      {row && (
        <dl>
          <div>
            <dt>Value</dt>
            <dd className="number">
              {visible(row.value)}
              {number !== null && number >= 0 && ` = ${number.toString(16).toUpperCase()}h`}
            </dd>
          </div>
          <div>
            <dt>Type</dt>
            <dd>{row.type}</dd>
          </div>
          <div>
            <dt>Bytes</dt>
            <dd className="number data">{row.bytes.replace(/(..)(?=.)/g, "$1 ")}</dd>
          </div>
          {row.abort && (
            <div>
              <dt>Abort</dt>
              <dd className="bad-text">{visible(row.abort)}</dd>
            </div>
          )}
        </dl>
      )}
      <Act verb="sdo read" values={target} owner={owner} label="Read" />
      <label className="line">
        New value
        <input
          value={draft}
          placeholder={row?.value ?? ""}
          onChange={(event) => store.dispatch({ type: "dictionary/draft", draft: event.target.value })}
        />
      </label>
      {draft !== "" && (
        <Act verb="sdo write" values={{ ...target, value: draft }} owner={owner} label="Write" primary />
      )}
      {last?.verb !== "sdo dump" && <Answer sent={last} />}
    </section>
  );
}
