import { useVirtualizer } from "@tanstack/react-virtual";
import { useEffect, useRef } from "react";
import { deviceKey, inNeedOf, straysOf } from "../panes/machine/strays";
import type { Event } from "../protocol/messages";
import { LSS_ADDRESS, visible } from "../protocol/text";
import { slotKey } from "../store/keys";
import { useData, useStudio, useView } from "./context";

export function Events() {
  const { store } = useStudio();
  const [view, setView] = useView();
  const [needing, open, last] = useData((state) => {
    const { events } = state.data;
    return [inNeedOf(state).length, state.window.eventsOpen, events[events.length - 1]] as const;
  });
  // Each press goes on to the next one.
  const next = () => {
    const needy = inNeedOf(store.get());
    const at = needy.findIndex(({ slot, device }) =>
      slot ? slotKey(slot) === view.slot : deviceKey(device) === view.device,
    );
    const one = needy[(at + 1) % needy.length];
    if (!one) return;
    if (one.slot) setView({ slot: slotKey(one.slot), pane: "slots" });
    else setView({ device: deviceKey(one.device), pane: "machine" });
    store.dispatch({ type: "window", change: { inspectorOpen: true } });
  };
  return (
    <section className={`events ${open ? "" : "closed"}`} aria-label="Events">
      <div className="events-head">
        <button
          type="button"
          aria-expanded={open}
          onClick={() => store.dispatch({ type: "window", change: { eventsOpen: !open } })}
        >
          Events {open ? "▾" : "▴"}
        </button>
        {needing > 0 ? (
          <button type="button" className="need" onClick={next}>
            ▲ {needing} {needing === 1 ? "needs" : "need"} somebody
          </button>
        ) : (
          <span className="quiet">nothing needs you</span>
        )}
        {!open && last && (
          <span className="last">
            {last.at_s.toFixed(3)} s {visible(last.slot ?? "")} {visible(last.text)}
          </span>
        )}
      </div>
      {open && <EventList />}
    </section>
  );
}

function EventList() {
  const { store } = useStudio();
  const [view, setView] = useView();
  /** The device without a slot that an event names. */
  const chooseDevice = (event: Event) => {
    const address = LSS_ADDRESS.exec(event.text)?.[0].toUpperCase();
    const device = straysOf(store.get()).find((each) => each.bus === event.bus && each.address === address);
    if (device) setView({ device: deviceKey(device) });
  };
  const [events, slots] = useData((state) => [state.data.events, state.data.slots] as const);
  const scroller = useRef<HTMLDivElement>(null);
  const rows = useVirtualizer({
    count: events.length,
    getScrollElement: () => scroller.current,
    estimateSize: () => 24,
    overscan: 4,
  });
  const follows = useRef(true);
  useEffect(() => {
    if (follows.current && events.length) rows.scrollToIndex(events.length - 1);
  }, [events.length, rows]);
  const onScroll = () => {
    const box = scroller.current;
    if (box) follows.current = box.scrollHeight - box.scrollTop - box.clientHeight < 30;
  };
  return (
    <div className="event-list" ref={scroller} onScroll={onScroll} tabIndex={0} role="log" aria-live="off">
      <div style={{ height: rows.getTotalSize(), position: "relative" }}>
        {rows.getVirtualItems().map((row) => {
          const event = events[row.index];
          if (!event) return null;
          const slot = slots.find((entry) => entry.bus === event.bus && entry.name === event.slot);
          const key = slot ? slotKey(slot) : "";
          const dim = view.slot !== "" && key !== view.slot;
          return (
            <div
              key={row.index}
              className={`event kind-${event.kind.replace(/\W+/g, "-")} ${dim ? "dim" : ""}`}
              style={{ transform: `translateY(${row.start}px)` }}
              onClick={() => (key ? setView({ slot: key }) : chooseDevice(event))}
            >
              <span className="number">{event.at_s.toFixed(3)} s</span>
              <span>{visible(event.bus)}</span>
              <span className="name">{visible(event.slot ?? "")}</span>
              <span className="kind">{event.kind}</span>
              <span className="text">{visible(event.text)}</span>
            </div>
          );
        })}
      </div>
    </div>
  );
}
