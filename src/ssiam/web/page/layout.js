/** Which pictures are to be seen, how large, and asking the server for just these. */

import { paced } from "./steps.js";
import { View } from "./view.js";

const QUALITY = 80;
const LEAST = 64; // pixels, widths of pictures
const MOST = 1920;
const STEP = 32; // so that dragging a window's edge does not ask for every width
const PAUSE = 200; // milliseconds between two wishes, at least

export class Layout {
  #size = null;
  #asked = "";
  #ask;
  #send;
  #redraw;

  /**
   * @param {(message: object) => boolean} send
   * @param {() => void} redraw
   */
  constructor(send, redraw) {
    this.#send = send;
    this.#redraw = redraw;
    this.#ask = paced(() => this.#sendView(), PAUSE);
    const figures = document.querySelectorAll(".view");
    this.views = [...figures].map((figure) => new View(figure, () => this.#resized()));
  }

  /** The views that are open. */
  get open() {
    return this.views.filter(({ figure }) => !figure.hidden);
  }

  /** A session begins, with frames of this size; null if it is not known yet. */
  begin(size) {
    this.#asked = "";
    if (size) this.#setSize(size);
    this.#ask();
  }

  /** Show the steadied view beside the raw one, or only that. */
  show(sideBySide) {
    this.views.find(({ name }) => name === "steadied").figure.hidden = !sideBySide;
    document.documentElement.dataset.views = sideBySide ? "both" : "raw";
    this.#resized();
  }

  /** Draw a step into every open view. */
  draw({ header, bitmaps }, bandIn, marks) {
    this.#setSize(header.size);
    for (const view of this.open) {
      view.draw(bitmaps.get(view.name), header, this.#size, { ...marks, band: bandIn(view) });
    }
  }

  #setSize([width, height]) {
    if (this.#size?.[0] === width && this.#size?.[1] === height) return;
    this.#size = [width, height];
    document.documentElement.style.setProperty("--ratio", String(width / height));
  }

  #resized() {
    this.#redraw();
    this.#ask();
  }

  #sendView() {
    const wide = Math.max(...this.open.map(({ width }) => width));
    const width = Math.min(Math.max(Math.ceil(wide / STEP) * STEP, LEAST), MOST);
    const steadied = this.open.some(({ name }) => name === "steadied");
    const view = { type: "view", raw: true, steadied, width, quality: QUALITY };
    if (JSON.stringify(view) === this.#asked || !this.#send(view)) return;
    this.#asked = JSON.stringify(view);
  }
}
