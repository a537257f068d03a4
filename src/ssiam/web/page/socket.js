/** The socket to the session: commands out, messages in, and open again after it broke. */

/** Code of commands that were not sent, or not answered before the connection broke. */
export const OFFLINE = "offline";

const FIRST_WAIT = 500; // milliseconds
const LONGEST_WAIT = 10_000;
const LARGEST_ASK = 2 ** 31;
const REFUSED =
  "The server does not let this page in: open the whole address that it printed, with its #token=, " +
  "or close another page of it.";
/** What the close codes of docs/live-protocol.md mean to people. */
const REASONS = new Map([
  [1001, "The session has ended."],
  [1008, "The server closed the connection: too many messages."],
  [1009, "The server closed the connection: a message was too large."],
  [1013, "The connection was too slow."],
]);

/** What a command that the server did not carry out is rejected with. */
export class CommandFailed extends Error {
  /** @param {string} code as in the protocol, or `OFFLINE` @param {string} message */
  constructor(code, message) {
    super(message);
    this.code = code;
  }
}

/** The token of the address, "" if there is none. */
export function token() {
  return new URLSearchParams(location.hash.slice(1)).get("token") ?? "";
}

/** `path` with the token as its query, where there is one. */
export function withToken(path) {
  return token() ? `${path}?token=${encodeURIComponent(token())}` : path;
}

/**
 * @typedef {object} Handlers
 * @property {(message: object) => void} message every text message but answers
 * @property {(buffer: ArrayBuffer) => void} binary
 * @property {(reason: string, wait: number) => void} lost with the milliseconds to the next try
 */

export class Socket {
  #handlers;
  #socket = null;
  #asks = new Map();
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

  /** Connect, at once; a connection that there is gets closed. */
  open() {
    clearTimeout(this.#timer);
    this.#socket?.close();
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}${withToken("/session")}`);
    socket.binaryType = "arraybuffer";
    let opened = false;
    socket.addEventListener("open", () => (opened = true));
    socket.addEventListener("message", ({ data }) => this.#take(socket, data));
    socket.addEventListener("close", ({ code }) => this.#closed(socket, opened, code));
    this.#socket = socket;
  }

  /** Send a message that has no answer; false if there is no connection. */
  send(message) {
    if (!this.connected) return false;
    this.#socket.send(message instanceof Blob ? message : JSON.stringify(message));
    return true;
  }

  /** Send a command; resolves to its answer, or rejects with a `CommandFailed`. */
  ask(command) {
    const ask = (this.#lastAsk = (this.#lastAsk % LARGEST_ASK) + 1);
    if (!this.send({ ...command, ask })) {
      return Promise.reject(new CommandFailed(OFFLINE, "Not connected."));
    }
    return new Promise((resolve, reject) => this.#asks.set(ask, { resolve, reject }));
  }

  #take(socket, data) {
    if (socket !== this.#socket) return;
    if (data instanceof ArrayBuffer) {
      this.#handlers.binary(data);
      return;
    }
    const message = JSON.parse(data);
    const asked = this.#asks.get(message.ask);
    this.#asks.delete(message.ask);
    if (message.type === "hello") this.#failures = 0;
    if (asked && message.type === "done") asked.resolve(message.answer);
    else if (asked) asked.reject(new CommandFailed(message.code, message.message));
    else this.#handlers.message(message);
  }

  async #closed(socket, opened, code) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    for (const { reject } of this.#asks.values()) {
      reject(new CommandFailed(OFFLINE, "The connection was lost."));
    }
    this.#asks.clear();
    const wait = Math.min(FIRST_WAIT * 2 ** this.#failures++, LONGEST_WAIT);
    this.#timer = setTimeout(() => this.open(), wait * (0.75 + Math.random() / 2));
    const reason = REASONS.get(code) ?? "The connection is lost.";
    this.#handlers.lost(reason, wait);
    // A browser does not tell a page why a socket did not open: a server that answers refused it.
    if (!opened && (await answers()) && !this.connected) this.#handlers.lost(REFUSED, wait);
  }
}

async function answers() {
  try {
    return (await fetch("/", { method: "HEAD", cache: "no-store" })).status < 500;
  } catch {
    return false;
  }
}
