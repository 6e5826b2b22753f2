import { useEffect } from "react";
import { usePlant } from "../panes/world/looking";
import { PaneBody, PaneTabs, usePanes } from "./Panes";
import { ConfirmDialog } from "./Confirm";
import { useData, useStudio } from "./context";
import { Events } from "./Events";
import { Help } from "./Help";
import { Inspector, useInspected } from "./Inspector";
import { useKeys } from "./keys";
import { Palette } from "./Palette";
import { TokenPage } from "./TokenPage";
import { TopBar } from "./TopBar";
import { Tree } from "./Tree";

export function App() {
  const [phase, seq, window_, view] = useData(
    (state) => [state.connection.phase, state.data.seq, state.window, state.view] as const,
  );
  const { store } = useStudio();
  const panes = usePanes();
  const inspected = useInspected();
  useKeys();
  usePlant(view.pane);
  // A pane that this server cannot fill is not shown: the first one is, instead.
  const first = panes[0]?.name;
  const shown = seq < 0 || panes.some((pane) => pane.name === view.pane);
  useEffect(() => {
    if (!shown && first) store.dispatch({ type: "view", change: { pane: first } });
  }, [shown, first, store]);
  useEffect(() => {
    document.documentElement.dataset.theme = window_.theme;
  }, [window_.theme]);

  if (phase === "no-token" || phase === "refused") return <TokenPage refused={phase === "refused"} />;
  const classes = ["window", window_.treeOpen ? "" : "no-tree", inspected ? "" : "no-inspector"];
  return (
    <div className={classes.filter(Boolean).join(" ")}>
      <TopBar />
      {window_.treeOpen && <Tree />}
      <main className="middle">
        <PaneTabs />
        <PaneBody />
      </main>
      {inspected && <Inspector />}
      <Events />
      {window_.palette && <Palette />}
      {window_.help && <Help />}
      <ConfirmDialog />
      <p className="unseen" role="status">
        {window_.notice}
      </p>
    </div>
  );
}
