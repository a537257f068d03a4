/** Steps as they arrive, and what changes from one to the next. */

import { contains } from "./geometry.js";

const FOUND_FLASH = 1000; // milliseconds
const ERROR_SHOWN = 3000; // milliseconds after the last frame on which a tracker failed

/**
 * @typedef {object} Target
 * @property {number} id
 * @property {string} name
 * @property {string} colour
 * @property {number[]} box x, y, w, h in raw-frame pixels
 * @property {number[][] | null} corners
 * @property {number} score
 * @property {boolean} lost
 * @property {boolean} found
 * @property {string | null} error why its tracker failed on this frame
 */

/**
 * The header and the pictures of a binary message.
 * @param {ArrayBuffer} buffer
 * @returns {{header: object, jpegs: Map<string, Blob>}}
 */
export function readStep(buffer) {
  const length = new DataView(buffer).getUint32(0);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const jpegs = new Map();
  let start = 4 + length;
  for (const { view, bytes } of header.pictures) {
    const part = new Uint8Array(buffer, start, bytes);
    jpegs.set(view, new Blob([part], { type: "image/jpeg" }));
    start += bytes;
  }
  return { header, jpegs };
}

const UNKNOWN = { lost: false, foundAt: -Infinity, error: "", errorAt: -Infinity };

/** Remembers which targets are lost, for a second which were found again, and recent errors. */
export class States {
  #known = new Map();

  /**
   * Take a step in; what is to be told about it, as sentences.
   * @param {{targets: Target[]}} header
   * @param {number} now milliseconds
   * @returns {string[]}
   */
  update({ targets }, now) {
    const told = [];
    const known = new Map();
    for (const { id, name, lost, found, error } of targets) {
      const before = this.#known.get(id) ?? UNKNOWN;
      if (error) {
        if (now - before.errorAt > ERROR_SHOWN) told.push(`The tracker of ${name} fails: ${error}`);
        known.set(id, { ...before, error, errorAt: now });
        continue;
      }
      const again = !lost && (found || before.lost);
      // The step on which it was found may be one that this client was not sent.
      if (again) told.push(`${name} is found again`);
      if (lost && !before.lost) told.push(`${name} is lost`);
      known.set(id, { ...before, lost, foundAt: again ? now : before.foundAt });
    }
    this.#known = known;
    return told;
  }

  /** Forget all: another session begins. */
  clear() {
    this.#known.clear();
  }

  /**
   * @param {Target} target
   * @param {number} now milliseconds
   * @returns {"tracking" | "lost" | "found"}
   */
  of(target, now) {
    if (target.lost) return "lost";
    const foundAt = this.#known.get(target.id)?.foundAt ?? -Infinity;
    return now - foundAt < FOUND_FLASH ? "found" : "tracking";
  }

  /**
   * Why its tracker failed, if it did so on one of the last frames; else "".
   * @param {Target} target
   * @param {number} now milliseconds
   * @returns {string}
   */
  errorOf(target, now) {
    const { error, errorAt } = this.#known.get(target.id) ?? UNKNOWN;
    return now - errorAt < ERROR_SHOWN ? error : "";
  }
}

/** What the picture shows, in words. */
export function summary({ index, targets }) {
  const parts = targets.map(({ name, box: [x, y, w, h], score, lost }) => {
    if (lost) return `${name} is lost`;
    const at = `${Math.round(x + w / 2)}, ${Math.round(y + h / 2)}`;
    return `${name} at ${at}, score ${score.toFixed(2)}`;
  });
  return `Frame ${index}. ${parts.length ? parts.join("; ") : "No targets"}.`;
}

/** The smallest target at a place of the raw frame; undefined if none is there. */
export function targetAt(targets, place) {
  const there = targets.filter(({ box, lost }) => !lost && contains(box, place));
  return there.sort((a, b) => a.box[2] * a.box[3] - b.box[2] * b.box[3])[0];
}

/**
 * `work`, at most once every `pause` milliseconds; never left out at the end.
 * @param {() => void} work
 * @param {number} pause
 */
export function paced(work, pause) {
  let last = -Infinity;
  let timer = 0;
  const run = () => {
    last = performance.now();
    timer = 0;
    work();
  };
  return () => {
    if (!timer) timer = setTimeout(run, Math.max(0, last + pause - performance.now()));
  };
}
