/** Drawing boxes with mouse, pen or finger. */

import { boxBetween, inverse, movedBox } from "./geometry.js";

const SMALLEST = 4; // frame pixels
const CLICK = 250; // milliseconds, at most

/**
 * @typedef {object} Handlers
 * @property {(view: import("./view.js").View) => object | null} begin freezes the picture and
 *   gives the header of the step that is shown; null where there is nothing to draw into
 * @property {(header: object) => void} lasts it is no click: that step is needed until the end
 * @property {() => void} changed the box that is being drawn
 * @property {(xywh: number[], header: object) => void} drawn a box in raw-frame pixels
 * @property {(place: number[], header: object) => void} clicked a place in raw-frame pixels
 * @property {() => void} end the picture may go on; called before `drawn` and `clicked`
 */

/** Watches the pointer over all views; one box at a time. */
export class Pencil {
  #stroke = null;
  #handlers;

  /** @param {import("./view.js").View[]} views @param {Handlers} handlers */
  constructor(views, handlers) {
    this.#handlers = handlers;
    for (const view of views) this.#watch(view);
  }

  /** The box that is being drawn into this view, in the view's pixels. */
  bandIn(view) {
    return this.#stroke?.view === view ? boxBetween(this.#stroke.from, this.#stroke.to) : null;
  }

  /** Give up the box that is being drawn, if there is one. */
  cancel() {
    const stroke = this.#stroke;
    this.#stroke = null;
    clearTimeout(stroke?.timer);
    if (stroke) this.#handlers.end();
  }

  #watch(view) {
    const mine = (event) => this.#stroke?.view === view && event.pointerId === this.#stroke.pointer;
    view.canvas.addEventListener("pointerdown", (event) => this.#down(view, event));
    view.canvas.addEventListener("pointermove", (event) => mine(event) && this.#move(event));
    view.canvas.addEventListener("pointerup", (event) => mine(event) && this.#up(event));
    view.canvas.addEventListener("pointercancel", (event) => mine(event) && this.cancel());
  }

  #down(view, event) {
    if (!event.isPrimary || event.button !== 0 || this.#stroke) return;
    const header = this.#handlers.begin(view);
    if (!header) return;
    event.preventDefault();
    // A name that is being typed is finished, and the keys are the page's again.
    document.activeElement?.blur();
    view.canvas.setPointerCapture(event.pointerId);
    const place = view.place(event);
    const timer = setTimeout(() => this.#last(), CLICK);
    this.#stroke = { view, header, pointer: event.pointerId, from: place, to: place, timer };
  }

  #last() {
    if (this.#stroke.lasts) return;
    this.#stroke.lasts = true;
    this.#handlers.lasts(this.#stroke.header);
  }

  #move(event) {
    const stroke = this.#stroke;
    stroke.to = stroke.view.place(event);
    if (isLarge(boxBetween(stroke.from, stroke.to))) this.#last();
    this.#handlers.changed();
  }

  #up(event) {
    this.#move(event);
    const { view, header, from, to } = this.#stroke;
    this.cancel();
    const box = boxBetween(from, to);
    const raw = movedBox(inverse(view.viewFromRaw(header)), box);
    if (isLarge(box)) this.#handlers.drawn(raw, header);
    else this.#handlers.clicked([raw[0] + raw[2] / 2, raw[1] + raw[3] / 2], header);
  }
}

function isLarge([, , w, h]) {
  return Math.min(w, h) >= SMALLEST;
}
