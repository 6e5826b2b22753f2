import { Act, Answer, useLastOf } from "../../parts/Act";
import { StateWord } from "../../parts/StateMark";
import { visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useView } from "../../window/context";
import { busAct, deviceActs, timeActs } from "./acts";

export function World() {
  const [view, setView] = useView();
  const [slots, buses, time, world] = useData(
    (state) => [state.data.slots, state.data.buses, state.data.time, state.data.world] as const,
  );
  const damages = useData((state) => state.data.verbs.some((entry) => entry.name === busAct("").verb));
  const slot = slots.find((entry) => slotKey(entry) === view.slot);
  const last = useLastOf("world");
  return (
    <div className="columns">
      <div className="scroll" tabIndex={0} role="region" aria-label="World">
        <div className="form">
          <h2>Time</h2>
          <p className="number">
            t = {time.toFixed(3)} s{world && `, ${world.paused ? "paused" : "running"}, × ${world.speed}`}
          </p>
          <div className="row">
            {timeActs.map((entry) => (
              <Act key={entry.label} verb={entry.verb} values={entry.values} owner="world" label={entry.label} />
            ))}
          </div>
          <h2>{slot ? visible(slot.name) : "Device"}</h2>
          {slot ? (
            <>
              <StateWord state={slot.state} />
              {deviceActs(slot.name).map((entry) => (
                <Act key={entry.label} verb={entry.verb} values={entry.values} owner="world" label={entry.label} />
              ))}
            </>
          ) : (
            <p className="hint">Select a device: it can be unplugged, switched off, made slow or deaf.</p>
          )}
          {damages && <h2>{buses.length > 1 ? "Buses" : "Bus"}</h2>}
          {buses.map((bus) => {
            const { label, verb, values } = busAct(bus.name);
            return <Act key={bus.name} verb={verb} values={values} owner="world" label={visible(label)} />;
          })}
          <Answer sent={last} />
        </div>
      </div>
      <nav className="tools at-right" aria-label="Devices">
        <h3>Devices</h3>
        {slots.map((entry) => {
          const key = slotKey(entry);
          return (
            <button key={key} type="button" aria-pressed={key === view.slot} onClick={() => setView({ slot: key })}>
              <StateWord state={entry.state} /> {visible(entry.name)}
            </button>
          );
        })}
      </nav>
    </div>
  );
}
