/**
 * A server for development and tests that speaks the contract and needs no Berth:
 *   node mock/server.mjs --example conveyor --token test --rate 500 --buses 1 [--done] [--real] [--role view] [--odd]
 *   [--fleet 100]
 */
import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { WebSocketServer } from "ws";
import { encodeBatch } from "./batch.mjs";
import { candump, readCandump, signals } from "./files.mjs";
import { MockMachine } from "./machine.mjs";

const dist = fileURLToPath(new URL("../dist/", import.meta.url));
export const types = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".css": "text/css",
  ".svg": "image/svg+xml",
};
export const CSP =
  "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; font-src 'self'; " +
  "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const BATCHES_PER_S = 30;
const FULL = 4_000_000;

export async function startMock({ port = 0, token = "test", ...options } = {}) {
  const machine = new MockMachine(options);
  const clients = new Set();

  const server = createServer(async (request, response) => {
    const { pathname: path, searchParams } = new URL(request.url, "http://mock");
    if (!path.startsWith("/api/")) return serveFile(path, response);
    if (request.headers.authorization !== `Bearer ${token}`)
      return end(response, 401, { error: { message: "wrong token" } });
    if (path === "/api/v1/snapshot") return end(response, 200, machine.snapshot(0));
    if (path === "/api/v1/request" && request.method === "POST") {
      const { verb, arguments: values } = JSON.parse(await textOf(request));
      return end(response, 200, machine.request(verb, values ?? {}));
    }
    if (path === "/api/v1/signals") return end(response, 200, signals(machine));
    if (path === "/api/v1/trace") return sendTrace(searchParams, response);
    if (path === "/api/v1/read" && request.method === "POST") {
      const name = searchParams.get("name") ?? "";
      const read = readCandump(name, await textOf(request));
      return read
        ? end(response, 200, read)
        : text(response, 422, `422: ${name}: the mock server reads candump logs only`);
    }
    return end(response, 404, { error: { message: "there is no such page" } });
  });

  function sendTrace(query, response) {
    if ((query.get("format") ?? "candump") !== "candump")
      return text(response, 400, "400: the mock server writes candump logs only");
    const from = Number(query.get("from") ?? 0);
    const to = Number(query.get("to") ?? Infinity);
    const { rows } = machine.rows({ from, count: Infinity, filter: query.get("filter") ?? "" });
    text(response, 200, candump(rows.filter((row) => row.n <= to)));
  }

  const sockets = new WebSocketServer({ noServer: true, handleProtocols: () => "berth.v1" });
  server.on("upgrade", (request, socket, head) => {
    const offered = (request.headers["sec-websocket-protocol"] ?? "").split(",").map((word) => word.trim());
    const origin = request.headers.origin;
    const own = !origin || new URL(origin).host === request.headers.host;
    if (request.url !== "/api/v1/socket" || !own || !offered.includes(`token.${token}`)) {
      socket.end("HTTP/1.1 401 Unauthorized\r\nConnection: close\r\n\r\n");
      return;
    }
    sockets.handleUpgrade(request, socket, head, (ws) => welcome(ws));
  });

  function welcome(ws) {
    const client = { ws, seq: 100, live: false, frames: [], leftOut: 0 };
    clients.add(client);
    client.listener = (frame) => client.live && client.frames.push(frame);
    machine.listeners.add(client.listener);
    say(client, machine.snapshot(client.seq));
    ws.on("message", (data) => hear(client, JSON.parse(data.toString())));
    ws.on("close", () => {
      clients.delete(client);
      machine.listeners.delete(client.listener);
    });
  }

  function hear(client, message) {
    if (message.type === "request") {
      const answer = machine.request(message.verb, message.arguments);
      setTimeout(() => say(client, { type: "reply", id: message.id, ...answer }), 30);
    } else if (message.type === "frames") {
      say(client, { type: "frames", id: message.id, ...machine.rows(message) });
    } else if (message.type === "live") {
      client.live = message.frames;
      client.frames = [];
    } else if (message.type === "unlock") {
      machine.lock = { ...machine.lock, unlocked_until_s: machine.time + message.minutes * 60 };
      machine.news.lock = true;
    } else if (message.type === "lock") {
      machine.lock = { ...machine.lock, unlocked_until_s: null };
      machine.news.lock = true;
    }
  }

  function say(client, message) {
    client.ws.send(JSON.stringify(message));
  }

  let last = performance.now();
  const timer = setInterval(() => {
    const now = performance.now();
    machine.advance(Math.min(0.5, (now - last) / 1000));
    last = now;
    const news = machine.takeNews();
    for (const client of clients) {
      if (news) say(client, { type: "change", seq: ++client.seq, ...news });
      sendFrames(client);
    }
  }, 1000 / BATCHES_PER_S);

  function sendFrames(client) {
    const { frames } = client;
    if (!frames.length) return;
    client.frames = [];
    if (client.ws.bufferedAmount > FULL) client.leftOut += frames.length;
    else client.ws.send(encodeBatch(frames.slice(0, 65535)));
  }

  const slow = setInterval(() => {
    for (const client of clients) say(client, { ...machine.rates(), left_out: client.leftOut });
  }, 250);

  await new Promise((resolve) => server.listen(port, "127.0.0.1", resolve));
  const address = `http://127.0.0.1:${server.address().port}/`;
  return {
    machine,
    address,
    url: `${address}#token=${token}`,
    /** The next change has a number too high. */
    makeGap: () => clients.forEach((client) => (client.seq += 3)),
    dropClients: () => clients.forEach((client) => client.ws.terminate()),
    close: () => {
      clearInterval(timer);
      clearInterval(slow);
      clients.forEach((client) => client.ws.terminate());
      const closed = new Promise((resolve) => server.close(resolve));
      server.closeAllConnections();
      return closed;
    },
  };
}

async function textOf(request) {
  let whole = "";
  for await (const part of request) whole += part;
  return whole;
}

function end(response, status, value) {
  response.writeHead(status, { "Content-Type": "application/json", "Cache-Control": "no-store" });
  response.end(JSON.stringify(value));
}

function text(response, status, body) {
  response.writeHead(status, { "Content-Type": "text/plain; charset=utf-8", "Cache-Control": "no-store" });
  response.end(body);
}

async function serveFile(path, response) {
  const file = normalize(join(dist, path === "/" ? "index.html" : path));
  try {
    if (!file.startsWith(dist)) throw new Error("outside");
    const body = gzipSync(await readFile(file));
    const type = types[extname(file)] ?? "application/octet-stream";
    response.writeHead(200, {
      "Content-Type": type,
      "Content-Encoding": "gzip",
      "Content-Security-Policy": CSP,
      "X-Content-Type-Options": "nosniff",
    });
    response.end(body);
  } catch {
    response.writeHead(404).end();
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const option = (name, otherwise) => {
    const at = process.argv.indexOf(`--${name}`);
    return at < 0 ? otherwise : process.argv[at + 1];
  };
  const mock = await startMock({
    port: Number(option("port", 8302)),
    token: option("token", "test"),
    example: option("example", "conveyor"),
    rate: Number(option("rate", 500)),
    buses: Number(option("buses", 1)),
    role: option("role", "configure"),
    done: process.argv.includes("--done"),
    real: process.argv.includes("--real"),
    odd: process.argv.includes("--odd"),
    fleet: Number(option("fleet", 0)),
  });
  console.log(mock.url);
}
