/** Parsing of steps, and what changes from one to the next. */

import { contains } from "./geometry.js";

const FOUND_DURATION = 1000; // milliseconds for which a target counts as found
const ERROR_DURATION = 3000; // milliseconds for which a tracker's error is shown

/**
 * @typedef {object} Target a target by the field names of the protocol
 * @property {number} id
 * @property {string} name
 * @property {string} colour
 * @property {number[]} box x, y, w, h in raw-frame pixels
 * @property {number[][] | null} corners
 * @property {number | null} score null on a target that is not tracked yet
 * @property {boolean} lost
 * @property {boolean} found
 * @property {string | null} error why its tracker failed on this frame
 */

/**
 * Split a binary message into its header and its images.
 * @param {ArrayBuffer} buffer
 * @returns {{header: object, jpegs: Map<string, Blob>}}
 */
export function readStep(buffer) {
  const length = new DataView(buffer).getUint32(0);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const jpegs = new Map();
  let offset = 4 + length;
  for (const { view, bytes } of header.pictures) {
    const part = new Uint8Array(buffer, offset, bytes);
    jpegs.set(view, new Blob([part], { type: "image/jpeg" }));
    offset += bytes;
  }
  return { header, jpegs };
}

const INITIAL = { lost: false, foundAt: -Infinity, error: "", errorAt: -Infinity };

/** Which targets are lost or were just found again, and their recent errors. */
export class TargetStates {
  #states = new Map();

  /**
   * Add a step; returns announcements of what has changed, as sentences.
   * @param {{targets: Target[]}} header
   * @param {number} now milliseconds
   * @returns {string[]}
   */
  update({ targets }, now) {
    const changes = [];
    const states = new Map();
    for (const { id, name, lost, found, error } of targets) {
      const before = this.#states.get(id) ?? INITIAL;
      if (error) {
        if (now - before.errorAt > ERROR_DURATION) changes.push(`The tracker of ${name} failed: ${error}`);
        states.set(id, { ...before, error, errorAt: now });
        continue;
      }
      // The step on which it was found may not have been sent to this client.
      const isFound = !lost && (found || before.lost);
      if (isFound) changes.push(`${name} was found again`);
      if (lost && !before.lost) changes.push(`${name} is lost`);
      states.set(id, { ...before, lost, foundAt: isFound ? now : before.foundAt });
    }
    this.#states = states;
    return changes;
  }

  /** Forget all targets: a new session starts. */
  clear() {
    this.#states.clear();
  }

  /**
   * @param {Target} target
   * @param {number} now milliseconds
   * @returns {"tracking" | "lost" | "found"}
   */
  of(target, now) {
    if (target.lost) return "lost";
    const foundAt = this.#states.get(target.id)?.foundAt ?? -Infinity;
    return now - foundAt < FOUND_DURATION ? "found" : "tracking";
  }

  /**
   * The recent error of its tracker, or "".
   * @param {Target} target
   * @param {number} now milliseconds
   * @returns {string}
   */
  errorOf(target, now) {
    const { error, errorAt } = this.#states.get(target.id) ?? INITIAL;
    return now - errorAt < ERROR_DURATION ? error : "";
  }
}

/** Describe a step for screen readers. */
export function summary({ index, targets }) {
  const parts = targets.map(({ name, box: [x, y, w, h], score, lost }) => {
    if (lost) return `${name} is lost`;
    const center = `${Math.round(x + w / 2)}, ${Math.round(y + h / 2)}`;
    return `${name} at ${center}, score ${score.toFixed(2)}`;
  });
  return `Frame ${index}. ${parts.length ? parts.join("; ") : "No targets"}.`;
}

/** The smallest target at a point of the raw frame; undefined if there is none. */
export function targetAt(targets, point) {
  const hits = targets.filter(({ box, lost }) => !lost && contains(box, point));
  return hits.sort((a, b) => a.box[2] * a.box[3] - b.box[2] * b.box[3])[0];
}

/**
 * A function that calls `callback` at most once per interval; the last call is never dropped.
 * @param {() => void} callback
 * @param {number} interval milliseconds
 */
export function throttle(callback, interval) {
  let last = -Infinity;
  let timer = 0;
  const run = () => {
    last = performance.now();
    timer = 0;
    callback();
  };
  return () => {
    if (!timer) timer = setTimeout(run, Math.max(0, last + interval - performance.now()));
  };
}
