import {
  createColumnHelper,
  flexRender,
  getCoreRowModel,
  getSortedRowModel,
  useReactTable,
  type SortingState,
} from "@tanstack/react-table";
import type { KeyboardEvent } from "react";
import { StateWord } from "../../parts/StateMark";
import type { Slot } from "../../protocol/messages";
import { serialWords, typeWords, visible } from "../../protocol/text";
import { slotKey } from "../../store/keys";
import { useData, useStudio, useView } from "../../window/context";
import { emcyWords, needOf } from "./reducer";

const column = createColumnHelper<Slot>();
const columns = [
  column.accessor((slot) => (needOf(slot) ? "0 " : "1 ") + slot.state, {
    id: "state",
    header: "State",
    cell: ({ row }) => <StateWord state={row.original.state} />,
  }),
  column.accessor("bus", { header: "Bus", cell: (cell) => visible(cell.getValue()) }),
  column.accessor("id", { header: "Node-ID" }),
  column.accessor("name", { header: "Slot", cell: (cell) => <b>{visible(cell.getValue())}</b> }),
  column.accessor((slot) => typeWords(slot.type), {
    id: "type",
    header: () => <span title="Vendor-ID / product code">Type</span>,
  }),
  column.accessor((slot) => serialWords(slot.r_sn).serial, {
    id: "serial",
    header: () => <span title="Serial number">Serial</span>,
  }),
  column.accessor("since_s", { header: "Since", cell: (cell) => `${cell.getValue().toFixed(3)} s` }),
  column.accessor((slot) => emcyWords(slot.emcy), {
    id: "emcy",
    header: "EMCY",
    cell: ({ row }) => <span title={visible(row.original.emcy?.text ?? "")}>{emcyWords(row.original.emcy)}</span>,
  }),
  column.accessor((slot) => slot.reason ?? "", {
    id: "reason",
    header: "Reason",
    cell: (cell) => <span title={visible(cell.getValue())}>{visible(cell.getValue())}</span>,
  }),
];

const arrows = { asc: " ▴", desc: " ▾" };

export function Slots() {
  const { store } = useStudio();
  const [view, setView] = useView();
  const [slots, buses, sorting] = useData(
    (state) => [state.data.slots, state.data.buses.length, state.slots.sort] as const,
  );
  // A column that says the same of every slot takes room from the reasons.
  const columnVisibility = { bus: buses > 1, emcy: slots.some((slot) => slot.emcy) };
  const table = useReactTable({
    data: slots,
    columns,
    state: { sorting, columnVisibility },
    onSortingChange: (change) => {
      const sort: SortingState = typeof change === "function" ? change(sorting) : change;
      store.dispatch({ type: "slots/sort", sort });
    },
    getCoreRowModel: getCoreRowModel(),
    getSortedRowModel: getSortedRowModel(),
    getRowId: slotKey,
  });
  const select = (key: string) => {
    setView({ slot: key });
    store.dispatch({ type: "window", change: { inspectorOpen: true } });
  };
  return (
    <div className="scroll" tabIndex={-1}>
      <table className="rows">
        <thead>
          {table.getHeaderGroups().map((group) => (
            <tr key={group.id}>
              {group.headers.map((header) => {
                const sorted = header.column.getIsSorted();
                const order = sorted === "asc" ? "ascending" : sorted === "desc" ? "descending" : "none";
                return (
                  <th key={header.id} className={`col-${header.id}`} aria-sort={order}>
                    <button type="button" onClick={header.column.getToggleSortingHandler()}>
                      {flexRender(header.column.columnDef.header, header.getContext())}
                      {sorted ? arrows[sorted] : ""}
                    </button>
                  </th>
                );
              })}
            </tr>
          ))}
        </thead>
        <tbody onKeyDown={moveRow}>
          {table.getRowModel().rows.map((row) => (
            <tr
              key={row.id}
              tabIndex={0}
              className={needOf(row.original) ? "needs" : ""}
              aria-selected={row.id === view.slot}
              onClick={() => select(row.id)}
              onKeyDown={(event) => event.key === "Enter" && select(row.id)}
            >
              {row.getVisibleCells().map((cell) => (
                <td key={cell.id} className={`col-${cell.column.id}`}>
                  {flexRender(cell.column.columnDef.cell, cell.getContext())}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

function moveRow(event: KeyboardEvent<HTMLElement>) {
  const row = event.target instanceof HTMLTableRowElement ? event.target : null;
  const next =
    event.key === "ArrowDown" ? row?.nextElementSibling : event.key === "ArrowUp" ? row?.previousElementSibling : null;
  if (!(next instanceof HTMLElement)) return;
  event.preventDefault();
  next.focus();
}
