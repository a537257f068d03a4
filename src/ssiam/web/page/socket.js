/** The WebSocket to the session: sends commands, receives messages, reconnects. */

/** Code of commands that were not sent, or not answered before the connection was lost. */
export const OFFLINE = "offline";

const FIRST_WAIT = 500; // milliseconds
const MAX_WAIT = 10_000;
const MAX_ASK = 2 ** 31;
const REFUSED =
  "The server refused the connection. Open the complete address that it printed, including " +
  "#token=, or close another page of this session.";
/** Texts for the close codes of docs/reference/live-protocol.md. */
const REASONS = new Map([
  [1001, "The session has ended."],
  [1008, "The server closed the connection: too many messages."],
  [1009, "The server closed the connection: a message was too large."],
  [1013, "The connection was too slow."],
]);

/** The error of a command that failed. */
export class CommandError extends Error {
  /** @param {string} code as in the protocol, or `OFFLINE` @param {string} message */
  constructor(code, message) {
    super(message);
    this.code = code;
  }
}

/** The token in the page's address, or "". */
export function token() {
  return new URLSearchParams(location.hash.slice(1)).get("token") ?? "";
}

/** `path` with the token in its query, if there is one. */
export function withToken(path) {
  return token() ? `${path}?token=${encodeURIComponent(token())}` : path;
}

/**
 * @typedef {object} Handlers
 * @property {(message: object) => void} message all text messages except answers
 * @property {(buffer: ArrayBuffer) => void} binary
 * @property {(reason: string, wait: number) => void} lost with the milliseconds until the next attempt
 */

export class Socket {
  #handlers;
  #socket = null;
  #pending = new Map();
  #lastAsk = 0;
  #failures = 0;
  #timer = 0;

  /** @param {Handlers} handlers */
  constructor(handlers) {
    this.#handlers = handlers;
  }

  get connected() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Connect now; an existing connection is closed. */
  open() {
    clearTimeout(this.#timer);
    this.#socket?.close();
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}${withToken("/session")}`);
    socket.binaryType = "arraybuffer";
    let opened = false;
    socket.addEventListener("open", () => (opened = true));
    socket.addEventListener("message", ({ data }) => this.#receive(socket, data));
    socket.addEventListener("close", ({ code }) => this.#closed(socket, opened, code));
    this.#socket = socket;
  }

  /** Disconnect, and do not connect again. */
  close() {
    clearTimeout(this.#timer);
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }

  /** Send a message without an answer; false if there is no connection. */
  send(message) {
    if (!this.connected) return false;
    this.#socket.send(message instanceof Blob ? message : JSON.stringify(message));
    return true;
  }

  /** Send a command; resolves to its result, or rejects with a `CommandError`. */
  ask(command) {
    const ask = (this.#lastAsk = (this.#lastAsk % MAX_ASK) + 1);
    if (!this.send({ ...command, ask })) {
      return Promise.reject(new CommandError(OFFLINE, "Not connected."));
    }
    return new Promise((resolve, reject) => this.#pending.set(ask, { resolve, reject }));
  }

  #receive(socket, data) {
    if (socket !== this.#socket) return;
    if (data instanceof ArrayBuffer) {
      this.#handlers.binary(data);
      return;
    }
    const message = JSON.parse(data);
    const pending = this.#pending.get(message.ask);
    this.#pending.delete(message.ask);
    if (message.type === "hello") this.#failures = 0;
    if (pending && message.type === "done") pending.resolve(message.answer);
    else if (pending) pending.reject(new CommandError(message.code, message.message));
    else this.#handlers.message(message);
  }

  async #closed(socket, opened, code) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    for (const { reject } of this.#pending.values()) {
      reject(new CommandError(OFFLINE, "The connection was lost."));
    }
    this.#pending.clear();
    const wait = Math.min(FIRST_WAIT * 2 ** this.#failures++, MAX_WAIT);
    this.#timer = setTimeout(() => this.open(), wait * (0.75 + Math.random() / 2));
    const reason = REASONS.get(code) ?? "The connection was lost.";
    this.#handlers.lost(reason, wait);
    // Browsers do not report why a socket did not open. If the server responds, it has refused it.
    if (!opened && (await isServerUp()) && !this.connected) this.#handlers.lost(REFUSED, wait);
  }
}

async function isServerUp() {
  try {
    return (await fetch("/", { method: "HEAD", cache: "no-store" })).status < 500;
  } catch {
    return false;
  }
}
