import type { KeyboardEvent } from "react";
import { StateMark } from "../parts/StateMark";
import { deviceKey, deviceName, straysOf, whyWords } from "../panes/machine/strays";
import { addressWords, count, visible } from "../protocol/text";
import type { Slot } from "../protocol/messages";
import { isHeard } from "../store/beneath";
import { slotKey } from "../store/keys";
import { useData, useView } from "./context";

export function Tree() {
  const [buses, slots, rates] = useData((state) => [state.data.buses, state.data.slots, state.rates] as const);
  return (
    <nav className="tree" aria-label="Machine">
      {buses.map((bus) => {
        const rate = rates?.buses.find((entry) => entry.bus === bus.name);
        const below = bus.beneath ? `beneath ${bus.beneath.bus}/${bus.beneath.slot}` : "";
        const rated = `${count(bus.bit_rate / 1000)} kbit/s`;
        return (
          <section key={bus.name} className={bus.beneath ? "beneath" : ""}>
            <h2 title={`${rated}, ${bus.port}, ${bus.role}${below && `, ${below}`}`}>
              {visible(bus.name)}
              {isHeard(bus) && <span className="quiet">{rated}</span>}
              {rate && (
                <span className="quiet load">{isHeard(bus) ? `${(rate.load * 100).toFixed(0)} %` : "not heard"}</span>
              )}
            </h2>
            <SlotList slots={slots.filter((slot) => slot.bus === bus.name)} />
            <StrayList bus={bus.name} />
          </section>
        );
      })}
    </nav>
  );
}

function moveFocus(event: KeyboardEvent<HTMLElement>) {
  const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
  if (!step) return;
  event.preventDefault();
  const buttons = [...document.querySelectorAll<HTMLButtonElement>(".tree li button")];
  const at = buttons.indexOf(document.activeElement as HTMLButtonElement);
  buttons[Math.max(0, Math.min(buttons.length - 1, at + step))]?.focus();
}

/** Devices on the bus that no slot has. */
function StrayList({ bus }: { bus: string }) {
  const [view, setView] = useView();
  const strays = useData(straysOf).filter((device) => device.bus === bus);
  if (!strays.length) return null;
  return (
    <>
      <h3 className="quiet">Without a slot</h3>
      <ul onKeyDown={moveFocus}>
        {strays.map((device) => {
          const key = deviceKey(device);
          const { type, serial } = addressWords(device.address);
          return (
            <li key={key}>
              <button
                type="button"
                aria-pressed={key === view.device}
                aria-label={`${deviceName(device)}, without a slot: ${whyWords(device)}`}
                title={whyWords(device)}
                onClick={() => setView({ device: key === view.device ? "" : key })}
              >
                <span className="node-id">–</span>
                <span className="stray-name">
                  {type}, <span className="quiet">serial</span> {serial}
                </span>
                <StateMark state="question" />
              </button>
            </li>
          );
        })}
      </ul>
    </>
  );
}

function SlotList({ slots }: { slots: Slot[] }) {
  const [view, setView] = useView();
  return (
    <ul onKeyDown={moveFocus}>
      {slots.map((slot) => {
        const key = slotKey(slot);
        return (
          <li key={key}>
            <button
              type="button"
              aria-pressed={key === view.slot}
              title={slot.state}
              onClick={() => setView({ slot: key === view.slot ? "" : key })}
            >
              <span className="node-id">{slot.id}</span>
              <span className="name">{visible(slot.name)}</span>
              <StateMark state={slot.state} />
              <span className="unseen">{slot.state}</span>
            </button>
          </li>
        );
      })}
    </ul>
  );
}
