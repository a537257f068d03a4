/** Pause, step, restart, record; steadying; the readings. */

const DISCONNECTED = "disconnected";
const AGAIN = "From the beginning (r)";
const SETTLED = 500; // milliseconds after which the session has its say again

const byId = (id) => document.getElementById(id);

/**
 * @typedef {object} Handlers
 * @property {(command: object) => Promise<unknown>} command
 * @property {(sideBySide: boolean) => void} layout which views are to be seen
 */

export class Controls {
  #newest = null; // header of the newest step
  #asked = null;
  #health = "running";
  #handlers;

  /** @param {Handlers} handlers */
  constructor(handlers) {
    this.#handlers = handlers;
    const { command } = handlers;
    byId("pause").addEventListener("click", () => {
      command({ type: this.#newest?.playing === "paused" ? "resume" : "pause" });
    });
    byId("advance").addEventListener("click", () => command({ type: "advance" }));
    byId("restart").addEventListener("click", () => command({ type: "restart" }));
    byId("record").addEventListener("click", () => {
      command({ type: "record", on: !this.#newest?.recording });
    });
    byId("side-by-side").addEventListener("change", ({ target }) => {
      handlers.layout(target.checked);
    });
    byId("methods").addEventListener("change", ({ target }) => this.#steady(target.value));
  }

  /** Press a button, or turn to a method, as if by hand. */
  press(id) {
    byId(id).click();
  }

  pressMethod(place) {
    byId("methods").querySelectorAll("input")[place]?.click();
  }

  /** A session begins: what can be done with it. */
  begin({ source, methods, seekable }) {
    const short = source.includes("://") ? source : source.split("/").at(-1);
    byId("source").textContent = short;
    byId("source").title = source;
    document.title = `${short} – ssiam live`;
    byId("methods").querySelectorAll("label").forEach((label) => label.remove());
    methods.forEach((method, place) => byId("methods").append(radio(method, place)));
    byId("record").disabled = false;
    byId("restart").disabled = !seekable;
    byId("restart").title = seekable ? AGAIN : "This source cannot be started again";
  }

  /** There is no connection. */
  end() {
    this.#newest = null;
    for (const id of ["record", "restart"]) byId(id).disabled = true;
    this.#showPlaying(DISCONNECTED);
  }

  /** Take the header of the newest step in, from which the next press of a button goes. */
  see(header) {
    this.#newest = header;
  }

  /** Show that tracking stands still or has ended, which outlasts every step. */
  showHealth(state) {
    this.#health = state;
    this.#showPlaying(this.#newest?.playing ?? "connecting");
  }

  /** Show what was seen last. */
  show() {
    const header = this.#newest;
    if (!header) return;
    this.#showPlaying(header.playing);
    this.#showRecording(header.recording);
    if (this.#asked === null || this.#asked === header.stabilize) this.#check(header.stabilize);
    const texts = {
      latency: `${(header.latency * 1000).toFixed(0)} ms`,
      fps: header.fps.toFixed(1),
      frame: header.time === null ? String(header.index) : `${header.index} · ${header.time.toFixed(1)} s`,
    };
    for (const field of document.querySelectorAll("[data-reading]")) {
      const name = field.dataset.reading;
      field.textContent = texts[name] ?? String(header[name]);
    }
  }

  #showPlaying(playing) {
    const word = this.#health === "running" || playing === DISCONNECTED ? playing : this.#health;
    byId("playing").textContent = byId("playing").dataset.playing = word;
    const paused = playing === "paused";
    byId("pause").dataset.paused = paused;
    const still = playing === "ended" || playing === DISCONNECTED;
    for (const id of ["pause", "advance"]) byId(id).disabled = still;
    byId("pause").querySelector("span").textContent = paused ? "Resume" : "Pause";
  }

  #showRecording(name) {
    byId("rec").hidden = name === null;
    byId("rec").title = name === null ? "" : `Recording ${name}`;
    byId("record").setAttribute("aria-pressed", String(name !== null));
    byId("record").querySelector("span").textContent = name === null ? "Record" : "Stop recording";
  }

  async #steady(method) {
    this.#asked = method;
    await this.#handlers.command({ type: "steady", method });
    // The answer comes before the first step that is steadied so.
    setTimeout(() => this.#forget(method), SETTLED);
  }

  #forget(method) {
    if (this.#asked === method) this.#asked = null;
  }

  #check(method) {
    for (const input of byId("methods").querySelectorAll("input")) {
      if (input.value === method && !input.checked) input.checked = true;
    }
  }
}

function radio(method, place) {
  const label = document.createElement("label");
  const input = document.createElement("input");
  Object.assign(input, { type: "radio", name: "method", value: method });
  input.setAttribute("aria-keyshortcuts", String(place + 1));
  label.append(input, method);
  return label;
}

