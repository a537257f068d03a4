/** `View`: one canvas with a picture and what is drawn over it. */

import { IDENTITY } from "./geometry.js";
import { drawBand, drawTargets } from "./overlay.js";

/** The raw or the steadied view. */
export class View {
  #size = [0, 0];

  /** @param {HTMLElement} figure @param {() => void} resized */
  constructor(figure, resized) {
    this.figure = figure;
    this.name = figure.dataset.view;
    this.canvas = figure.querySelector("canvas");
    this.context = this.canvas.getContext("2d", { alpha: false });
    new ResizeObserver(() => resized()).observe(this.canvas);
  }

  /** Width in device pixels. */
  get width() {
    return Math.round(this.canvas.clientWidth * devicePixelRatio);
  }

  /** A pointer's place in the frame's pixels, inside of the frame. */
  place({ clientX, clientY }) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const x = Math.min(Math.max((clientX - left) / width, 0), 1) * this.#size[0];
    const y = Math.min(Math.max((clientY - top) / height, 0), 1) * this.#size[1];
    return [x, y];
  }

  /** The way from raw-frame pixels to those of this view. */
  viewFromRaw(header) {
    return this.name === "steadied" ? header.stab_from_raw : IDENTITY;
  }

  /**
   * @param {ImageBitmap | undefined} bitmap nothing is drawn without
   * @param {[number, number]} size of the raw frame
   */
  draw(bitmap, header, size, { stateOf, selected, band }) {
    const { canvas, context } = this;
    this.#size = size;
    const [wide, high] = [this.width, Math.round(canvas.clientHeight * devicePixelRatio)];
    if (canvas.width !== wide || canvas.height !== high) {
      [canvas.width, canvas.height] = [wide, high];
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    if (bitmap) context.drawImage(bitmap, 0, 0, wide, high);
    context.scale(devicePixelRatio, devicePixelRatio);
    const [width, height] = [wide / devicePixelRatio, high / devicePixelRatio];
    const viewFromRaw = this.viewFromRaw(header);
    const ground = { context, width, height, scale: width / size[0], viewFromRaw };
    drawTargets(ground, header.targets, stateOf, selected);
    if (band) drawBand(ground, band);
  }
}
