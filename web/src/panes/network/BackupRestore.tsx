import { useEffect, useRef, type ChangeEvent } from "react";
import { Act, Answer, Command, useLastOf } from "../../parts/Act";
import { download, fileName } from "../../parts/download";
import { packed, unpacked } from "../../parts/zlib";
import { commandLine } from "../../protocol/command";
import type { Slot } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import type { Sent } from "../../store/state";
import { barrier } from "../../store/barrier";
import { act, useData, useStudio, useView } from "../../window/context";
import { comparisonOf, MOST_DIGITS, savedOf, type ChosenDcf, type Comparison } from "./backup";

/** Devices' values as DCFs, a DCF beside a device, a DCF into a device. */
export function BackupRestore() {
  const [view] = useView();
  const [slot, count, chosen] = useData(
    (state) =>
      [
        state.data.slots.find((entry) => slotKey(entry) === view.slot),
        state.data.slots.length,
        state.network.chosen,
      ] as const,
  );
  return (
    <div className="form">
      <h2>Back up</h2>
      {slot && (
        <Act
          verb="backup save"
          values={{ bus: slot.bus, node: slot.name }}
          owner="backup:save"
          label={`Back up ${visible(slot.name)}`}
          primary
        />
      )}
      <Act verb="backup save" values={{ all: "1" }} owner="backup:save" label={`Back up all ${count} devices`} />
      <Saved />
      <h2>Compare and restore</h2>
      <ChooseDcf />
      {chosen && !slot && <p className="hint">Select the device in the tree.</p>}
      {chosen && slot && <Beside slot={slot} chosen={chosen} />}
    </div>
  );
}

/** Each DCF is given to the person once, when its answer comes. */
function Saved() {
  const last = useLastOf("backup:save");
  const given = useRef(last?.done ? last.id : "");
  useEffect(() => {
    if (!last?.done || given.current === last.id) return;
    given.current = last.id;
    void giveAll(last);
  }, [last]);
  if (!last?.done) return <Answer sent={last} />;
  const devices = savedOf(last.reply);
  if (!devices.length) return <Answer sent={last} />;
  const good = devices.filter((device) => !device.problem);
  return (
    <div className={`answer ${good.length === devices.length ? "good" : "bad"}`} role="status">
      <p>
        {good.length} of {devices.length} backed up
      </p>
      {devices.map((device) => (
        <p key={`${device.bus}/${device.node}`}>
          {visible(device.name)}:{" "}
          {device.problem
            ? visible(device.problem)
            : `${device.read} values${device.refused ? `, ${device.refused} refused` : ""}`}
        </p>
      ))}
    </div>
  );
}

async function giveAll(sent: Sent): Promise<void> {
  const now = new Date();
  const devices = savedOf(sent.reply).filter((device) => device.dcf);
  const several = new Set(devices.map((device) => device.bus)).size > 1;
  for (const device of devices) {
    const name = several ? `${device.bus} ${device.name}` : device.name;
    const text = await unpacked(device.dcf);
    download(fileName(name, "dcf", now), text as Uint8Array<ArrayBuffer>, "text/plain");
    // A browser takes no more than some downloads at once.
    await new Promise((resolve) => setTimeout(resolve, 150));
  }
}

function ChooseDcf() {
  const { store } = useStudio();
  const [chosen, problem] = useData((state) => [state.network.chosen, state.network.dcfProblem] as const);
  const choose = async (event: ChangeEvent<HTMLInputElement>) => {
    const file = event.target.files?.[0];
    if (!file) return;
    const dcf = await packed(file);
    const long = dcf.length > MOST_DIGITS;
    store.dispatch({
      type: "network/dcf",
      chosen: long ? null : { name: file.name, dcf },
      problem: long ? `${file.name} is too long for the page: use berth backup restore` : "",
    });
  };
  return (
    <>
      <label className="line">
        DCF
        <input type="file" accept=".dcf,.eds,.xdc,.xdd" onChange={(event) => void choose(event)} />
      </label>
      {problem && <p className="bad-text">{visible(problem)}</p>}
      {!chosen && !problem && <p className="hint">A DCF of this or of an equal device: it is compared, or restored.</p>}
    </>
  );
}

function Beside({ slot, chosen }: { slot: Slot; chosen: ChosenDcf }) {
  const studio = useStudio();
  const owner = `restore:${slotKey(slot)}`;
  const last = useLastOf(owner);
  const [verbs, file, why] = useData(
    (state) => [state.data.verbs, state.data.machine.file, barrier(state, "backup restore")] as const,
  );
  const values = { bus: slot.bus, node: slot.name, dcf: chosen.dcf };
  const shown = { bus: slot.bus, node: slot.name, file: chosen.name };
  const compare = () => act(studio, [{ verb: "backup compare", values, shown, owner }]);
  const restore = () =>
    studio.store.dispatch({
      type: "window",
      change: { confirming: [{ verb: "backup restore", values, shown, owner }] },
    });
  const offline = why === "Not connected.";
  return (
    <>
      <div className="act">
        <button type="button" disabled={offline} onClick={compare}>
          Compare with {visible(slot.name)}
        </button>
        <Command command={commandLine("backup compare", shown, verbs, file)} />
      </div>
      <div className="act">
        <button type="button" disabled={why !== null} title={why ?? ""} onClick={restore}>
          Restore into {visible(slot.name)}
        </button>
        <Command command={commandLine("backup restore", shown, verbs, file)} />
        {why && <p className="hint">{why}</p>}
      </div>
      <Outcome sent={last} slot={slot} />
    </>
  );
}

const words: Record<string, string> = {
  equal: "✓ the device is as the DCF has it",
  differs: "the device differs from the DCF",
  restored: "✓ restored and stored",
  "partly restored": "✕ restored, except what the device refused",
};

function Outcome({ sent, slot }: { sent: Sent | undefined; slot: Slot }) {
  const found = sent?.done ? comparisonOf(sent.reply) : null;
  if (!sent || !found || !words[found.result]) return <Answer sent={sent} />;
  const good = found.result === "equal" || found.result === "restored";
  return (
    <>
      <div className={`answer ${good ? "good" : "bad"}`} role="status">
        <p>
          {words[found.result]}: {found.compared} values compared
          {sent.verb === "backup restore" && `, ${found.written} written`}
        </p>
      </div>
      {found.differences.length + found.refused.length > 0 && <Table found={found} slot={slot} sent={sent} />}
    </>
  );
}

function Table({ found, slot, sent }: { found: Comparison; slot: Slot; sent: Sent }) {
  const [, setView] = useView();
  const link = (object: string) => (
    <button
      type="button"
      className="small number"
      onClick={() => setView({ pane: "dictionary", slot: slotKey(slot), object })}
    >
      {object}
    </button>
  );
  return (
    <table className="rows">
      <thead>
        <tr>
          <th>Object</th>
          <th>Name</th>
          <th>{sent.verb === "backup restore" ? "The device had" : "The device has"}</th>
          <th>The DCF</th>
        </tr>
      </thead>
      <tbody>
        {found.differences.map((entry) => (
          <tr key={entry.object}>
            <td>{link(entry.object)}</td>
            <td>{visible(entry.name)}</td>
            <td className="number">{visible(entry.has)}</td>
            <td className="number">{visible(entry.wants)}</td>
          </tr>
        ))}
        {found.refused.map((entry, i) => (
          <tr key={i}>
            <td>{link(entry.object)}</td>
            <td>{visible(entry.name)}</td>
            <td colSpan={2} className="bad-text">
              {visible(entry.why)}
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
