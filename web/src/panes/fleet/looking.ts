import { useEffect, useState } from "react";
import { useStudio } from "../../window/context";

const EVERY_MS = 2000;
const STEP_MS = 250;
const OWNER = "look:fleet";

/** Asks for what changed of the machines, one request under way at a time, while the pane is seen. */
export function useLooking(): void {
  const { store, socket } = useStudio();
  useEffect(() => {
    let asked = "";
    let due = 0;
    let busy = false;
    const look = () => {
      const { connection, requests, fleet } = store.get();
      if (busy || document.hidden || connection.phase !== "open") return;
      if (requests.some((sent) => sent.id === asked && !sent.done)) return;
      if (!fleet.more && performance.now() < due) return;
      due = performance.now() + EVERY_MS;
      busy = true;
      asked = socket.request("fleet", { since: String(fleet.changes) }, OWNER);
      busy = false;
    };
    look();
    const timer = setInterval(look, STEP_MS);
    // The rest of a long list comes at once, one part after the other.
    const forget = store.subscribe(() => store.get().fleet.more && look());
    return () => {
      clearInterval(timer);
      forget();
    };
  }, [store, socket]);
}

/** The clock's time, again and again. */
export function useNow(everyMs: number): number {
  const [now, setNow] = useState(() => Date.now());
  useEffect(() => {
    const timer = setInterval(() => setNow(Date.now()), everyMs);
    return () => clearInterval(timer);
  }, [everyMs]);
  return now;
}
