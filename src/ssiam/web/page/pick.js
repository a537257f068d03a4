/** The page on which targets are chosen in a clip, before `ssiam track` tracks it. */

import { watchKeys } from "./controls.js";
import { StepDisplay } from "./display.js";
import { BoxDrawing } from "./drawing.js";
import { boxBetween, contains, cornersOf } from "./geometry.js";
import { KeyframeButtons, isRemovable, keyframeIn, marksOf, noteOf } from "./keyframes.js";
import { announce, banner, hint, toast } from "./notes.js";
import { SeekBar } from "./seekbar.js";
import { CommandError, OFFLINE, Socket, withToken } from "./socket.js";
import { readStep, targetAt } from "./steps.js";
import { TargetList } from "./targets.js";
import { Views } from "./views.js";

const MIN_SIDE = 2; // frame pixels of a box that is resized
const VIDEO = "video";
const IS_TOUCH = matchMedia("(hover: none) and (pointer: coarse)").matches;
const CLICK = IS_TOUCH ? "Tap" : "Click";
const FIRST_HINT = `${CLICK} what you want to track, or drag a box around it.`;

const byId = (id) => document.getElementById(id);

class PickPage {
  #hello = null;
  #state = { phase: "picking", length: null, targets: [], undo: false, progress: null, files: [], notes: [] };
  #selected = null;
  #changed = null; // {id, frame, box} of a box that is being moved or resized
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
  #keyframes = new KeyframeButtons({
    armed: () => this.#showHint(),
    absent: ({ id }, frame) => this.#command({ type: "absent", id, frame }),
    remove: ({ id }, frame) => this.#command({ type: "remove", id, frame }),
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
    byId("again").addEventListener("click", () => this.#command({ type: "correct" }));
    byId("finish").addEventListener("click", () => this.#finish());
    byId("video").addEventListener("error", () => this.#cannotPlay());
    document.addEventListener("keydown", (event) => this.#onUndoKey(event));
    watchKeys({
      ArrowLeft: () => byId("back").click(),
      ArrowRight: () => byId("forward").click(),
      " ": () => byId("preview").click(),
      p: () => byId("preview").click(),
      c: () => byId("correct").click(),
      a: () => byId("absent").click(),
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
    const targets = isTracked ? header.targets : this.#targetsIn(header);
    this.#showKeyframes();
    const marks = { stateOf: () => "tracking", selected: isTracked ? null : this.#selected };
    const step = { header: { ...header, targets }, bitmaps };
    this.#views.draw(step, (view) => this.#drawing.selectionIn(view), marks);
  }

  /** The targets that have a box in a frame, as they are drawn. */
  #boxesIn(index) {
    const changed = this.#changed;
    return this.#state.targets
      .filter((target) => keyframeIn(target, index)?.box)
      .map((target) => {
        const isChanged = changed?.id === target.id && changed.frame === index;
        const { box } = isChanged ? changed : keyframeIn(target, index);
        return { ...target, box, corners: null, score: null, lost: false };
      });
  }

  /** Those, and where the last run has tracked the others, as a guide. */
  #targetsIn(header) {
    const isGuide = ({ id }) => {
      const target = this.#state.targets.find((each) => each.id === id);
      return target && !keyframeIn(target, header.index);
    };
    const tracked = header.targets.filter(isGuide).map((target) => ({ ...target, guide: true }));
    return [...tracked, ...this.#boxesIn(header.index)];
  }

  /** The selected target, or null. */
  get #target() {
    return this.#state.targets.find(({ id }) => id === this.#selected) ?? null;
  }

  #showKeyframes() {
    const { shown } = this;
    const takesBoxes = this.#state.phase === "picking" && shown?.playing === "paused";
    this.#keyframes.update(this.#target, takesBoxes ? shown.index : null, this.#state.targets.length > 0);
    this.#showHint();
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
    byId("results").hidden = phase === "tracking" || !this.#state.notes.length;
    byId("results-title").textContent = phase === "written" ? "Written" : "Last run";
    byId("notes").replaceChildren(...this.#state.notes.map((note) => make("li", note)));
    byId("done").hidden = byId("files").hidden = phase !== "written";
    if (phase === "written" && before !== phase) this.#showResults();
    if (before === "written" && phase !== before) this.#hideResults();
    if (phase !== before) announce({ preview: "Preview.", tracking: "Tracking the clip.", written: "Written." }[phase] ?? "");
    this.#showHint();
  }

  #showHint() {
    const { phase, targets } = this.#state;
    const hints = { picking: targets.length ? this.#keyframeHint() : FIRST_HINT, preview: "Preview" };
    hint(this.#busy ? "Looking for the object …" : (hints[phase] ?? ""));
  }

  #keyframeHint() {
    const target = this.#target;
    if (!target) return "";
    if (this.#keyframes.armed !== null) return `${CLICK} ${target.name}, or drag a box around it.`;
    const isAbsent = keyframeIn(target, this.shown?.index)?.box === null;
    return isAbsent ? `From here to its next keyframe, ${target.name} is absent.` : "";
  }

  #showTargets() {
    const { fps } = this.#hello;
    const isPicking = this.#state.phase === "picking" || this.#state.phase === "preview";
    byId("targets").inert = !isPicking;
    const rows = this.#state.targets.map((target) => ({ ...target, score: null, note: noteOf(target, fps) }));
    this.#targets.update(rows, () => "tracking", () => "", this.#selected);
    this.#seekBar.mark(marksOf(this.#state.targets));
    this.#showKeyframes();
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
    const { files } = this.#state;
    byId("files").replaceChildren(...files.map(fileItem));
    const video = files.find(({ kind }) => kind === VIDEO);
    if (video) byId("video").src = urlOf(video.name);
    this.#showVideo(Boolean(video));
    document.title = "written – ssiam track";
    byId("results").scrollIntoView({ block: "nearest" });
  }

  /** The targets are corrected, with the notes of the run beside them. */
  #hideResults() {
    byId("video").removeAttribute("src");
    byId("video").load();
    byId("not-played").hidden = true;
    this.#showVideo(false);
    document.title = `${byId("source").textContent} – ssiam track`;
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

  /** Add a target, or a keyframe of the selected one. */
  async #add(command) {
    const { armed } = this.#keyframes;
    this.#keyframes.disarm();
    const id = await this.#command(armed === null ? command : { ...command, id: armed });
    if (id !== undefined) this.#select(id);
  }

  async #click(point, header) {
    const target = targetAt(this.#targetsIn(header), point);
    if (target && this.#keyframes.armed === null) {
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
    const target = this.#target;
    const keyframe = target && keyframeIn(target, shown.index);
    if (!keyframe?.box || this.#keyframes.armed !== null || shown.playing === "playing") return null;
    const { frame, box } = keyframe;
    const corners = cornersOf(box);
    const distances = corners.map(([x, y]) => Math.hypot(x - point[0], y - point[1]));
    const nearest = distances.indexOf(Math.min(...distances));
    const [left, top, width, height] = box;
    const fromCenter = Math.hypot(left + width / 2 - point[0], top + height / 2 - point[1]);
    // A small box under a finger is moved from its center.
    if (distances[nearest] <= Math.min(slack, contains(box, point) ? fromCenter : Infinity)) {
      const fixed = corners[(nearest + 2) % 4];
      return this.#grip(target.id, frame, (to) => boxBetween(fixed, to));
    }
    if (!contains(box, point)) return null;
    const moved = (to) => [left + to[0] - point[0], top + to[1] - point[1], width, height];
    return this.#grip(target.id, frame, moved);
  }

  #grip(id, frame, boxAt) {
    const show = (changed) => {
      this.#changed = changed;
      this.#display.redraw();
    };
    return {
      move: (to) => {
        const box = boxAt(to);
        if (Math.min(box[2], box[3]) >= MIN_SIDE) show({ id, frame, box });
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
    if (seek && target && !keyframeIn(target, this.shown?.index)) this.#seekBar.to(target.frame);
    this.#showTargets();
    this.#display.redraw();
  }

  #removeSelected() {
    const target = this.#target;
    if (!target) return;
    const here = keyframeIn(target, this.shown?.index);
    const part = here && isRemovable(target, here) ? { frame: here.frame } : {};
    this.#command({ type: "remove", id: target.id, ...part });
  }

  #escape() {
    this.#drawing.cancel();
    if (this.#keyframes.armed !== null) {
      this.#keyframes.disarm();
      return;
    }
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
