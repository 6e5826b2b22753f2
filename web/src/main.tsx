import { createRoot } from "react-dom/client";
import { takeToken } from "./socket/token";
import { fragmentOf, parseView } from "./store/view";
import "./style/theme.css";
import "./style/window.css";
import "./style/panes.css";
import { App } from "./window/App";
import { createStudio, StudioContext } from "./window/context";

const start = (): void => {
  const token = takeToken(window.location, sessionStorage, (address) => window.history.replaceState(null, "", address));
  const studio = createStudio(window.location.hash);
  const { store, socket } = studio;

  // The view lives in the address: another pane is a step back, the rest is not.
  let pane = store.get().view.pane;
  let written = window.location.hash;
  store.subscribe(() => {
    const { view } = store.get();
    const fragment = fragmentOf(view);
    if (fragment === written) return;
    written = fragment;
    if (view.pane === pane) window.history.replaceState(null, "", fragment);
    else window.history.pushState(null, "", fragment);
    pane = view.pane;
  });
  window.addEventListener("hashchange", () => {
    const again = takeToken(window.location, sessionStorage, (address) =>
      window.history.replaceState(null, "", address),
    );
    if (/[#&]token=/.test(written) === false && again && store.get().connection.phase !== "open") socket.start(again);
    written = window.location.hash;
    const change = parseView(written);
    pane = change.pane;
    store.dispatch({ type: "view", change });
  });

  // Frames are sent while a pane that draws them is seen.
  let live = false;
  const tell = () => {
    const { connection, view } = store.get();
    if (connection.phase !== "open") {
      live = false;
      return;
    }
    const wanted = !document.hidden && ["trace", "machine", "plots"].includes(view.pane);
    if (wanted === live) return;
    live = wanted;
    socket.send({ type: "live", frames: wanted });
  };
  store.subscribe(tell);
  document.addEventListener("visibilitychange", tell);

  if (window.innerWidth < 900) store.dispatch({ type: "window", change: { treeOpen: false, eventsOpen: false } });
  if (token) socket.start(token);
  createRoot(document.getElementById("root") ?? document.body).render(
    <StudioContext.Provider value={studio}>
      <App />
    </StudioContext.Provider>,
  );
};

start();
