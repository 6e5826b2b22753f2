import { Act, Answer, Command, useLastOf } from "../../parts/Act";
import { StateMark } from "../../parts/StateMark";
import type { Slot } from "../../protocol/messages";
import { addressWords, visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio, useView } from "../../window/context";
import { plugAct } from "../world/acts";
import { wordOf } from "../world/cable";
import type { FoundDevice } from "./reducer";
import { alsoLine, deviceKey, isGone, placesOf, questionAbout, straysOf, whyWords } from "./strays";

/** A device that has no slot: what it is, what Berth says of it, what to do. */
export function DeviceInspector({ of }: { of: string }) {
  const [device, slots] = useData(
    (state) => [state.machine.found.find((each) => deviceKey(each) === of), state.data.slots] as const,
  );
  const gone = useData((state) => device !== undefined && isGone(device, state.world));
  const [, setView] = useView();
  if (!device) return <p className="hint">Nothing is known of the device {visible(of)}.</p>;
  const seat = slots.find((slot) => slotKey(slot) === device.slot);
  const { type, serial } = addressWords(device.address);
  return (
    <section>
      <h2>
        {type}, serial number {serial}
      </h2>
      {seat ? (
        <button type="button" onClick={() => setView({ slot: slotKey(seat) })}>
          It has the slot {visible(seat.name)}
        </button>
      ) : gone ? (
        <p>It is not on the bus any more.</p>
      ) : (
        <Stray device={device} />
      )}
      <Facts device={device} />
    </section>
  );
}

function Stray({ device }: { device: FoundDevice }) {
  const { store } = useStudio();
  const [slots, questions, devices, asks] = useData(
    (state) => [state.data.slots, state.data.questions, state.world.devices, straysOf(state).includes(device)] as const,
  );
  const key = deviceKey(device);
  const owner = `device:${key}`;
  const last = useLastOf(owner);
  const question = questionAbout(device, questions);
  const plugged = devices.find((each) => each.bus === device.bus && each.address === device.address);
  const plug = plugged && plugAct(wordOf(plugged, slots), plugged.plugged);
  const asked = slots.filter((slot) => slot.bus === device.bus && question?.slots?.includes(slot.name));
  return (
    <>
      <p className="tone-question">
        <StateMark state="question" /> without a slot
        {asks ? `: ${whyWords(device)}` : ", Berth is looking for its place"}
      </p>
      {(device.says || question) && (
        <div className="need-box need-question">
          <p>{visible((question ?? device.says)?.text ?? "")}</p>
          {asked.map((slot) => (
            <Take key={slot.id} device={device} slot={slot} label={`This one is ${visible(slot.name)}`} />
          ))}
          {device.says && !question && <WhatToDo device={device} />}
        </div>
      )}
      <Act
        verb="locate"
        values={{ bus: device.bus, target: device.address }}
        owner={owner}
        label="Locate: let it flicker"
      />
      {plug && <Act verb={plug.verb} values={plug.values} owner={owner} label={plug.label} />}
      <Answer sent={last} />
      {!plugged && (
        <>
          <button type="button" onClick={() => store.dispatch({ type: "machine/hide", key })}>
            It is off the bus: hide it
          </button>
          <p className="hint">Berth does not watch a device without a slot. It is shown again when Berth reports it.</p>
        </>
      )}
    </>
  );
}

function WhatToDo({ device }: { device: FoundDevice }) {
  const slots = useData((state) => state.data.slots);
  switch (device.says?.kind) {
    case "surplus":
    case "misplaced":
    case "returned":
      return (
        <>
          <p>To replace a broken device with it: unplug the broken one, then press.</p>
          {placesOf(device, slots).map((slot) => (
            <Take key={slot.id} device={device} slot={slot} label={`Take it for ${visible(slot.name)}`} />
          ))}
        </>
      );
    case "foreign":
    case "wrong revision": {
      const free = slots.filter((slot) => slot.bus === device.bus && slot.r_sn === null);
      return (
        <>
          <p>
            Is it the successor of a slot&apos;s type? Write this into that slot of the machine file, and start Berth
            again.
            {free.length > 0 && ` Slots without a device: ${free.map((slot) => visible(slot.name)).join(", ")}.`}
          </p>
          <Command command={alsoLine(device.address)} what="line" />
        </>
      );
    }
    default:
      return null;
  }
}

/** The slot's replacement is followed from then on. */
function Take({ device, slot, label }: { device: FoundDevice; slot: Slot; label: string }) {
  const { store } = useStudio();
  const [, setView] = useView();
  const key = slotKey(slot);
  const follow = () => {
    store.dispatch({ type: "slots/replacing", replacing: { slot: key, atS: store.get().data.time } });
    setView({ slot: key });
  };
  const values = { bus: slot.bus, slot: slot.name, device: device.address };
  return <Act verb="replace" values={values} owner={`slots:${key}`} label={label} primary then={follow} />;
}

function Facts({ device }: { device: FoundDevice }) {
  const { type, revision, serial } = addressWords(device.address);
  const plant = useData((state) =>
    state.world.devices.find((each) => each.bus === device.bus && each.address === device.address),
  );
  const facts: [string, string][] = [
    ["Bus", visible(device.bus)],
    ["Vendor / product", type],
    ["Revision", revision],
    ["Serial number", serial],
    ["LSS address", device.address],
    ["Heard of", `${device.toldS.toFixed(3)} s`],
    ["In the plant", plant ? visible(plant.name) : ""],
  ];
  return (
    <dl>
      {facts
        .filter(([, value]) => value)
        .map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
    </dl>
  );
}
