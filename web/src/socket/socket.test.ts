import { describe, expect, it } from "vitest";
import { firstState, reducer } from "../store/reducer";
import { snapshot } from "../store/samples";
import { createStore } from "../store/store";
import { createSocket, pause, type Wire } from "./socket";
import { takeToken, tokenIn } from "./token";

class FakeWire implements Wire {
  binaryType = "";
  readyState = 1;
  onopen = null;
  onclose: (() => void) | null = null;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  sent: string[] = [];
  send(text: string) {
    this.sent.push(text);
  }
  close() {
    this.readyState = 3;
    this.onclose?.();
  }
  receive(message: unknown) {
    this.onmessage?.({ data: JSON.stringify(message) });
  }
}

function connected(refused = false) {
  const store = createStore(reducer, firstState);
  const wires: FakeWire[] = [];
  const later: { seconds: number; run: () => void }[] = [];
  const socket = createSocket(store, {
    open: () => {
      const wire = new FakeWire();
      wires.push(wire);
      return wire;
    },
    refuses: () => Promise.resolve(refused),
    fetch: (path, init) => Promise.resolve(new Response(`${init.method} ${path} ${JSON.stringify(init.headers)}`)),
    later: (seconds, run) => later.push({ seconds, run }),
    now: () => 0,
  });
  socket.start("secret");
  const wire = (i: number) => wires[i] ?? new FakeWire();
  return { store, socket, wires, wire, later };
}

describe("the socket", () => {
  it("shows its token by HTTP, too", async () => {
    const { socket } = connected();
    const answer = await socket.fetch("/api/v1/trace", { method: "GET" });
    expect(await answer.text()).toBe('GET /api/v1/trace {"Authorization":"Bearer secret"}');
  });

  it("asks for a new snapshot by a new connection behind a gap, and ignores the old one", () => {
    const { store, wires, wire } = connected();
    wire(0).receive(snapshot());
    wire(0).receive({ type: "change", seq: 12, time_s: 1 });
    expect(wires).toHaveLength(2);
    wire(0).receive(snapshot({ seq: 1000 }));
    expect(store.get().data.seq).toBe(7);
    wire(1).receive(snapshot({ seq: 30 }));
    expect(store.get().data.seq).toBe(30);
    expect(store.get().connection.phase).toBe("open");
  });

  it("waits longer each time that nobody answers, and begins anew behind a snapshot", async () => {
    const { store, wire, later } = connected();
    wire(0).close();
    await Promise.resolve();
    await Promise.resolve();
    expect(later[0]?.seconds).toBe(0.25);
    later[0]?.run();
    wire(1).close();
    await Promise.resolve();
    await Promise.resolve();
    expect(later[1]?.seconds).toBe(0.5);
    later[1]?.run();
    wire(2).receive(snapshot());
    wire(2).close();
    await Promise.resolve();
    await Promise.resolve();
    expect(later[2]?.seconds).toBe(0.25);
    expect(store.get().connection.phase).toBe("waiting");
    expect([1, 5, 6, 50].map(pause)).toEqual([0.25, 4, 8, 8]);
  });

  it("does not try again with a token that the server refuses", async () => {
    const { store, wire, later } = connected(true);
    wire(0).close();
    await Promise.resolve();
    await Promise.resolve();
    expect(store.get().connection.phase).toBe("refused");
    expect(later).toHaveLength(0);
  });

  it("says of a request that was open when the connection broke that nobody knows", () => {
    const { store, socket, wire } = connected();
    wire(0).receive(snapshot());
    socket.request("replace", { slot: "belt" }, "slots");
    expect(JSON.parse(wire(0).sent[0] ?? "")).toEqual({
      type: "request",
      id: "r1",
      verb: "replace",
      arguments: { slot: "belt" },
    });
    wire(0).receive({ type: "change", seq: 99, time_s: 1 });
    expect(store.get().requests[0]).toMatchObject({ done: true, status: 3 });
  });

  it("ignores what it does not know", () => {
    const { store, wire } = connected();
    wire(0).receive({ type: "weather" });
    wire(0).onmessage?.({ data: "{" });
    wire(0).onmessage?.({ data: new ArrayBuffer(3) });
    expect(store.get().data.seq).toBe(-1);
  });
});

describe("the token", () => {
  const storage = () => {
    const kept = new Map<string, string>();
    return {
      getItem: (key: string) => kept.get(key) ?? null,
      setItem: (key: string, value: string) => void kept.set(key, value),
      removeItem: (key: string) => void kept.delete(key),
    };
  };
  it("leaves the address and stays in the tab", () => {
    const kept = storage();
    let address = "";
    const place = { hash: "#token=abc123&pane=trace", pathname: "/", search: "" };
    expect(takeToken(place, kept, (to) => (address = to))).toBe("abc123");
    expect(address).toBe("/#pane=trace");
    expect(takeToken({ ...place, hash: "#pane=trace" }, kept, () => undefined)).toBe("abc123");
  });
  it("is found in what a person pastes", () => {
    expect(tokenIn(" http://127.0.0.1:8302/#token=abc_1 ")).toBe("abc_1");
    expect(tokenIn("abc")).toBe("abc");
    expect(tokenIn("no token, this")).toBeNull();
  });
});
