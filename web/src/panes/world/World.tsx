import { Act, Answer, useLastOf } from "../../parts/Act";
import { StateWord } from "../../parts/StateMark";
import type { Slot } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { act, useData, useStudio, useView } from "../../window/context";
import { cutAct, damageAct, deviceActs, mendAct, timeActs, type WorldAct } from "./acts";
import { behind, cutBefore, hangs, nodesOf, wordOf, type CableNode } from "./cable";
import { framesOf, type PlantDevice } from "./reducer";

const Press = ({ act: { label, verb, values } }: { act: WorldAct }) => (
  <Act verb={verb} values={values} owner="world" label={visible(label)} />
);

/** The device that is chosen: that of the selected slot, or one that has no slot. */
function useChosen(): { slot: Slot | undefined; device: PlantDevice | null } {
  const [view] = useView();
  const [slots, world] = useData((state) => [state.data.slots, state.world] as const);
  if (view.device) {
    const there = world.devices.find((entry) => `${entry.bus}/${entry.address}` === view.device);
    return { slot: undefined, device: there ?? null };
  }
  const slot = world.device ? undefined : slots.find((entry) => slotKey(entry) === view.slot);
  const found = slot
    ? world.devices.find((entry) => entry.bus === slot.bus && entry.slot === slot.name)
    : world.devices.find((entry) => entry.name === world.device);
  return { slot, device: found ?? null };
}

export function World() {
  const [time, world] = useData((state) => [state.data.time, state.data.world] as const);
  const last = useLastOf("world");
  return (
    <div className="columns">
      <div className="scroll" tabIndex={0} role="region" aria-label="World">
        <div className="form">
          <h2>Time</h2>
          <p className="number">
            t = {time.toFixed(3)} s{world && `, ${world.paused ? "paused" : "running"}, × ${world.speed}`}
          </p>
          <div className="act-grid">
            {timeActs.map((entry) => (
              <Press key={entry.label} act={entry} />
            ))}
          </div>
          <DeviceActs />
          <Buses />
          <Answer sent={last} />
        </div>
      </div>
      <Devices />
    </div>
  );
}

function conditionOf(device: PlantDevice): string {
  if (!device.plugged) return "not plugged in";
  const words = [device.powered ? "has power" : "without power"];
  if (device.deaf) words.push("deaf");
  if (device.late > 0) words.push(`slow by ${(device.late * 1000).toFixed(0)} ms`);
  return words.join(", ");
}

function DeviceActs() {
  const { slot, device } = useChosen();
  const [slots, frames, damages] = useData(
    (state) => [state.data.slots, state.world.frames, state.data.verbs.some((v) => v.name === "world damage")] as const,
  );
  if (!slot && !device)
    return (
      <>
        <h2>Device</h2>
        <p className="hint">Select a device: it can be unplugged, switched off, cut off, made slow or deaf.</p>
      </>
    );
  const word = device ? wordOf(device, slots) : (slot?.name ?? "");
  const many = framesOf(frames);
  return (
    <>
      <h2>{visible(slot?.name ?? word)}</h2>
      <p>
        {slot && <StateWord state={slot.state} />} {device && visible(`${device.name}: ${conditionOf(device)}`)}
      </p>
      <div className="act-grid">
        {deviceActs(word, device).map((entry) => (
          <Press key={entry.label} act={entry} />
        ))}
        {device?.plugged && <Press act={cutAct("Cut its wire", device.bus, [word])} />}
        {damages && many && device?.powered && <Press act={damageAct(device.bus, many, word)} />}
      </div>
    </>
  );
}

function Buses() {
  const { store } = useStudio();
  const [buses, frames, damages] = useData(
    (state) => [state.data.buses, state.world.frames, state.data.verbs.some((v) => v.name === "world damage")] as const,
  );
  const many = framesOf(frames);
  return (
    <>
      {damages && (
        <label className="line">
          Frames that a press damages
          <input
            type="number"
            min={1}
            max={10_000}
            value={frames}
            onChange={(event) => store.dispatch({ type: "world", change: { frames: event.target.value } })}
          />
        </label>
      )}
      {buses.map((bus) => (
        <section className="form-part" key={bus.name} aria-label={`Bus ${visible(bus.name)}`}>
          <h2>{visible(bus.name)}</h2>
          {damages && many && <Press act={damageAct(bus.name, many)} />}
          <CableOf bus={bus.name} />
        </section>
      ))}
    </>
  );
}

/** Berth and the devices in a row; between two of them the cable, which a press cuts. */
function CableOf({ bus }: { bus: string }) {
  const studio = useStudio();
  const [slots, world] = useData((state) => [state.data.slots, state.world] as const);
  const nodes = nodesOf(
    world.cables.find((cable) => cable.bus === bus),
    world.devices,
    slots,
  );
  if (nodes.length < 2) return null;
  const whole = nodes.every((node) => node.piece === nodes[0]?.piece);
  const cut = (i: number) => {
    const { verb, values } = cutAct("", bus, behind(nodes, i));
    act(studio, [{ verb, values, owner: "world" }]);
  };
  return (
    <>
      <div className="cable" role="group" aria-label={`Cable of ${visible(bus)}`}>
        {nodes.map((node, i) => (
          <Piece key={node.word} nodes={nodes} node={node} i={i} cut={() => cut(i)} />
        ))}
      </div>
      {!whole && <Press act={mendAct(bus)} />}
    </>
  );
}

interface PieceProps {
  nodes: readonly CableNode[];
  node: CableNode;
  i: number;
  cut: () => void;
}

function Piece({ nodes, node, i, cut }: PieceProps) {
  const name = visible(node.device ? node.device.slot || node.device.name : "Berth");
  const isCut = cutBefore(nodes, i);
  const off = node.piece !== nodes[0]?.piece;
  return (
    <>
      {i > 0 && (
        <button
          type="button"
          className={`wire ${isCut ? "cut" : ""}`}
          disabled={isCut || !behind(nodes, i).length}
          title={isCut ? "The cable is cut here." : `Cut the cable before ${name}`}
          aria-label={isCut ? `Cut before ${name}` : `Cut the cable before ${name}`}
          onClick={cut}
        />
      )}
      <span className={`plug ${off ? "off" : ""} ${hangs(nodes, i) ? "hangs" : ""}`}>
        {name}
        {hangs(nodes, i) && <span className="quiet"> (its wire is cut)</span>}
      </span>
    </>
  );
}

function Devices() {
  const { store } = useStudio();
  const [view, setView] = useView();
  const [slots, world] = useData((state) => [state.data.slots, state.world] as const);
  const spare = world.devices.filter((device) => !device.slot);
  const choose = (change: { slot: string; device: string }) => {
    setView({ slot: change.slot });
    store.dispatch({ type: "world", change: { device: change.device } });
  };
  return (
    <nav className="tools at-right" aria-label="Devices">
      <h3>Devices</h3>
      {slots.map((entry) => {
        const key = slotKey(entry);
        const chosen = key === view.slot && !world.device;
        return (
          <button key={key} type="button" aria-pressed={chosen} onClick={() => choose({ slot: key, device: "" })}>
            <StateWord state={entry.state} /> {visible(entry.name)}
          </button>
        );
      })}
      {spare.length > 0 && <h3>Without a slot</h3>}
      {spare.map(({ name }) => (
        <button
          key={name}
          type="button"
          aria-pressed={name === world.device}
          onClick={() => choose({ slot: "", device: name })}
        >
          {visible(name)}
        </button>
      ))}
    </nav>
  );
}
