import { Answer, CommandLine, useLastOf } from "../../parts/Act";
import type { Slot } from "../../protocol/messages";
import { visible } from "../../protocol/text";
import { barrier } from "../../store/barrier";
import { act, useData, useStudio } from "../../window/context";
import { cutAct, mendAct, plugAct, type WorldAct } from "../world/acts";
import { behind, cutBefore, hangs, nodesOf, wordOf, type CableNode } from "../world/cable";
import { columnPlace, type BusLayout, type Place } from "./layout";

const OWNER = "wires";

/**
 * What a press does to the cable of a simulated bus: a device's stub is its plug, the line is cut, a cut is mended. For
 * the mouse: the pane World has the same for the keyboard.
 */
export function Wires({ bus, slots, layout }: { bus: string; slots: Slot[]; layout: BusLayout }) {
  const studio = useStudio();
  const [all, world, may] = useData((state) => {
    const may = state.data.machine.simulated && barrier(state, "sim") === null;
    return [state.data.slots, state.world, may] as const;
  });
  const cable = world.cables.find((entry) => entry.bus === bus);
  if (!cable) return null;
  const nodes = nodesOf(cable, world.devices, all);
  const press = (what: WorldAct) => () => {
    if (may) act(studio, [{ verb: what.verb, values: what.values, owner: OWNER }]);
  };
  const columns = Math.ceil(slots.length / 2);
  return (
    <g className={`wires ${may ? "may" : ""}`} aria-hidden="true">
      {Array.from({ length: columns }, (_, column) => {
        const i = nodes.findIndex((node) => node.at >= 2 * column);
        const names = behind(nodes, i);
        if (i < 1 || !names.length || cutBefore(nodes, i)) return null;
        return (
          <LineHit
            key={column}
            place={columnPlace(layout, column)}
            width={layout.boxWidth}
            title={`Cut the cable before ${nameOf(nodes[i])}`}
            cut={press(cutAct("", bus, names))}
          />
        );
      })}
      {nodes.map((node, i) =>
        i > 0 && !hangs(nodes, i) && cutBefore(nodes, i) ? (
          <CutMark
            key={node.word}
            x={markX(layout, Math.min(node.at, slots.length - 1))}
            y={columnPlace(layout, Math.floor(Math.min(node.at, slots.length - 1) / 2)).y}
            title={`The cable is cut before ${nameOf(node)}. Press to mend it.`}
            mend={press(mendAct(bus))}
          />
        ) : null,
      )}
      {slots.map((slot, at) => {
        const device = world.devices.find((entry) => entry.bus === bus && entry.slot === slot.name);
        const { x, y } = columnPlace(layout, Math.floor(at / 2));
        if (!device) return null;
        const i = nodes.findIndex((node) => node.device === device);
        const open = i >= 0 && hangs(nodes, i);
        const what = open ? mendAct(bus) : plugAct(wordOf(device, all), device.plugged);
        return (
          <g key={device.name} className={`plug-hit ${device.plugged ? "" : "out"} ${open ? "open" : ""}`}>
            <title>{`${visible(what.label)}: ${visible(device.name)}`}</title>
            <path d={`M${x - 4} ${at % 2 ? y + 9 : y - 3}l8 -6`} />
            <rect x={x - 9} y={at % 2 ? y + 2 : y - 13} width="18" height="11" onClick={press(what)} />
          </g>
        );
      })}
    </g>
  );
}

const nameOf = (node: CableNode | undefined): string => visible(node?.device?.slot || node?.device?.name || "");

/** Where a cut before this slot is drawn: left of its column, or behind the upper one of two that stand together. */
function markX(layout: BusLayout, at: number): number {
  const { x } = columnPlace(layout, Math.floor(at / 2));
  return at % 2 ? x + 14 : Math.max(20, x - layout.boxWidth / 2 - 4);
}

interface LineHitProps {
  place: Place;
  width: number;
  title: string;
  cut: () => void;
}

function LineHit({ place, width, title, cut }: LineHitProps) {
  const from = Math.max(6, place.x - width + 6);
  return (
    <g className="line-hit">
      <title>{title}</title>
      <rect x={from} y={place.y - 8} width={place.x - 12 - from} height="16" onClick={cut} />
    </g>
  );
}

function CutMark({ x, y, title, mend }: { x: number; y: number; title: string; mend: () => void }) {
  return (
    <g className="cut-mark" transform={`translate(${x} ${y})`}>
      <title>{title}</title>
      <rect x="-5" y="-4" width="10" height="8" className="gap" />
      <path d="M-8 6l6 -12M2 6l6 -12" />
      <rect x="-12" y="-10" width="24" height="20" onClick={mend} />
    </g>
  );
}

/** What was pressed last in the drawing, as a command, and its answer. */
export function WireAnswer() {
  const last = useLastOf(OWNER);
  if (!last) return null;
  return (
    <div className="form">
      <CommandLine verb={last.verb} values={last.values} />
      <Answer sent={last} />
    </div>
  );
}
