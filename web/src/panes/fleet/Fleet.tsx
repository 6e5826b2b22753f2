import { useVirtualizer } from "@tanstack/react-virtual";
import { useMemo, useRef, type KeyboardEvent, type ReactNode } from "react";
import { StateMark, StateWord, toneOf } from "../../parts/StateMark";
import { visible } from "../../protocol/text";
import { useData, useStudio, useView } from "../../window/context";
import { useWidth } from "../../window/inSight";
import { useLooking, useNow } from "./looking";
import {
  ageWords,
  found,
  headline,
  machineKey,
  ordered,
  slotsWords,
  stateOf,
  studioLink,
  type FleetMachine,
  type FleetSlot,
} from "./reducer";

const TILE_WIDTH = 290;
const SEARCH_FROM = 12;
const MOST_TOLD = 3;

export function Fleet() {
  useLooking();
  const fleet = useData((state) => state.fleet);
  const all = useMemo(() => ordered(fleet.machines), [fleet.machines]);
  const shown = useMemo(() => found(all, fleet.search), [all, fleet.search]);
  return (
    <>
      <Head all={all} shown={shown} />
      <Tiles machines={shown} />
    </>
  );
}

function Head({ all, shown }: { all: readonly FleetMachine[]; shown: readonly FleetMachine[] }) {
  const { store } = useStudio();
  const [fleet, own] = useData((state) => [state.fleet, state.data.machine.fleet ?? ""] as const);
  const group = own.slice(0, own.indexOf("/"));
  return (
    <>
      <div className="bar">
        {(all.length > SEARCH_FROM || fleet.search !== "") && (
          <input
            type="search"
            value={fleet.search}
            placeholder="Search: name, state, slot, reason …"
            aria-label="Search machines"
            onChange={(event) => store.dispatch({ type: "fleet/search", search: event.target.value })}
          />
        )}
        <b>{all.length ? headline(all) : "No machine is known yet"}</b>
        <span className="quiet">group {visible(group)}</span>
        {shown.length < all.length && <span className="quiet">{shown.length} shown</span>}
      </div>
      {fleet.connected !== true && (
        <p className="fleet-trouble" role="status">
          {fleet.trouble ? `Not connected: ${visible(fleet.trouble)}` : "Connecting to the broker …"}
        </p>
      )}
      {fleet.connected === true && fleet.trouble && (
        <p className="fleet-trouble" role="status">
          {visible(fleet.trouble)}
        </p>
      )}
      {fleet.connected === true && !all.length && (
        <p className="hint start">Machines tell about themselves within five seconds.</p>
      )}
    </>
  );
}

/** Only the tiles in sight are drawn. */
function Tiles({ machines }: { machines: readonly FleetMachine[] }) {
  const now = useNow(10_000);
  const open = useData((state) => state.fleet.open);
  const scroller = useRef<HTMLDivElement>(null);
  const columns = Math.max(1, Math.floor(useWidth(scroller) / TILE_WIDTH));
  const list = useVirtualizer({
    count: Math.ceil(machines.length / columns),
    getScrollElement: () => scroller.current,
    estimateSize: () => 110,
    overscan: 3,
  });
  const focus = (at: number) => {
    list.scrollToIndex(Math.floor(at / columns));
    // It is drawn after it has come into sight.
    requestAnimationFrame(() => scroller.current?.querySelector<HTMLElement>(`[data-at="${at}"]`)?.focus());
  };
  const onKey = (event: KeyboardEvent) => {
    const tile = event.target instanceof HTMLElement ? event.target.dataset.at : undefined;
    const steps: Record<string, number> = { ArrowUp: -columns, ArrowDown: columns, ArrowLeft: -1, ArrowRight: 1 };
    const step = steps[event.key];
    if (tile === undefined || step === undefined) return;
    event.preventDefault();
    const next = Number(tile) + step;
    if (next >= 0 && next < machines.length) focus(next);
  };
  return (
    <div className="scroll" ref={scroller} tabIndex={-1} onKeyDown={onKey}>
      <div className="tiles" role="list" aria-label="Machines" style={{ height: list.getTotalSize() }}>
        {list.getVirtualItems().map((row) => (
          <div
            key={row.key}
            className="tile-row"
            data-index={row.index}
            ref={list.measureElement}
            style={{
              transform: `translateY(${row.start}px)`,
              gridTemplateColumns: `repeat(${columns}, minmax(0, 1fr))`,
            }}
          >
            {machines.slice(row.index * columns, (row.index + 1) * columns).map((machine, i) => {
              const at = row.index * columns + i;
              const key = machineKey(machine);
              return <Tile key={key} machine={machine} at={at} of={machines.length} now={now} open={open === key} />;
            })}
          </div>
        ))}
      </div>
    </div>
  );
}

interface TileProps {
  machine: FleetMachine;
  at: number;
  of: number;
  now: number;
  open: boolean;
}

function Tile({ machine, at, of, now, open }: TileProps) {
  const own = useData((state) => state.data.machine.fleet === machineKey(machine));
  const { word, mark } = stateOf(machine);
  const before = machine.online ? "" : "last ";
  const counted = slotsWords(machine);
  const facts = [counted && before + counted, machine.version && `Berth ${visible(machine.version)}`];
  return (
    <div className={`tile ${machine.needs ? "needs" : ""}`} role="listitem" aria-setsize={of} aria-posinset={at + 1}>
      <Press machine={machine} at={at} own={own} open={open}>
        <span className="tile-name">
          <StateMark state={mark} /> <b>{visible(machine.name)}</b>
          {own && <span className="quiet"> this machine</span>}
        </span>
        <span>
          <span className={`tone-${toneOf(mark)}`}>{visible(word)}</span>
          <span className="quiet" title={new Date(machine.sinceMs).toLocaleString()}>
            {" "}
            · for {ageWords(now, machine.sinceMs)}
          </span>
        </span>
        <span className="quiet">{facts.filter(Boolean).join(" · ")}</span>
        {!open && machine.online && <Trouble slots={machine.slots.filter((slot) => slot.needs)} />}
      </Press>
      {open && <TileSlots machine={machine} />}
    </div>
  );
}

/** What a press does: this machine's slots, the machine's own Studio, or its slots in the tile. */
function Press({
  machine,
  at,
  own,
  open,
  children,
}: Omit<TileProps, "of" | "now"> & { own: boolean; children: ReactNode }) {
  const { store } = useStudio();
  const [, setView] = useView();
  const link = own ? null : studioLink(machine.studio, window.location.hostname);
  if (link) {
    return (
      <a className="tile-press" data-at={at} href={link} target="_blank" rel="noopener noreferrer">
        {children}
        <span className="leads">Its Studio: {visible(new URL(link).host)} ↗</span>
      </a>
    );
  }
  const slots = () => store.dispatch({ type: "fleet/open", open: open ? "" : machineKey(machine) });
  const press = own ? () => setView({ pane: "slots" }) : slots;
  const more = machine.slots.length > 0;
  return (
    <button
      type="button"
      className="tile-press"
      data-at={at}
      aria-expanded={own || !more ? undefined : open}
      aria-disabled={!own && !more}
      onClick={own || more ? press : undefined}
    >
      {children}
      {own && <span className="leads">Its slots</span>}
      {!own && more && <span className="leads">{open ? "▾ Its slots" : "▸ Its slots"}</span>}
      {!own && machine.studio && (
        <span className="quiet">Its Studio is for its own computer only: {visible(machine.studio)}</span>
      )}
    </button>
  );
}

function Trouble({ slots }: { slots: readonly FleetSlot[] }) {
  return (
    <>
      {slots.slice(0, MOST_TOLD).map((slot) => (
        <span key={slot.name} className="tile-reason">
          <StateMark state={slot.state} /> {visible(slot.name)}: {visible(slot.reason || slot.state)}
        </span>
      ))}
      {slots.length > MOST_TOLD && <span className="quiet">and {slots.length - MOST_TOLD} slots more</span>}
    </>
  );
}

function TileSlots({ machine }: { machine: FleetMachine }) {
  const slots = useMemo(() => [...machine.slots].sort((a, b) => Number(b.needs) - Number(a.needs)), [machine.slots]);
  return (
    <div className="tile-slots" role="region" aria-label={`Slots of ${visible(machine.name)}`} tabIndex={0}>
      {!machine.online && <p className="quiet">What it told last:</p>}
      <ul>
        {slots.map((slot) => (
          <li key={slot.name}>
            <b>{visible(slot.name)}</b> <StateWord state={slot.state} />
            {slot.reason && <> {visible(slot.reason)}</>}
            {slot.emcy && <> · EMCY: {visible(slot.emcy)}</>}
            {told("configuration", slot.configuration)}
            {told("program", slot.program)}
          </li>
        ))}
      </ul>
    </div>
  );
}

/** Only what is not as it shall be. */
function told(what: string, word: string): string {
  return ["", "none", "as wanted"].includes(word) ? "" : ` · ${what} ${visible(word)}`;
}
