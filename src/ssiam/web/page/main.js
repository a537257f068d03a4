/** The page of a live session: from the socket to the screen, from hand and keys to the socket. */

import { Charts } from "./charts.js";
import { Controls } from "./controls.js";
import { Pencil } from "./drawing.js";
import { expose } from "./hook.js";
import { watchKeys } from "./keys.js";
import { Layout } from "./layout.js";
import { announce, banner, hint, toast } from "./notes.js";
import { Screen } from "./picture.js";
import { Recordings } from "./recordings.js";
import { CommandFailed, OFFLINE, Socket } from "./socket.js";
import { paced, readStep, States, summary, targetAt } from "./steps.js";
import { TargetList } from "./targets.js";
import { CameraButton } from "./webcam.js";

const PROTOCOL = 1;
const FOUND_ENDS = 1050; // milliseconds after which a FOUND is drawn no longer
const DRAW = "Draw a box around what to follow: press, drag, let go.";

const byId = (id) => document.getElementById(id);

class Live {
  #newest = null; // header of the newest step that came, shown or not
  #selected = null;
  #states = new States();
  #health = { state: "running", message: "" };
  #charts = new Charts();
  #stateOf = (target) => this.#states.of(target, performance.now());
  #errorOf = (target) => this.#states.errorOf(target, performance.now());
  #socket = new Socket({
    message: (message) => this.#message(message),
    binary: (buffer) => this.#step(buffer),
    lost: (reason, wait) => this.#lost(reason, wait),
  });
  #screen = new Screen({
    draw: (ready) => this.#draw(ready),
    shown: (number) => this.#socket.send({ type: "shown", number }),
    broken: () => toast("warning", "A picture could not be read."),
  });
  #layout = new Layout((message) => this.#socket.send(message), () => this.#screen.redraw());
  #pencil = new Pencil(this.#layout.views, {
    begin: () => this.#beginStroke(),
    lasts: ({ number }) => this.#socket.send({ type: "hold", number }),
    changed: () => this.#screen.redraw(),
    end: () => this.#screen.thaw(),
    drawn: (box, { number }) => this.#addTarget(box, number),
    clicked: (place, header) => this.#click(place, header),
  });
  #targets = new TargetList(byId("targets"), byId("no-targets"), {
    select: (id) => this.#select(id),
    rename: (id, name) => this.#command({ type: "rename", id, name }),
    remove: (id) => this.#command({ type: "remove", id }),
  });
  #controls = new Controls({
    command: (command) => this.#command(command),
    layout: (sideBySide) => this.#layout.show(sideBySide),
  });
  #recordings = new Recordings((message) => toast("error", message));
  #camera = new CameraButton(
    (picture) => this.#socket.send(picture),
    (message) => toast("error", message),
  );
  #refreshPanels = paced(() => this.#showPanels(), 100);
  #describe = paced(() => this.#showSummary(), 1000);

  /** What is on the screen, for those who check it. */
  get shown() {
    return this.#screen.shown?.header ?? null;
  }

  get frozen() {
    return this.#screen.frozen;
  }

  start() {
    byId("banner-button").addEventListener("click", () => this.#socket.open());
    addEventListener("hashchange", () => this.#socket.open());
    watchKeys({
      " ": () => this.#controls.press("pause"),
      ".": () => this.#controls.press("advance"),
      r: () => this.#controls.press("restart"),
      s: () => this.#controls.press("side-by-side"),
      e: () => this.#controls.press("record"),
      1: () => this.#controls.pressMethod(0),
      2: () => this.#controls.pressMethod(1),
      3: () => this.#controls.pressMethod(2),
      Delete: () => this.#removeSelected(),
      Backspace: () => this.#removeSelected(),
      Escape: () => this.#pencil.cancel(),
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
    for (const part of [this.#screen, this.#states, this.#charts]) part.clear();
    this.#controls.begin(hello);
    this.#layout.begin(hello.size);
    this.#camera.offer(hello.webcam);
    this.#showHealth({ state: "running", message: "" });
    hint(hello.webcam ? "Waiting for somebody's camera." : "Waiting for the first picture.");
    if (hello.protocol !== PROTOCOL) toast("warning", "This page is older or newer than its server.");
  }

  #lost(reason, wait) {
    this.#pencil.cancel();
    this.#controls.end();
    this.#newest = null;
    // Why the session ended is worth more than that it did.
    const why = this.#health.state === "failed" ? `${this.#health.message}.` : reason;
    banner(`${why} Trying again in ${(wait / 1000).toFixed(wait < 1000 ? 1 : 0)} s.`);
  }

  /** Whether targets are tracked at all; another session's first message takes it back. */
  #showHealth({ state, message }) {
    this.#health = { state, message };
    this.#controls.showHealth(state);
    banner(state === "running" ? null : `${message}.`, { retry: false });
  }

  #step(buffer) {
    const { header, jpegs } = readStep(buffer);
    this.#newest = header;
    this.#controls.see(header);
    const told = this.#states.update(header, performance.now());
    if (told.length) {
      announce(`${told.join(". ")}.`);
      setTimeout(() => this.#screen.redraw(), FOUND_ENDS);
      setTimeout(() => this.#refreshPanels(), FOUND_ENDS);
    }
    if (!header.targets.some(({ id }) => id === this.#selected)) this.#selected = null;
    this.#charts.add(header);
    this.#camera.cameBack();
    this.#screen.receive(header, jpegs);
    this.#refreshPanels();
    this.#describe();
  }

  #draw(ready) {
    const marks = { stateOf: this.#stateOf, selected: this.#selected };
    this.#layout.draw(ready, (view) => this.#pencil.bandIn(view), marks);
  }

  #showPanels() {
    if (!this.#newest) return;
    const { targets } = this.#newest;
    this.#targets.update(targets, this.#stateOf, this.#errorOf, this.#selected);
    this.#controls.show();
    this.#charts.draw();
    hint(targets.length ? "" : DRAW);
  }

  #showSummary() {
    if (!this.#newest) return;
    for (const { canvas, name } of this.#layout.views) {
      canvas.setAttribute("aria-label", `The ${name} picture. ${summary(this.#newest)}`);
    }
    this.#charts.describe();
  }

  /** Send a command; undefined where it failed, and a note or the banner says why. */
  async #command(command) {
    try {
      return await this.#socket.ask(command);
    } catch (error) {
      if (!(error instanceof CommandFailed)) throw error;
      if (error.code !== OFFLINE) toast("error", error.message);
      return undefined;
    }
  }

  #beginStroke() {
    if (!this.#socket.connected || !this.#screen.shown) return null;
    this.#screen.freeze();
    return this.#screen.shown.header;
  }

  async #addTarget(box, number) {
    const id = await this.#command({ type: "add", box, number });
    if (id !== undefined) this.#select(id);
  }

  #click(place, { targets }) {
    const target = targetAt(targets, place);
    if (target) this.#select(target.id);
    else toast("info", "Press and drag to draw a box of at least 4 pixels.");
  }

  #removeSelected() {
    if (this.#selected !== null) this.#command({ type: "remove", id: this.#selected });
  }

  #select(id) {
    this.#selected = id;
    this.#screen.redraw();
    this.#refreshPanels();
  }
}

const live = new Live();
live.start();
expose(live);
