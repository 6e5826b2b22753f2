import { useState } from "react";
import { hex } from "../../protocol/text";
import { useData } from "../../window/context";
import { addressTree, type AddressNode } from "./reducer";

const levels = ["vendor-ID", "product code", "revision number", "serial number"];
const MOST_LEAVES = 24;

/** The tree of addresses: what a search has found so far, and what it asks now. */
export function Discovery() {
  const [found, question, steps] = useData(
    (state) =>
      [
        state.machine.found,
        state.machine.question,
        state.data.events.findLast((event) => event.kind === "step" && event.text.startsWith("discovery")),
      ] as const,
  );
  const [open, setOpen] = useState(true);
  if (!found.length && !question) return null;
  const bound = found.filter((device) => device.slot).length;
  return (
    <section className="discovery">
      <h2>
        <button type="button" aria-expanded={open} onClick={() => setOpen(!open)}>
          Discovery {open ? "▾" : "▸"}
        </button>
        <span className="quiet">
          {found.length} found, {bound} bound
        </span>
      </h2>
      {open && (
        <>
          {question && (
            <p className="number">
              {question.n} questions seen on the bus. The last: {question.text}
            </p>
          )}
          {steps && <p className="quiet">{steps.text}</p>}
          <Nodes nodes={addressTree(found)} level={0} />
        </>
      )}
    </section>
  );
}

function Nodes({ nodes, level }: { nodes: AddressNode[]; level: number }) {
  if (level === 3) return <Leaves nodes={nodes} />;
  return (
    <ul className="address-tree">
      {nodes.map((node) => (
        <li key={node.word}>
          <span className="quiet">{levels[level]}</span> <b className="number">{hex(parseInt(node.word, 16))}</b>
          <span className="quiet">
            {" "}
            {node.bound} of {node.count} bound
          </span>
          <Nodes nodes={node.children} level={level + 1} />
        </li>
      ))}
    </ul>
  );
}

function Leaves({ nodes }: { nodes: AddressNode[] }) {
  const left = nodes.length - MOST_LEAVES;
  return (
    <p className="leaves number">
      <span className="quiet">serial number</span>
      {nodes.slice(0, MOST_LEAVES).map((node) => (
        <span key={node.word} className={node.bound ? "leaf bound" : "leaf"}>
          {hex(parseInt(node.word, 16))}
        </span>
      ))}
      {left > 0 && <span className="quiet">and {left} more</span>}
    </p>
  );
}
