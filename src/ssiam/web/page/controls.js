/** Buttons and keys: pause, step, restart, record, stabilization; the statistics below the view. */

const DISCONNECTED = "disconnected";
const RESTART_TITLE = "Play from the beginning (r)";
const REQUEST_TIMEOUT = 500; // milliseconds after which the session's method is shown again

const byId = (id) => document.getElementById(id);

/**
 * @typedef {object} Handlers
 * @property {(command: object) => Promise<unknown>} command
 * @property {(sideBySide: boolean) => void} layout which views to show
 */

export class Controls {
  #newest = null; // header of the newest step
  #requestedMethod = null;
  #camera = "stabilized"; // virtual camera of the newest step
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
    byId("methods").addEventListener("change", ({ target }) => this.#setMethod(target.value));
    byId("locked").addEventListener("change", ({ target }) => this.#setCamera(target.checked));
  }

  /** Press a button. */
  press(id) {
    byId(id).click();
  }

  /** Choose the stabilization method with this index. */
  pressMethod(index) {
    byId("methods").querySelectorAll("input")[index]?.click();
  }

  /** Start a session. */
  begin({ source, methods, seekable, length }) {
    const short = source.includes("://") ? source : source.split("/").at(-1);
    byId("source").textContent = short;
    byId("source").title = source;
    document.title = `${short} – ssiam live`;
    byId("methods").querySelectorAll("label").forEach((label) => label.remove());
    methods.forEach((method, index) => byId("methods").append(radioButton(method, index)));
    byId("record").disabled = false;
    byId("seek").hidden = !seekable || length === null;
    byId("restart").disabled = !seekable;
    byId("restart").title = seekable ? RESTART_TITLE : "This source cannot be restarted";
  }

  /** Disable the controls: the connection is lost. */
  end() {
    this.#newest = null;
    for (const id of ["record", "restart"]) byId(id).disabled = true;
    this.#showPlayback(DISCONNECTED);
  }

  /** Set the newest step's header, on which the next press of a button depends. */
  setStep(header) {
    this.#newest = header;
  }

  /** Show whether tracking has stalled or failed, until the state changes. */
  showHealth(state) {
    this.#health = state;
    this.#showPlayback(this.#newest?.playing ?? "connecting");
  }

  /** Show the newest step's state. */
  update() {
    const header = this.#newest;
    if (!header) return;
    this.#showPlayback(header.playing);
    this.#showRecording(header.recording);
    if (this.#requestedMethod === null || this.#requestedMethod === header.stabilize) {
      this.#checkMethod(header.stabilize);
    }
    if (header.camera !== this.#camera) {
      this.#camera = header.camera;
      byId("locked").checked = header.camera === "locked";
    }
    const { index, time } = header;
    const texts = {
      latency: `${(header.latency * 1000).toFixed(0)} ms`,
      fps: header.fps.toFixed(1),
      frame: time === null ? String(index) : `${index} · ${time.toFixed(1)} s`,
    };
    for (const field of document.querySelectorAll("[data-stat]")) {
      const name = field.dataset.stat;
      field.textContent = texts[name] ?? String(header[name]);
    }
  }

  #showPlayback(playback) {
    const isHealthy = this.#health === "running" || playback === DISCONNECTED;
    const word = isHealthy ? playback : this.#health;
    byId("playing").textContent = byId("playing").dataset.playing = word;
    const isPaused = playback === "paused";
    byId("pause").dataset.paused = isPaused;
    const isOver = playback === "ended" || playback === DISCONNECTED;
    for (const id of ["pause", "advance"]) byId(id).disabled = isOver;
    byId("pause").querySelector("span").textContent = isPaused ? "Resume" : "Pause";
  }

  #showRecording(name) {
    byId("rec").hidden = name === null;
    byId("rec").title = name === null ? "" : `Recording ${name}`;
    byId("record").setAttribute("aria-pressed", String(name !== null));
    byId("record").querySelector("span").textContent = name === null ? "Record" : "Stop recording";
  }

  #setCamera(isLocked) {
    this.#handlers.command({ type: "camera", camera: isLocked ? "locked" : "stabilized" });
    if (isLocked && !byId("side-by-side").checked) byId("side-by-side").click();
  }

  async #setMethod(method) {
    this.#requestedMethod = method;
    await this.#handlers.command({ type: "steady", method });
    // The answer arrives before the first step with the new method.
    setTimeout(() => this.#forgetRequest(method), REQUEST_TIMEOUT);
  }

  #forgetRequest(method) {
    if (this.#requestedMethod === method) this.#requestedMethod = null;
  }

  #checkMethod(method) {
    for (const input of byId("methods").querySelectorAll("input")) {
      if (input.value === method && !input.checked) input.checked = true;
    }
  }
}

function radioButton(method, index) {
  const label = document.createElement("label");
  const input = document.createElement("input");
  Object.assign(input, { type: "radio", name: "method", value: method });
  input.setAttribute("aria-keyshortcuts", String(index + 1));
  label.append(input, method);
  return label;
}

/**
 * Handle the keys of the page wherever the focus is, except those that a focused field handles.
 * A focused button is pressed by Enter.
 * @param {Record<string, () => void>} actions by key
 */
export function watchKeys(actions) {
  const help = byId("help");
  const openHelp = () => help.showModal();
  byId("help-button").addEventListener("click", openHelp);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || help.open) return;
    if (belongsToFocus(event)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = { ...actions, "?": openHelp }[key];
    if (!action) return;
    event.preventDefault();
    action();
  });
  // A button takes the space bar when it is released.
  document.addEventListener("keyup", (event) => {
    if (event.key === " " && !help.open && !belongsToFocus(event)) event.preventDefault();
  });
}

/** Whether the focused element handles the key: a name is typed, a bar moved, a player paused. */
function belongsToFocus({ key, target }) {
  if (target.matches("input[type=text]:not([readonly]), video")) return true;
  return target.matches("input[type=range], input[type=radio]") && key.startsWith("Arrow");
}
