/** The pictures on the screen: decoded as they come, the newest drawn, all of them freed. */

// A browser draws nothing into a page that nobody can see: so many milliseconds between steps then.
const UNSEEN_PAUSE = 1000;

/**
 * @typedef {object} Ready a step whose pictures are decoded
 * @property {object} header
 * @property {Map<string, ImageBitmap>} bitmaps
 * @property {boolean} told whether the server knows that it came
 */

/** Keeps one decoded step on the screen and at most one that waits for it. */
export class Screen {
  /** @type {Ready | null} */ #shown = null;
  /** @type {Ready | null} */ #waiting = null;
  #frozen = false;
  #session = {};
  #scheduled = 0;
  #handlers;

  /** @param {{draw: (ready: Ready) => void, shown: (number: number) => void, broken: () => void}} handlers */
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

  /** Keep what is shown until `thaw`; what comes meanwhile waits. */
  freeze() {
    this.#frozen = true;
  }

  thaw() {
    this.#frozen = false;
    this.redraw();
  }

  /** Forget everything: another session begins. */
  clear() {
    for (const ready of [this.#shown, this.#waiting]) free(ready?.bitmaps);
    this.#shown = this.#waiting = null;
    this.#frozen = false;
    this.#session = {};
  }

  /** Take a step in, with its pictures as JPEG. */
  async receive(header, jpegs) {
    const session = this.#session;
    const ready = { header, bitmaps: new Map(), told: false };
    try {
      const decoded = [...jpegs].map(async ([view, jpeg]) => {
        ready.bitmaps.set(view, await createImageBitmap(jpeg));
      });
      await Promise.all(decoded);
    } catch (error) {
      if (!(error instanceof DOMException)) throw error;
      this.#handlers.broken();
    }
    if (session === this.#session) this.#arrive(ready);
    else free(ready.bitmaps);
  }

  #arrive(ready) {
    const latest = this.#waiting ?? this.#shown;
    if (latest && ready.header.number < latest.header.number) {
      this.#drop(ready);
      return;
    }
    if (this.#waiting) this.#drop(this.#waiting);
    this.#waiting = ready;
    if (this.#frozen) this.#tell(ready);
    else setTimeout(() => this.#tell(ready), UNSEEN_PAUSE);
    this.redraw();
  }

  /** Draw before the screen's next refresh. */
  redraw() {
    this.#scheduled ||= requestAnimationFrame(() => this.#refresh());
  }

  #refresh() {
    this.#scheduled = 0;
    if (this.#waiting && !this.#frozen) {
      const [before, now] = [this.#shown, this.#waiting];
      this.#waiting = null;
      keepSamePicture(before, now);
      this.#shown = now;
      free(before?.bitmaps);
      this.#tell(now);
    }
    if (this.#shown) this.#handlers.draw(this.#shown);
  }

  #drop(ready) {
    free(ready.bitmaps);
    this.#tell(ready);
  }

  #tell(ready) {
    if (!ready.told) this.#handlers.shown(ready.header.number);
    ready.told = true;
  }
}

/** A step without new pictures goes on with those of the step before. */
function keepSamePicture(before, now) {
  if (before?.header.index !== now.header.index) return;
  for (const [view, bitmap] of before.bitmaps) {
    if (now.bitmaps.has(view)) continue;
    now.bitmaps.set(view, bitmap);
    before.bitmaps.delete(view);
  }
}

function free(bitmaps) {
  for (const bitmap of bitmaps?.values() ?? []) bitmap.close();
}
