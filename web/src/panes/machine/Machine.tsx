import { useEffect, useRef, useState, type KeyboardEvent } from "react";
import { errorTitle, healthWords, isUnwell, restWords } from "../../parts/health";
import { StateShape } from "../../parts/StateMark";
import type { Bus, Slot } from "../../protocol/messages";
import { addressWords, count, visible } from "../../protocol/text";
import { isHeard } from "../../store/beneath";
import { slotKey } from "../../store/keys";
import { useData, useView } from "../../window/context";
import { useErrorFrames } from "../trace/listed";
import { Discovery } from "./Discovery";
import { BOX, busLayout, poolBoxPlace, poolPlace, type BusLayout, type Place } from "./layout";
import { LoadPlot } from "./LoadPlot";
import type { FoundDevice } from "./reducer";
import { deviceKey, deviceName, straysOf, whyWords, withoutSlot } from "./strays";
import { WireAnswer, Wires } from "./Wires";

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
      <WireAnswer />
      <LoadPlot width={Math.max(300, width)} />
      <Discovery />
    </div>
  );
}

function Drawing({ width }: { width: number }) {
  const [buses, slots, found] = useData((state) => [state.data.buses, state.data.slots, state.machine.found] as const);
  const without = useData(withoutSlot);
  const strays = useData(straysOf);
  let top = 4;
  const parts = buses.map((bus) => {
    const mine = slots.filter((slot) => slot.bus === bus.name);
    const boxes = strays.filter((device) => device.bus === bus.name);
    // A device keeps its square while it slides into its slot.
    const devices = found.filter(
      (device) =>
        device.bus === bus.name && !boxes.includes(device) && (device.slot !== "" || without.includes(device)),
    );
    const squares = devices.filter((device) => !device.slot).length;
    const layout = busLayout(mine.length, { boxes: boxes.length, squares }, width, top);
    top += layout.height + 8;
    return { bus, mine, boxes, devices, layout };
  });
  return (
    <svg className="drawing" width={width} height={top} role="group" aria-label="Buses and slots">
      {parts.map(({ bus, mine, boxes, devices, layout }) => (
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
          <Wires bus={bus.name} slots={mine} layout={layout} />
          <PoolTitle boxes={boxes.length} all={boxes.length + devices.filter(({ slot }) => !slot).length} at={layout} />
          <Devices devices={devices} slots={mine} layout={layout} width={width} />
          {boxes.map((device, i) => (
            <StrayBox key={device.address} device={device} place={poolBoxPlace(layout, i)} width={layout.boxWidth} />
          ))}
        </g>
      ))}
    </svg>
  );
}

function BusLine({ bus, slots, layout, width }: { bus: Bus; slots: Slot[]; layout: BusLayout; width: number }) {
  const rate = useData((state) => state.rates?.buses.find((entry) => entry.bus === bus.name));
  const beneath = bus.beneath ? `, beneath ${bus.beneath.bus}/${bus.beneath.slot}` : "";
  const figures = rate ? `${count(rate.frames_per_s)} frames/s, load ${(rate.load * 100).toFixed(0)} %` : "";
  const load = isHeard(bus) ? figures : "not heard";
  const showErrors = useErrorFrames();
  const rests = restWords(slots);
  const running = slots.filter((slot) => slot.state === "operational").length;
  return (
    <>
      <text className="bus-name" x="14" y={layout.top + 14}>
        {visible(bus.name)}
        <tspan className="quiet" dx="10">
          {count(bus.bit_rate / 1000)} kbit/s{visible(beneath)} · {running} of {slots.length} operational
        </tspan>
        {rate && (rate.errors || isUnwell(rate)) && (
          <tspan className={isUnwell(rate) ? "unwell" : "quiet"} dx="6">
            ·{" "}
            {rate.errors ? (
              <tspan className="errors" {...pressed(errorTitle(rate), () => showErrors(rate.bus))}>
                {healthWords(rate)}
              </tspan>
            ) : (
              healthWords(rate)
            )}
          </tspan>
        )}
        {rests && (
          <tspan className="unwell" dx="6">
            · {visible(rests)}
            <title>{visible(rests)}</title>
          </tspan>
        )}
        {load && !rests && (
          <tspan className="quiet" dx="6">
            · {load}
            {!isHeard(bus) && <title>Berth has no port here: it reaches the nodes by SDO through their gateway.</title>}
          </tspan>
        )}
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

/** A part of the drawing that is a button. */
const pressed = (name: string, press: () => void) => ({
  role: "button",
  tabIndex: 0,
  "aria-label": name,
  onClick: press,
  onKeyDown: (event: KeyboardEvent) => (event.key === "Enter" || event.key === " ") && press(),
});

/** From the box to the line. Where Berth knows no device, the line's end of it is open. */
function stubPath(x: number, above: boolean, open: boolean): string {
  if (!open) return `M${x} ${above ? BOX.height : 0}v${above ? 12 : -12}`;
  const line = above ? BOX.height + 12 : -12;
  const down = above ? -1 : 1;
  return `M${x} ${line}v${3 * down}m-2.5 ${2.5 * down}a2.5 2.5 0 1 0 5 0a2.5 2.5 0 1 0 -5 0`;
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
  const vacant = slot.r_sn === null;
  return (
    <g
      className={`slot-box ${key === view.slot ? "selected" : ""} ${dim ? "dim" : ""} ${vacant ? "vacant" : ""}`}
      transform={`translate(${place.x} ${place.y})`}
      aria-pressed={key === view.slot}
      {...pressed(`${visible(slot.name)}, node-ID ${slot.id}, ${slot.state}`, select)}
    >
      <title>{`${visible(slot.name)}: ${slot.state}${slot.reason ? `, ${visible(slot.reason)}` : ""}`}</title>
      <path className={vacant ? "stub open" : "stub"} d={stubPath(Math.round(width / 2), above, vacant)} />
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

function PoolTitle({ boxes, all, at }: { boxes: number; all: number; at: BusLayout }) {
  if (!all) return null;
  return (
    <text className="quiet" x="14" y={at.pool.y - 6}>
      {all} found, without a slot{boxes < all && " yet"}
    </text>
  );
}

/** A device of which Berth has said why it has no slot. */
function StrayBox({ device, place, width }: { device: FoundDevice; place: Place; width: number }) {
  const [view, setView] = useView();
  const key = deviceKey(device);
  const { type, serial } = addressWords(device.address);
  const select = () => setView({ device: key === view.device ? "" : key });
  const name = `${deviceName(device)}, without a slot: ${whyWords(device)}`;
  return (
    <g
      className={`slot-box stray ${key === view.device ? "selected" : ""}`}
      transform={`translate(${place.x} ${place.y})`}
      aria-pressed={key === view.device}
      {...pressed(name, select)}
    >
      <title>{name}</title>
      <rect className="frame-box" width={width} height={BOX.height} rx="2" />
      <foreignObject x="6" y="2" width={width - 10} height="18">
        <div className="box-name">{type}</div>
      </foreignObject>
      <text className="box-id" x="6" y="31">
        serial {serial}
      </text>
      <g transform={`translate(${width - 19} 20)`}>
        <StateShape state="question" />
      </g>
    </g>
  );
}

/** Devices that were found stand beside the bus without a name, and slide into their slots when they are bound. */
function Devices({ devices, slots, layout, width }: DevicesProps) {
  const [view, setView] = useView();
  let unnamed = 0;
  const places = devices.map((device) => {
    const at = slots.findIndex((slot) => slotKey(slot) === device.slot);
    const place = at >= 0 ? layout.places[at] : undefined;
    return { device, bound: place !== undefined, place: place ?? poolPlace(layout.squares, unnamed++, width) };
  });
  return (
    <>
      {places.map(({ device, bound, place }) => (
        <g
          key={device.address}
          className={`device ${bound ? "bound" : ""}`}
          style={{ transform: `translate(${place.x}px, ${place.y}px)` }}
          {...(bound
            ? {}
            : {
                ...pressed(`${deviceName(device)}, without a slot yet`, () => setView({ device: deviceKey(device) })),
                "aria-pressed": view.device === deviceKey(device),
              })}
        >
          <title>{deviceName(device)}</title>
          <rect width="14" height="14" rx="2" />
        </g>
      ))}
    </>
  );
}
