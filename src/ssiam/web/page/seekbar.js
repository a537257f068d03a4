/** The seek bar: the position in a file, to be dragged to any frame. */

import { throttle } from "./steps.js";

const SEEK_INTERVAL = 80; // milliseconds between two requests while the bar is dragged
const ANSWER_TIMEOUT = 1000; // milliseconds for which frames before the requested one are ignored
const UNKNOWN_MARGIN = 300; // frames that the bar shows after the last known one, without a length

export class SeekBar {
  #bar;
  #label;
  #marks;
  #seek;
  #length = null;
  #fps = null;
  #index = 0;
  #dragging = false;
  #requestedAt = -Infinity; // milliseconds; of a frame that is not shown yet

  /**
   * @param {HTMLElement} element has an input of type range, an output, and a box for marks
   * @param {(index: number) => void} seek called with the frame to show
   */
  constructor(element, seek) {
    this.#bar = element.querySelector("input");
    this.#label = element.querySelector("output");
    this.#marks = element.querySelector(".marks");
    this.#seek = throttle(() => seek(this.#index), SEEK_INTERVAL);
    this.#bar.addEventListener("input", () => {
      this.#dragging = true;
      this.to(Number(this.#bar.value));
    });
    this.#bar.addEventListener("change", () => (this.#dragging = false));
  }

  /** The frame that was asked for last, or is shown. */
  get index() {
    return this.#index;
  }

  /** Set the number of frames and their rate; either may be null. */
  begin(length, fps) {
    [this.#length, this.#fps] = [length, fps];
    this.show(this.#index, null);
  }

  /** Ask for a frame. */
  to(index) {
    const last = this.#length === null ? Infinity : this.#length - 1;
    this.#index = Math.min(Math.max(Math.round(index), 0), last);
    this.#requestedAt = performance.now();
    this.#write(this.#index, null);
    this.#seek();
  }

  /** Show the position of a frame, unless the bar is being dragged or waits for another one. */
  show(index, time) {
    if (this.#dragging) return;
    const isWaiting = performance.now() - this.#requestedAt < ANSWER_TIMEOUT;
    if (isWaiting && index !== this.#index) return;
    this.#requestedAt = -Infinity;
    this.#index = index;
    this.#write(index, time);
  }

  /** Mark frames, for instance those in which a target has a box; some with a hollow mark. */
  mark(frames) {
    this.#marks.replaceChildren(
      ...frames.map(({ index, color, hollow = false }) => {
        const mark = document.createElement("i");
        mark.style.left = `${(100 * index) / Math.max(this.#last(), 1)}%`;
        mark.style.color = color;
        mark.classList.toggle("hollow", hollow);
        return mark;
      }),
    );
  }

  #last() {
    return this.#length === null ? this.#index + UNKNOWN_MARGIN : this.#length - 1;
  }

  #write(index, time) {
    this.#bar.max = String(this.#last());
    this.#bar.value = String(index);
    const seconds = time ?? (this.#fps ? index / this.#fps : null);
    const total = this.#length === null ? "" : ` of ${this.#length}`;
    const clock = seconds === null ? "" : ` · ${seconds.toFixed(1)} s`;
    this.#label.textContent = `frame ${index}${total}${clock}`;
    this.#bar.setAttribute("aria-valuetext", this.#label.textContent);
  }
}
