/** Keyframes of the selected target: the boxes that it has in several frames, and their buttons. */

const byId = (id) => document.getElementById(id);

/**
 * @typedef {object} Keyframe
 * @property {number} frame
 * @property {number[] | null} box x, y, w, h in raw-frame pixels; null if the target is absent from
 *   this frame to the next keyframe
 */

/** The keyframe of a target in a frame; undefined if there is none. */
export function keyframeIn(target, index) {
  return target.keyframes.find(({ frame }) => frame === index);
}

/** Whether a keyframe can be removed alone: the target has a box in another one. */
export function isRemovable(target, keyframe) {
  return target.keyframes.some(({ frame, box }) => box && frame !== keyframe.frame);
}

/** When a target begins, and how many keyframes it has. */
export function noteOf({ frame, keyframes }, fps) {
  const seconds = fps ? ` · ${(frame / fps).toFixed(1)} s` : "";
  const count = keyframes.length;
  return `from frame ${frame}${count > 1 ? ` · ${count} keyframes` : seconds}`;
}

/** Where the seek bar is marked; hollow where a target is absent. */
export function marksOf(targets) {
  return targets.flatMap(({ keyframes, colour: color }) =>
    keyframes.map(({ frame, box }) => ({ index: frame, color, hollow: box === null })),
  );
}

/**
 * @typedef {object} Handlers
 * @property {() => void} armed the next box has become, or is no more, a keyframe
 * @property {(target: object, index: number) => void} absent
 * @property {(target: object, index: number) => void} remove
 */

/** The buttons below the frame. The next box that is drawn is a keyframe while `armed` is set. */
export class KeyframeButtons {
  #handlers;
  #target = null;
  #index = null;
  #armed = null;

  /** @param {Handlers} handlers */
  constructor(handlers) {
    this.#handlers = handlers;
    byId("correct").addEventListener("click", () => this.#arm(this.#armed === null ? this.#target.id : null));
    byId("absent").addEventListener("click", () => {
      this.disarm();
      this.#handlers.absent(this.#target, this.#index);
    });
    byId("remove-keyframe").addEventListener("click", () => this.#handlers.remove(this.#target, this.#index));
  }

  /** Id of the target of which the next box is a keyframe, or null. */
  get armed() {
    return this.#armed;
  }

  /** The next box is a new target's. */
  disarm() {
    if (this.#armed !== null) this.#arm(null);
  }

  /**
   * @param {object | null} target the selected one
   * @param {number | null} index of the shown frame; null if it takes no box
   * @param {boolean} isShown whether there are targets at all
   */
  update(target, index, isShown) {
    [this.#target, this.#index] = [target, index];
    if (this.#armed !== null && this.#armed !== target?.id) this.disarm();
    const here = target && index !== null ? keyframeIn(target, index) : undefined;
    const isPossible = target !== null && index !== null;
    byId("keyframes").hidden = !isShown;
    byId("correct").textContent = `Correct ${target ? `${target.name} ` : ""}here`;
    byId("correct").disabled = !isPossible || (Boolean(here?.box) && this.#armed === null);
    byId("absent").disabled = !isPossible || here?.box === null || !isRemovable(target, { frame: index });
    // Two buttons at a time: those below do not move on a phone.
    const canRemove = isPossible && Boolean(here) && isRemovable(target, here);
    byId("remove-keyframe").hidden = !canRemove;
    byId("correct").hidden = canRemove && here.box !== null && this.#armed === null;
    byId("absent").hidden = canRemove && !byId("correct").hidden;
  }

  #arm(id) {
    this.#armed = id;
    byId("correct").setAttribute("aria-pressed", String(id !== null));
    this.#handlers.armed();
  }
}
