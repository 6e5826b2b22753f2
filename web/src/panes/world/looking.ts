import { useEffect } from "react";
import type { Pane } from "../../store/view";
import { useData, useStudio } from "../../window/context";
import { PLANT_OWNER } from "./reducer";

const EVERY_MS = 2000;
/** How the running process tells of what was done in its plant. */
const DONE_THERE = "simulated plant: ";

/** Asks how the plant is: for each pane anew, after each act of anybody there, and for World every two seconds. */
export function usePlant(pane: Pane): void {
  const { store, socket } = useStudio();
  const [there, last] = useData((state) => {
    const event = state.data.events.findLast((entry) => entry.text.startsWith(DONE_THERE));
    return [
      state.data.machine.simulated && state.connection.phase === "open",
      event ? `${event.at_s} ${event.text}` : "",
    ] as const;
  });
  useEffect(() => {
    if (!there) return;
    const ask = () => {
      const waits = store.get().requests.some((sent) => sent.owner === PLANT_OWNER && !sent.done);
      if (!waits && !document.hidden) socket.request("sim", { action: "devices" }, PLANT_OWNER);
    };
    socket.request("sim", { action: "devices" }, PLANT_OWNER);
    const timer = pane === "world" ? setInterval(ask, EVERY_MS) : undefined;
    return () => clearInterval(timer);
  }, [store, socket, there, last, pane]);
}
