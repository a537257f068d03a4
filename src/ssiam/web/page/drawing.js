/** Drawing and changing boxes with mouse, pen or finger. */

import { boxBetween, inverse, mapBox, mapPoint } from "./geometry.js";

const MIN_SIDE = 4; // frame pixels
const MAX_CLICK = 250; // milliseconds
const MIN_MOVE = 3; // CSS pixels by which a box is moved at least
const SLACK = { touch: 24, other: 10 }; // CSS pixels around a handle

/**
 * @typedef {object} Grip a box, or a corner of one, that a stroke moves
 * @property {(point: number[]) => void} move to a point in raw-frame pixels
 * @property {() => void} drop the stroke has ended
 * @property {() => void} cancel the stroke was cancelled
 */

/**
 * @typedef {object} Handlers
 * @property {() => object | null} begin freezes the view and returns the header of the shown step;
 *   null if there is none
 * @property {(header: object) => void} hold the stroke is not a click: the step is needed until
 *   the stroke ends
 * @property {() => void} changed the selection has changed
 * @property {() => void} end unfreezes the view; called before `drawn` and `clicked`
 * @property {(xywh: number[], header: object) => void} drawn box in raw-frame pixels
 * @property {(point: number[], header: object) => void} clicked point in raw-frame pixels
 * @property {(point: number[], slack: number) => Grip | null} [grab] what a stroke from this point
 *   moves instead of drawing a box; point and slack in raw-frame pixels
 */

/** Handles the pointer on all views; one stroke at a time. */
export class BoxDrawing {
  #stroke = null;
  #handlers;

  /** @param {import("./views.js").View[]} views @param {Handlers} handlers */
  constructor(views, handlers) {
    this.#handlers = handlers;
    for (const view of views) this.#watch(view);
  }

  /** The box that is being drawn in this view, in the view's pixels, or null. */
  selectionIn(view) {
    const stroke = this.#stroke;
    return stroke?.view === view && !stroke.grip ? boxBetween(stroke.from, stroke.to) : null;
  }

  /** Cancel the box that is being drawn, if there is one. */
  cancel() {
    this.#stroke?.grip?.cancel();
    this.#end();
  }

  #end() {
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
    const header = this.#handlers.begin();
    if (!header) return;
    event.preventDefault();
    // Commits a name that is being typed, and returns the keyboard to the page.
    document.activeElement?.blur();
    view.canvas.setPointerCapture(event.pointerId);
    const point = view.point(event);
    const timer = setTimeout(() => this.#hold(), MAX_CLICK);
    const pointer = event.pointerId;
    const slack = (event.pointerType === "touch" ? SLACK.touch : SLACK.other) / scaleOf(view, header);
    const grip = this.#handlers.grab?.(toRaw(view, header, point), slack) ?? null;
    this.#stroke = { view, header, pointer, grip, from: point, to: point, timer, held: false, moved: false };
  }

  #hold() {
    if (this.#stroke.held) return;
    this.#stroke.held = true;
    this.#handlers.hold(this.#stroke.header);
  }

  #move(event) {
    const stroke = this.#stroke;
    stroke.to = stroke.view.point(event);
    if (stroke.grip) {
      this.#moveGrip(stroke);
      return;
    }
    if (isBox(boxBetween(stroke.from, stroke.to))) this.#hold();
    this.#handlers.changed();
  }

  #moveGrip(stroke) {
    const { view, header, from, to } = stroke;
    const distance = Math.hypot(to[0] - from[0], to[1] - from[1]);
    stroke.moved ||= distance * scaleOf(view, header) >= MIN_MOVE;
    if (stroke.moved) stroke.grip.move(toRaw(view, header, to));
  }

  #up(event) {
    this.#move(event);
    const { view, header, from, to, grip, moved } = this.#stroke;
    this.#end();
    if (grip && moved) {
      grip.drop();
      return;
    }
    const box = boxBetween(from, to);
    const raw = mapBox(inverse(view.viewFromRaw(header)), box);
    if (isBox(box)) this.#handlers.drawn(raw, header);
    else this.#handlers.clicked([raw[0] + raw[2] / 2, raw[1] + raw[3] / 2], header);
  }
}

/** CSS pixels per frame pixel. */
function scaleOf(view, { size }) {
  return view.canvas.clientWidth / size[0];
}

function toRaw(view, header, point) {
  return mapPoint(inverse(view.viewFromRaw(header)), point);
}

function isBox([, , w, h]) {
  return Math.min(w, h) >= MIN_SIDE;
}
