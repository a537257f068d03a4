/** The page of a live session: connects the WebSocket, the views, the panels and the controls. */

import { Controls, watchKeys } from "./controls.js";
import { StepDisplay } from "./display.js";
import { BoxDrawing } from "./drawing.js";
import { announce, banner, hint, toast } from "./notes.js";
import { Charts } from "./plots.js";
import { Recordings } from "./recordings.js";
import { SeekBar } from "./seekbar.js";
import { CommandError, OFFLINE, Socket } from "./socket.js";
import { readStep, summary, targetAt, TargetStates, throttle } from "./steps.js";
import { TargetList } from "./targets.js";
import { Views } from "./views.js";
import { CameraButton } from "./webcam.js";

const PROTOCOL = 1;
const FOUND_REDRAW = 1050; // milliseconds after which FOUND is no longer drawn
const DRAW_HINT = "Drag to draw a box around a target.";
const START_HINT = "Drag to draw a box around a target, then press Resume.";

const byId = (id) => document.getElementById(id);

class LivePage {
  #newest = null; // header of the newest step, shown or not
  #selected = null;
  #states = new TargetStates();
  #health = { state: "running", message: "" };
  #charts = new Charts();
  #stateOf = (target) => this.#states.of(target, performance.now());
  #errorOf = (target) => this.#states.errorOf(target, performance.now());
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
    hold: ({ number }) => this.#socket.send({ type: "hold", number }),
    changed: () => this.#display.redraw(),
    end: () => this.#display.unfreeze(),
    drawn: (box, { number }) => this.#addTarget(box, number),
    clicked: (point, header) => this.#click(point, header),
  });
  #targets = new TargetList(byId("targets"), byId("no-targets"), {
    select: (id) => this.#select(id),
    rename: (id, name) => this.#command({ type: "rename", id, name }),
    remove: (id) => this.#command({ type: "remove", id }),
  });
  #controls = new Controls({
    command: (command) => this.#command(command),
    layout: (sideBySide) => this.#views.show(sideBySide),
  });
  #seekBar = new SeekBar(byId("seek"), (index) => this.#command({ type: "seek", index }));
  #recordings = new Recordings((message) => toast("error", message));
  #camera = new CameraButton(
    (jpeg) => this.#socket.send(jpeg),
    (message) => toast("error", message),
  );
  #refreshPanels = throttle(() => this.#showPanels(), 100);
  #describe = throttle(() => this.#showSummary(), 1000);

  /** Header of the step that is shown, or null. */
  get shown() {
    return this.#display.shown?.header ?? null;
  }

  get frozen() {
    return this.#display.frozen;
  }

  start() {
    byId("banner-button").addEventListener("click", () => this.#socket.open());
    addEventListener("hashchange", () => this.#socket.open());
    watchKeys({
      " ": () => this.#controls.press("pause"),
      ".": () => this.#controls.press("advance"),
      r: () => this.#controls.press("restart"),
      s: () => this.#controls.press("side-by-side"),
      l: () => this.#controls.press("locked"),
      e: () => this.#controls.press("record"),
      1: () => this.#controls.pressMethod(0),
      2: () => this.#controls.pressMethod(1),
      3: () => this.#controls.pressMethod(2),
      Delete: () => this.#removeSelected(),
      Backspace: () => this.#removeSelected(),
      Escape: () => this.#drawing.cancel(),
    });
    this.#socket.open();
  }

  #message(message) {
    if (message.type === "hello") this.#begin(message);
    else if (message.type === "recordings") this.#recordings.update(message.recordings);
    else if (message.type === "health") this.#showHealth(message);
    else if (message.type === "note") toast(message.level, message.message);
    else if (message.type === "error") toast("error", message.message);
  }

  #begin(hello) {
    this.#newest = null;
    for (const part of [this.#display, this.#states, this.#charts]) part.clear();
    this.#controls.begin(hello);
    this.#seekBar.begin(hello.length, hello.fps);
    this.#views.begin(hello.size);
    this.#camera.offer(hello.webcam);
    this.#showHealth({ state: "running", message: "" });
    hint(hello.webcam ? "Waiting for a camera." : "Waiting for the first frame.");
    if (hello.protocol !== PROTOCOL) toast("warning", "This page is from another version of ssiam: reload it.");
  }

  #lost(reason, wait) {
    this.#drawing.cancel();
    this.#controls.end();
    this.#newest = null;
    // The cause of a failure is more useful than the loss of the connection.
    const text = this.#health.state === "failed" ? `${this.#health.message}.` : reason;
    banner(`${text} Reconnecting in ${(wait / 1000).toFixed(wait < 1000 ? 1 : 0)} s.`);
  }

  /** Show whether targets are tracked, until the state changes or a new session starts. */
  #showHealth({ state, message }) {
    this.#health = { state, message };
    this.#controls.showHealth(state);
    banner(state === "running" ? null : `${message}.`, { retry: false });
  }

  #step(buffer) {
    const { header, jpegs } = readStep(buffer);
    this.#newest = header;
    this.#controls.setStep(header);
    const changes = this.#states.update(header, performance.now());
    if (changes.length) {
      announce(`${changes.join(". ")}.`);
      setTimeout(() => this.#display.redraw(), FOUND_REDRAW);
      setTimeout(() => this.#refreshPanels(), FOUND_REDRAW);
    }
    const all = [...header.targets, ...header.waiting];
    if (!all.some(({ id }) => id === this.#selected)) this.#selected = null;
    this.#seekBar.show(header.index, header.time);
    this.#charts.add(header);
    this.#camera.onStep();
    this.#display.receive(header, jpegs);
    this.#refreshPanels();
    this.#describe();
  }

  #draw(step) {
    const marks = { stateOf: this.#stateOf, selected: this.#selected };
    this.#views.draw(step, (view) => this.#drawing.selectionIn(view), marks);
  }

  #showPanels() {
    if (!this.#newest) return;
    const { targets, waiting, index, playing } = this.#newest;
    const rows = [...targets, ...waiting.map((target) => waitingRow(target, index))];
    rows.sort((a, b) => a.id - b.id);
    this.#targets.update(rows, this.#stateOf, this.#errorOf, this.#selected);
    this.#controls.update();
    this.#charts.draw();
    hint(rows.length ? "" : playing === "paused" && index === 0 ? START_HINT : DRAW_HINT);
  }

  #showSummary() {
    if (!this.#newest) return;
    for (const { canvas, title } of this.#views.all) {
      canvas.setAttribute("aria-label", `The ${title} view. ${summary(this.#newest)}`);
    }
    this.#charts.describe();
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
    if (!this.#socket.connected || !this.#display.shown) return null;
    this.#display.freeze();
    return this.#display.shown.header;
  }

  async #addTarget(box, number) {
    const id = await this.#command({ type: "add", box, number });
    if (id !== undefined) this.#select(id);
  }

  #click(point, { targets }) {
    const target = targetAt(targets, point);
    if (target) this.#select(target.id);
    else toast("info", "Drag to draw a box of at least 4×4 pixels.");
  }

  #removeSelected() {
    if (this.#selected !== null) this.#command({ type: "remove", id: this.#selected });
  }

  #select(id) {
    this.#selected = id;
    this.#display.redraw();
    this.#refreshPanels();
  }
}

/** A target that begins in another frame, as a row of the list. */
function waitingRow(target, index) {
  const note = target.frame > index ? `waits for frame ${target.frame}` : `from frame ${target.frame}`;
  return { ...target, score: null, note };
}

/**
 * Define `window.ssiamLive` for tests and scripts, read-only: `step`, the header of the shown step
 * or null; `boxes`, its targets that are not lost; `frozen`, whether a box is being drawn.
 * @param {LivePage} page
 */
function expose(page) {
  const visible = () => page.shown?.targets.filter(({ lost }) => !lost) ?? [];
  const state = {
    get step() {
      return structuredClone(page.shown);
    },
    get boxes() {
      return visible().map(({ id, name, box }) => ({ id, name, box: [...box] }));
    },
    get frozen() {
      return page.frozen;
    },
  };
  Object.defineProperty(window, "ssiamLive", { value: Object.freeze(state) });
}

const page = new LivePage();
page.start();
expose(page);
