import { useEffect, useRef } from "react";
import { CommandLine } from "../parts/Act";
import { useData, useStudio } from "./context";

/** The only dialog: before something that can move a real machine. */
export function ConfirmDialog() {
  const { store, socket } = useStudio();
  const confirming = useData((state) => state.window.confirming);
  const dialog = useRef<HTMLDialogElement>(null);
  const close = () => store.dispatch({ type: "window", change: { confirming: null } });
  useEffect(() => {
    if (confirming) dialog.current?.showModal();
    else dialog.current?.close();
  }, [confirming]);
  const go = () => {
    if (confirming) socket.request(confirming.verb, { ...confirming.values, yes: "1" }, confirming.owner);
    close();
  };
  return (
    <dialog ref={dialog} onClose={close} aria-label="Confirm">
      {confirming && (
        <>
          <h2>This can move the machine</h2>
          <p>Look that nobody stands in its way. Then send it.</p>
          <CommandLine verb={confirming.verb} values={{ ...confirming.values, yes: "1" }} />
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
