/** `StepDisplay`: decodes the images of steps, shows the newest one and frees the others. */

// Milliseconds until a step is acknowledged in a hidden tab, in which browsers draw nothing.
const HIDDEN_INTERVAL = 1000;

/**
 * @typedef {object} DecodedStep
 * @property {object} header
 * @property {Map<string, ImageBitmap>} bitmaps by view
 * @property {boolean} acknowledged
 */

/** Holds the step that is shown, and at most one that is next. */
export class StepDisplay {
  /** @type {DecodedStep | null} */ #shown = null;
  /** @type {DecodedStep | null} */ #next = null;
  #frozen = false;
  #session = {};
  #scheduled = 0;
  #handlers;

  /**
   * @param {{draw: (step: DecodedStep) => void, acknowledge: (number: number) => void,
   *   failed: () => void}} handlers
   */
  constructor(handlers) {
    this.#handlers = handlers;
    document.addEventListener("visibilitychange", () => this.redraw());
  }

  get shown() {
    return this.#shown;
  }

  get frozen() {
    return this.#frozen;
  }

  /** Keep the shown step until `unfreeze`. */
  freeze() {
    this.#frozen = true;
  }

  unfreeze() {
    this.#frozen = false;
    this.redraw();
  }

  /** Drop all steps: a new session starts. */
  clear() {
    for (const step of [this.#shown, this.#next]) close(step?.bitmaps);
    this.#shown = this.#next = null;
    this.#frozen = false;
    this.#session = {};
  }

  /** Add a step with its JPEG images by view. */
  async receive(header, jpegs) {
    const session = this.#session;
    const step = { header, bitmaps: new Map(), acknowledged: false };
    try {
      const decoding = [...jpegs].map(async ([view, jpeg]) => {
        step.bitmaps.set(view, await createImageBitmap(jpeg));
      });
      await Promise.all(decoding);
    } catch (error) {
      if (!(error instanceof DOMException)) throw error;
      this.#handlers.failed();
    }
    if (session === this.#session) this.#add(step);
    else close(step.bitmaps);
  }

  #add(step) {
    const latest = this.#next ?? this.#shown;
    if (latest && step.header.number < latest.header.number) {
      this.#drop(step);
      return;
    }
    if (this.#next) this.#drop(this.#next);
    this.#next = step;
    if (this.#frozen) this.#acknowledge(step);
    else setTimeout(() => this.#acknowledge(step), HIDDEN_INTERVAL);
    this.redraw();
  }

  /** Draw before the next refresh of the screen. */
  redraw() {
    this.#scheduled ||= requestAnimationFrame(() => this.#refresh());
  }

  #refresh() {
    this.#scheduled = 0;
    if (this.#next && !this.#frozen) {
      const [before, now] = [this.#shown, this.#next];
      this.#next = null;
      reuseBitmaps(before, now);
      this.#shown = now;
      close(before?.bitmaps);
      this.#acknowledge(now);
    }
    if (this.#shown) this.#handlers.draw(this.#shown);
  }

  #drop(step) {
    close(step.bitmaps);
    this.#acknowledge(step);
  }

  #acknowledge(step) {
    if (!step.acknowledged) this.#handlers.acknowledge(step.header.number);
    step.acknowledged = true;
  }
}

/** Move the images to a step on the same frame that has none. */
function reuseBitmaps(before, now) {
  if (before?.header.index !== now.header.index) return;
  for (const [view, bitmap] of before.bitmaps) {
    if (now.bitmaps.has(view)) continue;
    now.bitmaps.set(view, bitmap);
    before.bitmaps.delete(view);
  }
}

function close(bitmaps) {
  for (const bitmap of bitmaps?.values() ?? []) bitmap.close();
}
