/** The page on which targets are chosen in a clip, before `ssiam track` tracks it. */

import { watchKeys } from "./controls.js";
import { StepDisplay } from "./display.js";
import { BoxDrawing } from "./drawing.js";
import { boxBetween, contains, cornersOf } from "./geometry.js";
import { announce, banner, hint, toast } from "./notes.js";
import { SeekBar } from "./seekbar.js";
import { CommandError, OFFLINE, Socket, withToken } from "./socket.js";
import { readStep, targetAt } from "./steps.js";
import { TargetList } from "./targets.js";
import { Views } from "./views.js";

const MIN_SIDE = 2; // frame pixels of a box that is resized
const VIDEO = "video";
const IS_TOUCH = matchMedia("(hover: none) and (pointer: coarse)").matches;
const FIRST_HINT = `${IS_TOUCH ? "Tap" : "Click"} what you want to track, or drag a box around it.`;

const byId = (id) => document.getElementById(id);

class PickPage {
  #hello = null;
  #state = { phase: "picking", length: null, targets: [], undo: false, progress: null, files: [], notes: [] };
  #selected = null;
  #changed = null; // {id, box} of a box that is being moved or resized
  #busy = false; // a box is being proposed
  #ended = false;
  #socket = new Socket({
    message: (message) => this.#message(message),
    binary: (buffer) => this.#step(buffer),
    lost: (reason, wait) => this.#lost(reason, wait),
  });
  #display = new StepDisplay({
    draw: (step) => this.#draw(step),
    acknowledge: (number) => this.#socket.send({ type: "shown", number }),
    failed: () => toast("warning", "A frame could not be decoded."),
  });
  #views = new Views((message) => this.#socket.send(message), () => this.#display.redraw());
  #drawing = new BoxDrawing(this.#views.all, {
    begin: () => this.#beginStroke(),
    hold: () => {},
    changed: () => this.#display.redraw(),
    end: () => this.#display.unfreeze(),
    drawn: (box, { index }) => this.#add({ type: "add", frame: index, box }),
    clicked: (point, header) => this.#click(point, header),
    grab: (point, slack) => this.#grab(point, slack),
  });
  #targets = new TargetList(byId("targets"), byId("no-targets"), {
    select: (id) => this.#select(id, true),
    remove: (id) => this.#command({ type: "remove", id }),
  });
  #seekBar = new SeekBar(byId("seek"), (index) => this.#command({ type: "seek", index }));

  /** Header of the frame that is shown, or null. */
  get shown() {
    return this.#display.shown?.header ?? null;
  }

  get state() {
    return this.#state;
  }

  get selected() {
    return this.#selected;
  }

  start() {
    document.documentElement.dataset.views = "raw";
    byId("banner-button").addEventListener("click", () => this.#socket.open());
    byId("back").addEventListener("click", () => this.#seekBar.to(this.#seekBar.index - 1));
    byId("forward").addEventListener("click", () => this.#seekBar.to(this.#seekBar.index + 1));
    byId("undo").addEventListener("click", () => this.#command({ type: "undo" }));
    byId("preview").addEventListener("click", () => this.#preview());
    byId("track").addEventListener("click", () => this.#command({ type: "track" }));
    byId("finish").addEventListener("click", () => this.#finish());
    byId("video").addEventListener("error", () => this.#cannotPlay());
    document.addEventListener("keydown", (event) => this.#onUndoKey(event));
    watchKeys({
      ArrowLeft: () => byId("back").click(),
      ArrowRight: () => byId("forward").click(),
      " ": () => byId("preview").click(),
      p: () => byId("preview").click(),
      Delete: () => this.#removeSelected(),
      Backspace: () => this.#removeSelected(),
      Escape: () => this.#escape(),
    });
    this.#socket.open();
  }

  #message(message) {
    if (message.type === "hello") this.#begin(message);
    else if (message.type === "picking") this.#setState(message);
    else if (message.type === "error") toast("error", message.message);
  }

  #begin(hello) {
    this.#hello = hello;
    this.#display.clear();
    const short = hello.source.split("/").at(-1);
    byId("source").textContent = short;
    byId("source").title = hello.source;
    document.title = `${short} – ssiam track`;
    this.#views.begin(hello.size);
    this.#seekBar.begin(hello.length, hello.fps);
    banner(null);
  }

  #lost(reason, wait) {
    this.#drawing.cancel();
    if (this.#ended) return;
    banner(`${reason} Reconnecting in ${(wait / 1000).toFixed(wait < 1000 ? 1 : 0)} s.`);
  }

  #setState(state) {
    const before = this.#state;
    this.#state = state;
    if (!state.targets.some(({ id }) => id === this.#selected)) this.#selected = null;
    if (state.length !== before.length) this.#seekBar.begin(state.length, this.#hello.fps);
    this.#showPhase(before.phase);
    this.#showTargets();
    this.#display.redraw();
  }

  #step(buffer) {
    const { header, jpegs } = readStep(buffer);
    this.#seekBar.show(header.index, header.time);
    this.#display.receive(header, jpegs);
  }

  #draw({ header, bitmaps }) {
    const isTracked = header.playing === "playing";
    const targets = isTracked ? header.targets : this.#startsIn(header.index);
    const marks = { stateOf: () => "tracking", selected: isTracked ? null : this.#selected };
    const step = { header: { ...header, targets }, bitmaps };
    this.#views.draw(step, (view) => this.#drawing.selectionIn(view), marks);
  }

  /** The targets that begin in a frame, as they are drawn. */
  #startsIn(index) {
    return this.#state.targets
      .filter(({ frame }) => frame === index)
      .map((target) => {
        const box = this.#changed?.id === target.id ? this.#changed.box : target.box;
        return { ...target, box, corners: null, score: null, lost: false };
      });
  }

  #showPhase(before) {
    const { phase, targets, undo, progress } = this.#state;
    const isPicking = phase === "picking" || phase === "preview";
    byId("picking").hidden = !isPicking;
    byId("steps").hidden = !isPicking;
    byId("running").hidden = phase !== "tracking";
    byId("undo").disabled = !undo;
    byId("track").disabled = byId("preview").disabled = targets.length === 0;
    byId("preview").textContent = phase === "preview" ? "Stop" : "Preview";
    if (phase === "tracking") this.#showProgress(progress);
    if (phase === "written" && byId("results").hidden) this.#showResults();
    if (phase !== before) announce({ preview: "Preview.", tracking: "Tracking the clip.", written: "Written." }[phase] ?? "");
    this.#showHint();
  }

  #showHint() {
    const { phase, targets } = this.#state;
    const hints = { picking: targets.length ? "" : FIRST_HINT, preview: "Preview" };
    hint(this.#busy ? "Looking for the object …" : (hints[phase] ?? ""));
  }

  #showTargets() {
    const { fps } = this.#hello;
    const isPicking = this.#state.phase === "picking" || this.#state.phase === "preview";
    byId("targets").inert = !isPicking;
    const rows = this.#state.targets.map((target) => {
      const seconds = fps ? ` · ${(target.frame / fps).toFixed(1)} s` : "";
      return { ...target, score: null, note: `from frame ${target.frame}${seconds}` };
    });
    this.#targets.update(rows, () => "tracking", () => "", this.#selected);
    this.#seekBar.mark(this.#state.targets.map(({ frame, colour: color }) => ({ index: frame, color })));
  }

  #showProgress(progress) {
    const { done = 0, total = null, fps = null } = progress ?? {};
    const bar = byId("progress");
    if (total) Object.assign(bar, { max: total, value: done });
    else bar.removeAttribute("value");
    const share = total ? `${Math.floor((100 * done) / total)} %` : "";
    const left = total && fps ? ` · ${Math.ceil((total - done) / fps)} s left` : "";
    const count = `${done}${total ? ` of ${total}` : ""} frames`;
    byId("progress-text").textContent = `Tracking: ${count}${fps ? ` · ${fps.toFixed(0)} fps` : ""}${left}`;
    document.title = `${share || "tracking"} – ssiam track`;
  }

  #showResults() {
    const { files, notes } = this.#state;
    byId("results").hidden = false;
    byId("files").replaceChildren(...files.map(fileItem));
    byId("notes").replaceChildren(...notes.map((note) => make("li", note)));
    const video = files.find(({ kind }) => kind === VIDEO);
    if (video) byId("video").src = urlOf(video.name);
    this.#showVideo(Boolean(video));
    document.title = "written – ssiam track";
    byId("results").scrollIntoView({ block: "nearest" });
  }

  #showVideo(isShown) {
    byId("video").hidden = !isShown;
    for (const { figure } of this.#views.all) figure.hidden = isShown;
  }

  #cannotPlay() {
    if (!byId("video").hasAttribute("src")) return;
    this.#showVideo(false);
    byId("not-played").hidden = false;
  }

  /** Send a command; resolves to undefined if it failed, which a note or the banner shows. */
  async #command(command) {
    try {
      return await this.#socket.ask(command);
    } catch (error) {
      if (!(error instanceof CommandError)) throw error;
      if (error.code !== OFFLINE) toast("error", error.message);
      return undefined;
    }
  }

  #beginStroke() {
    const header = this.shown;
    if (!this.#socket.connected || !header || this.#busy) return null;
    if (this.#state.phase === "preview") this.#command({ type: "seek", index: header.index });
    if (this.#state.phase !== "picking") return null;
    this.#display.freeze();
    return header;
  }

  async #add(command) {
    const id = await this.#command(command);
    if (id !== undefined) this.#select(id);
  }

  async #click(point, header) {
    const target = targetAt(this.#startsIn(header.index), point);
    if (target) {
      this.#select(target.id);
      return;
    }
    this.#setBusy(true);
    await this.#add({ type: "click", frame: header.index, point });
    this.#setBusy(false);
  }

  #setBusy(busy) {
    this.#busy = busy;
    document.documentElement.toggleAttribute("data-busy", busy);
    this.#showHint();
  }

  /** The corner of the selected box at a point, or the box. */
  #grab(point, slack) {
    const { shown } = this;
    const target = this.#state.targets.find(({ id }) => id === this.#selected);
    if (!target || target.frame !== shown.index || shown.playing === "playing") return null;
    const corners = cornersOf(target.box);
    const distances = corners.map(([x, y]) => Math.hypot(x - point[0], y - point[1]));
    const nearest = distances.indexOf(Math.min(...distances));
    const [left, top, width, height] = target.box;
    const fromCenter = Math.hypot(left + width / 2 - point[0], top + height / 2 - point[1]);
    // A small box under a finger is moved from its center.
    if (distances[nearest] <= Math.min(slack, contains(target.box, point) ? fromCenter : Infinity)) {
      const fixed = corners[(nearest + 2) % 4];
      return this.#grip(target, (to) => boxBetween(fixed, to));
    }
    if (!contains(target.box, point)) return null;
    const moved = (to) => [left + to[0] - point[0], top + to[1] - point[1], width, height];
    return this.#grip(target, moved);
  }

  #grip({ id }, boxAt) {
    const show = (changed) => {
      this.#changed = changed;
      this.#display.redraw();
    };
    return {
      move: (to) => {
        const box = boxAt(to);
        if (Math.min(box[2], box[3]) >= MIN_SIDE) show({ id, box });
      },
      drop: async () => {
        const changed = this.#changed;
        if (changed) await this.#command({ type: "adjust", ...changed });
        // The next stroke may have begun before the answer came.
        if (this.#changed === changed) show(null);
      },
      cancel: () => show(null),
    };
  }

  #preview() {
    const isRunning = this.#state.phase === "preview";
    if (isRunning) this.#command({ type: "seek", index: this.shown.index });
    else this.#command({ type: "preview", ...(this.#selected === null ? {} : { id: this.#selected }) });
  }

  #select(id, seek = false) {
    this.#selected = id;
    const target = this.#state.targets.find((each) => each.id === id);
    if (seek && target && target.frame !== this.shown?.index) this.#seekBar.to(target.frame);
    this.#showTargets();
    this.#display.redraw();
  }

  #removeSelected() {
    if (this.#selected !== null) this.#command({ type: "remove", id: this.#selected });
  }

  #escape() {
    this.#drawing.cancel();
    this.#selected = null;
    this.#showTargets();
    this.#display.redraw();
  }

  #onUndoKey(event) {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.shiftKey) return;
    event.preventDefault();
    byId("undo").click();
  }

  async #finish() {
    this.#ended = true; // the server may end before it answers
    await this.#command({ type: "finish" });
    this.#socket.close();
    byId("finish").disabled = true;
    byId("finish").textContent = "Done: this page can be closed";
  }
}

function fileItem({ kind, name, bytes }) {
  const item = document.createElement("li");
  const link = make("a", name);
  link.href = urlOf(name);
  link.download = name;
  const size = bytes >= 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : `${Math.ceil(bytes / 1e3)} kB`;
  const note = make("span", `${kind} · ${size}`);
  note.className = "muted";
  item.append(link, note);
  return item;
}

function urlOf(name) {
  return withToken(`/written/${encodeURIComponent(name)}`);
}

function make(tag, textContent) {
  return Object.assign(document.createElement(tag), { textContent });
}

/**
 * Define `window.ssiamPick` for tests and scripts, read-only: `step`, the header of the shown frame
 * or null; `state`, the last state of the session; `selected`, the id of the selected target.
 * @param {PickPage} page
 */
function expose(page) {
  const state = {
    get step() {
      return structuredClone(page.shown);
    },
    get state() {
      return structuredClone(page.state);
    },
    get selected() {
      return page.selected;
    },
  };
  Object.defineProperty(window, "ssiamPick", { value: Object.freeze(state) });
}

const page = new PickPage();
page.start();
expose(page);
