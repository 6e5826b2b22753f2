import { afterEach, describe, expect, it } from "vitest";
import WebSocket from "ws";
import { decodeBatch, frameOf } from "../src/protocol/batch";
import { encodeBatch } from "./batch.mjs";
import { startMock } from "./server.mjs";

let mock;
afterEach(() => mock?.close());

function open(token) {
  const messages = [];
  const socket = new WebSocket(mock.address.replace("http", "ws") + "api/v1/socket", ["berth.v1", `token.${token}`]);
  socket.binaryType = "arraybuffer";
  socket.on("message", (data, binary) => messages.push(binary ? data : JSON.parse(data.toString())));
  const when = async (test) => {
    for (let i = 0; i < 100; i++) {
      const found = messages.find(test);
      if (found) return found;
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
    throw new Error("it did not come");
  };
  return { socket, messages, when };
}

describe("the mock server", () => {
  it("lets nobody in without the token", async () => {
    mock = await startMock({ example: "belt" });
    const { socket } = open("wrong");
    await new Promise((resolve) => socket.on("error", resolve));
    expect((await fetch(`${mock.address}api/v1/snapshot`)).status).toBe(401);
  });

  it("sends a snapshot, then changes in order, frames and replies", async () => {
    mock = await startMock({ example: "belt", rate: 300 });
    const { socket, messages, when } = open("test");
    const snapshot = await when((m) => m.type === "snapshot");
    expect(snapshot.slots.map((slot) => slot.name)).toEqual(["belt", "barrier"]);
    socket.send(JSON.stringify({ type: "live", frames: true }));
    socket.send(JSON.stringify({ type: "request", id: "a", verb: "locate", arguments: { target: "belt" } }));
    expect(await when((m) => m.type === "reply")).toMatchObject({ id: "a", status: 0 });
    const batch = decodeBatch(await when((m) => m instanceof ArrayBuffer));
    expect(batch.count).toBeGreaterThan(0);
    await when((m) => m.type === "change");
    const numbers = messages.filter((m) => m.type === "change").map((m) => m.seq);
    numbers.forEach((seq, i) => expect(seq).toBe(snapshot.seq + 1 + i));
    socket.send(JSON.stringify({ type: "frames", id: "f", from: 0, count: 2000, filter: "heartbeat" }));
    const found = await when((m) => m.type === "frames");
    expect(found.rows.every((row) => /heartbeat/i.test(row.text))).toBe(true);
    socket.close();
  });

  it("writes its ring as a log, reads that log, and tells signals", async () => {
    mock = await startMock({ example: "belt", rate: 300, done: true });
    const ask = (path, more = {}) =>
      fetch(`${mock.address}api/v1/${path}`, { ...more, headers: { Authorization: "Bearer test" } });
    const log = await (await ask("trace?format=candump&from=5&to=9&filter=field")).text();
    const lines = log.trim().split("\n");
    expect(lines).toHaveLength(5);
    expect(lines[0]).toMatch(/^\(\d{10}\.\d{6}\) field [0-9A-F]{3,8}#/);
    const answer = await ask("read?name=run.log", { method: "POST", body: `${log}no frame\n` });
    expect(await answer.json()).toMatchObject({ name: "run.log", frames: 5, buses: ["field"], more_findings: 0 });
    expect((await ask("trace?format=pcapng")).status).toBe(400);
    expect((await ask("read?name=x", { method: "POST", body: "" })).status).toBe(422);
    const { buses } = await (await ask("signals")).json();
    expect(buses[0].bus).toBe("field");
    for (const message of buses[0].messages) expect(message.signals.length).toBeGreaterThan(0);
  });

  it("writes batches that the page reads", () => {
    const frame = { n: 9, t: 1.25, id: 0x601, ext: false, rtr: false, data: "4018100400000000", bus: 1 };
    const bytes = encodeBatch([frame, { ...frame, n: 10, t: 1.2505, id: 0x1f940000, ext: true, data: "" }]);
    const batch = decodeBatch(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
    expect(frameOf(batch, 0)).toMatchObject({ n: 9, id: 0x601, sent: true, bus: 1, seconds: 1.25 });
    expect(frameOf(batch, 1)).toMatchObject({ n: 10, id: 0x1f940000, extended: true });
  });
});
