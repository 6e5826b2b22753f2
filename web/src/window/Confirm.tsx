import { useEffect, useRef } from "react";
import { CommandLine } from "../parts/Act";
import { sendAll, useData, useStudio } from "./context";

/** Before something that can move a real machine. */
export function ConfirmDialog() {
  const studio = useStudio();
  const { store } = studio;
  const confirming = useData((state) => state.window.confirming);
  const dialog = useRef<HTMLDialogElement>(null);
  const close = () => store.dispatch({ type: "window", change: { confirming: null } });
  useEffect(() => {
    if (confirming) dialog.current?.showModal();
    else dialog.current?.close();
  }, [confirming]);
  const asks = (confirming ?? []).map((ask) => ({
    ...ask,
    values: { ...ask.values, yes: "1" },
    shown: { ...(ask.shown ?? ask.values), yes: "1" },
  }));
  const first = asks[0];
  const go = () => {
    if (confirming) sendAll(studio, asks);
    close();
  };
  return (
    <dialog ref={dialog} onClose={close} aria-label="Confirm">
      {first && (
        <>
          <h2>This can move the machine</h2>
          <p>Make sure that nobody is in its way. Then send it.</p>
          <CommandLine verb={first.verb} values={first.shown} />
          {asks.length > 1 && <p>The same for {asks.length - 1} more devices.</p>}
          <div className="row">
            <button type="button" autoFocus onClick={close}>
              Do nothing
            </button>
            <button type="button" className="danger" onClick={go}>
              Send it
            </button>
          </div>
        </>
      )}
    </dialog>
  );
}
