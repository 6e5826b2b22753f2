import { useEffect, useRef, useState } from "react";
import { StateShape } from "../../parts/StateMark";
import type { Bus, Slot } from "../../protocol/messages";
import { count, serialWords, visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useView } from "../../window/context";
import { Discovery } from "./Discovery";
import { BOX, busLayout, poolPlace, type BusLayout, type Place } from "./layout";
import { LoadPlot } from "./LoadPlot";
import type { FoundDevice } from "./reducer";

export function Machine() {
  const box = useRef<HTMLDivElement>(null);
  const [width, setWidth] = useState(800);
  useEffect(() => {
    if (!box.current) return;
    const observer = new ResizeObserver(([entry]) => entry && setWidth(Math.floor(entry.contentRect.width)));
    observer.observe(box.current);
    return () => observer.disconnect();
  }, []);
  return (
    <div className="scroll machine" tabIndex={0} role="region" aria-label="Drawing of the machine">
      <div ref={box}>
        <Drawing width={Math.max(300, width)} />
      </div>
      <LoadPlot width={Math.max(300, width)} />
      <Discovery />
    </div>
  );
}

function Drawing({ width }: { width: number }) {
  const [buses, slots, found] = useData((state) => [state.data.buses, state.data.slots, state.machine.found] as const);
  let top = 4;
  const parts = buses.map((bus) => {
    const mine = slots.filter((slot) => slot.bus === bus.name);
    const devices = found.filter((device) => device.bus === bus.name);
    const unnamed = devices.filter((device) => !device.slot).length;
    const layout = busLayout(mine.length, unnamed, width, top);
    top += layout.height + 8;
    return { bus, mine, devices, layout };
  });
  return (
    <svg className="drawing" width={width} height={top} role="group" aria-label="Buses and slots">
      {parts.map(({ bus, mine, devices, layout }) => (
        <g key={bus.name}>
          <BusLine bus={bus} slots={mine} layout={layout} width={width} />
          {mine.map((slot, i) => (
            <SlotBox
              key={slotKey(slot)}
              slot={slot}
              place={layout.places[i]}
              width={layout.boxWidth}
              above={i % 2 === 0}
            />
          ))}
          <Devices devices={devices} slots={mine} layout={layout} width={width} />
        </g>
      ))}
    </svg>
  );
}

function BusLine({ bus, slots, layout, width }: { bus: Bus; slots: Slot[]; layout: BusLayout; width: number }) {
  const rate = useData((state) => state.rates?.buses.find((entry) => entry.bus === bus.name));
  const beneath = bus.beneath ? `, beneath ${bus.beneath.bus}/${bus.beneath.slot}` : "";
  const load = rate ? `${count(rate.frames_per_s)} frames/s, load ${(rate.load * 100).toFixed(0)} %` : "";
  const running = slots.filter((slot) => slot.state === "operational").length;
  return (
    <>
      <text className="bus-name" x="14" y={layout.top + 14}>
        {visible(bus.name)}
        <tspan className="quiet" dx="10">
          {count(bus.bit_rate / 1000)} kbit/s{visible(beneath)} · {running} of {slots.length} operational · {load}
        </tspan>
      </text>
      {layout.lines.map((y, i) => (
        <g key={y}>
          <line className={`bus-line ${rate?.load ? "alive" : ""}`} x1="6" x2={width - 8} y1={y} y2={y} />
          {i > 0 && <path className="bus-fold" d={`M${width - 8} ${layout.lines[i - 1] ?? y}h5V${y}h-5`} />}
        </g>
      ))}
    </>
  );
}

interface SlotBoxProps {
  slot: Slot;
  place: Place | undefined;
  width: number;
  above: boolean;
}

function SlotBox({ slot, place, width, above }: SlotBoxProps) {
  const [view, setView] = useView();
  if (!place) return null;
  const key = slotKey(slot);
  const dim = view.slot !== "" && view.slot !== key;
  const select = () => setView({ slot: key === view.slot ? "" : key });
  return (
    <g
      className={`slot-box ${key === view.slot ? "selected" : ""} ${dim ? "dim" : ""}`}
      transform={`translate(${place.x} ${place.y})`}
      role="button"
      tabIndex={0}
      aria-pressed={key === view.slot}
      aria-label={`${visible(slot.name)}, node-ID ${slot.id}, ${slot.state}`}
      onClick={select}
      onKeyDown={(event) => (event.key === "Enter" || event.key === " ") && select()}
    >
      <title>{`${visible(slot.name)}: ${slot.state}${slot.reason ? `, ${visible(slot.reason)}` : ""}`}</title>
      <path className="stub" d={`M${Math.round(width / 2)} ${above ? BOX.height : 0}v${above ? 12 : -12}`} />
      <rect className="frame-box" width={width} height={BOX.height} rx="2" />
      <foreignObject x="6" y="2" width={width - 10} height="18">
        <div className="box-name">{visible(slot.name)}</div>
      </foreignObject>
      <text className="box-id" x="6" y="31">
        {slot.id}
      </text>
      <text className="box-state" x="30" y="31">
        {shortState[slot.state] ?? slot.state}
      </text>
      <g key={slot.state} className="changed" transform={`translate(${width - 19} 20)`}>
        <StateShape state={slot.state} />
      </g>
    </g>
  );
}

const shortState: Record<string, string> = {
  operational: "oper.",
  configuring: "config.",
  "power cycle needed": "power",
  "wrong type": "wrong",
};

interface DevicesProps {
  devices: FoundDevice[];
  slots: Slot[];
  layout: BusLayout;
  width: number;
}

/** Devices that were found stand beside the bus without a name, and slide into their slots when they are bound. */
function Devices({ devices, slots, layout, width }: DevicesProps) {
  let unnamed = 0;
  const places = devices.map((device) => {
    const at = slots.findIndex((slot) => slotKey(slot) === device.slot);
    const place = at >= 0 ? layout.places[at] : undefined;
    return { device, bound: place !== undefined, place: place ?? poolPlace(layout.pool, unnamed++, width) };
  });
  return (
    <>
      {unnamed > 0 && (
        <text className="quiet" x="14" y={layout.pool.y - 6}>
          {unnamed} found, without a slot yet
        </text>
      )}
      {places.map(({ device, bound, place }) => (
        <g
          key={device.address}
          className={`device ${bound ? "bound" : ""}`}
          style={{ transform: `translate(${place.x}px, ${place.y}px)` }}
        >
          <title>{`serial number ${serialWords(`0x${device.address.replace(/-/g, "").slice(16)}`).serial}`}</title>
          <rect width="14" height="14" rx="2" />
        </g>
      ))}
    </>
  );
}
