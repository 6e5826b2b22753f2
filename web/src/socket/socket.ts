import { decodeBatch } from "../protocol/batch";
import { parseMessage, type ClientMessage } from "../protocol/messages";
import type { Action, State } from "../store/state";
import type { Store } from "../store/store";

const FIRST_PAUSE_S = 0.25;
const LONGEST_PAUSE_S = 8;

export interface Wire {
  binaryType: string;
  readyState: number;
  onopen: (() => void) | null;
  onclose: (() => void) | null;
  onmessage: ((event: { data: unknown }) => void) | null;
  send(text: string): void;
  close(): void;
}

/** What the socket needs of the browser; a test gives its own. */
export interface Outside {
  open(token: string): Wire;
  /** Whether the server says that the token is wrong. */
  refuses(token: string): Promise<boolean>;
  fetch(path: string, init: RequestInit): Promise<Response>;
  later(seconds: number, run: () => void): void;
  now(): number;
}

export interface Socket {
  start(token: string): void;
  request(verb: string, values: Record<string, string>, owner: string): string;
  send(message: ClientMessage): boolean;
  /** What is too long for a message: by HTTP, with the token. */
  fetch(path: string, init?: RequestInit): Promise<Response>;
}

export function pause(attempt: number): number {
  return Math.min(LONGEST_PAUSE_S, FIRST_PAUSE_S * 2 ** Math.max(0, attempt - 1));
}

/** One socket feeds the store. Whatever goes wrong with it ends in a new connection, which begins with a snapshot. */
export function createSocket(store: Store<State, Action>, outside: Outside): Socket {
  let wire: Wire | null = null;
  let token = "";
  let attempt = 0;
  let ids = 0;
  let run = 0;

  function connect(): void {
    const current = ++run;
    attempt++;
    store.dispatch({ type: "connection", connection: { phase: "connecting", attempt } });
    const opened = outside.open(token);
    wire = opened;
    opened.binaryType = "arraybuffer";
    opened.onmessage = (event) => {
      if (current === run) receive(event.data);
    };
    opened.onclose = () => {
      if (current === run) void closed(current);
    };
  }

  function receive(data: unknown): void {
    if (data instanceof ArrayBuffer) {
      const batch = decodeBatch(data);
      if (batch) store.dispatch({ type: "batch", batch });
      return;
    }
    const message = typeof data === "string" ? parseMessage(data) : null;
    if (!message) return;
    if (message.type === "snapshot") attempt = 0;
    store.dispatch({ type: "message", message, now: outside.now() });
    if (store.get().connection.phase === "gap") reconnect();
  }

  /** After a gap: at once, for the server is there. */
  function reconnect(): void {
    const old = wire;
    loseRequests();
    connect();
    old?.close();
  }

  async function closed(current: number): Promise<void> {
    loseRequests();
    const refused = await outside.refuses(token);
    if (current !== run) return;
    if (refused) return store.dispatch({ type: "connection", connection: { phase: "refused" } });
    const seconds = pause(attempt);
    store.dispatch({ type: "connection", connection: { phase: "waiting", attempt, seconds } });
    outside.later(seconds, () => {
      if (current === run) connect();
    });
  }

  function loseRequests(): void {
    for (const { id } of store.get().requests.filter((sent) => !sent.done)) lose(id);
  }

  function lose(id: string): void {
    const error = "The connection was lost before the answer came. Check whether it was done before you ask again.";
    store.dispatch({ type: "lost", id, error });
  }

  function send(message: ClientMessage): boolean {
    if (wire?.readyState !== 1) return false;
    wire.send(JSON.stringify(message));
    return true;
  }

  return {
    start(wanted) {
      token = wanted;
      attempt = 0;
      const old = wire;
      connect();
      old?.close();
    },
    request(verb, values, owner) {
      const id = `r${++ids}`;
      store.dispatch({ type: "sent", id, verb, values, owner });
      if (!send({ type: "request", id, verb, arguments: values })) {
        store.dispatch({ type: "lost", id, error: "Not connected: nothing was sent. Try again when connected." });
      }
      return id;
    },
    send,
    fetch: (path, init) => outside.fetch(path, { ...init, headers: { Authorization: `Bearer ${token}` } }),
  };
}

export function browserOutside(): Outside {
  return {
    open: (token) => {
      const scheme = window.location.protocol === "https:" ? "wss" : "ws";
      const address = `${scheme}://${window.location.host}/api/v1/socket`;
      return new WebSocket(address, ["berth.v1", `token.${token}`]) as unknown as Wire;
    },
    refuses: async (token) => {
      try {
        const answer = await fetch("/api/v1/snapshot", { headers: { Authorization: `Bearer ${token}` } });
        await answer.body?.cancel();
        return answer.status === 401 || answer.status === 403;
      } catch {
        return false;
      }
    },
    fetch: (path, init) => fetch(path, init),
    later: (seconds, run) => void setTimeout(run, seconds * 1000),
    now: () => performance.now() / 1000,
  };
}
