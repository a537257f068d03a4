/** The raw and the stabilized view: their canvases, and requests for their images. */

import { IDENTITY } from "./geometry.js";
import { drawSelection, drawTargets } from "./overlay.js";
import { throttle } from "./steps.js";

const QUALITY = 80;
const MIN_WIDTH = 64; // pixels, widths of images
const MAX_WIDTH = 1920;
const WIDTH_STEP = 32; // so that resizing a window does not request every width
const REQUEST_INTERVAL = 200; // milliseconds between two requests, at least

/** A canvas with an image and the targets drawn over it. */
class View {
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

  /** The name shown to users; `name` is that of the protocol. */
  get title() {
    return this.name === "steadied" ? "stabilized" : this.name;
  }

  /** The pointer's position in frame pixels, clipped to the frame. */
  point({ clientX, clientY }) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const x = Math.min(Math.max((clientX - left) / width, 0), 1) * this.#size[0];
    const y = Math.min(Math.max((clientY - top) / height, 0), 1) * this.#size[1];
    return [x, y];
  }

  /** The transform from raw-frame pixels to those of this view. */
  viewFromRaw(header) {
    return this.name === "steadied" ? header.stab_from_raw : IDENTITY;
  }

  /**
   * @param {ImageBitmap | undefined} bitmap the last image is kept if undefined
   * @param {[number, number]} size of the raw frame
   */
  draw(bitmap, header, size, { stateOf, selected, selection }) {
    const { canvas, context } = this;
    this.#size = size;
    const pixelWidth = this.width;
    const pixelHeight = Math.round(canvas.clientHeight * devicePixelRatio);
    if (canvas.width !== pixelWidth || canvas.height !== pixelHeight) {
      [canvas.width, canvas.height] = [pixelWidth, pixelHeight];
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    if (bitmap) context.drawImage(bitmap, 0, 0, pixelWidth, pixelHeight);
    context.scale(devicePixelRatio, devicePixelRatio);
    const [width, height] = [pixelWidth / devicePixelRatio, pixelHeight / devicePixelRatio];
    const viewFromRaw = this.viewFromRaw(header);
    const surface = { context, width, height, scale: width / size[0], viewFromRaw };
    drawTargets(surface, header.targets, stateOf, selected);
    if (selection) drawSelection(surface, selection);
  }
}

/** All views of the page. */
export class Views {
  #size = null;
  #requested = "";
  #request;
  #send;
  #redraw;

  /**
   * @param {(message: object) => boolean} send
   * @param {() => void} redraw
   */
  constructor(send, redraw) {
    this.#send = send;
    this.#redraw = redraw;
    this.#request = throttle(() => this.#sendRequest(), REQUEST_INTERVAL);
    const figures = document.querySelectorAll(".view");
    this.all = [...figures].map((figure) => new View(figure, () => this.#resized()));
  }

  /** The views that are visible. */
  get visible() {
    return this.all.filter(({ figure }) => !figure.hidden);
  }

  /** Start a session with frames of this size; null if it is unknown. */
  begin(size) {
    this.#requested = "";
    if (size) this.#setSize(size);
    this.#request();
  }

  /** Show both views, or only the raw one. */
  show(sideBySide) {
    this.all.find(({ name }) => name === "steadied").figure.hidden = !sideBySide;
    document.documentElement.dataset.views = sideBySide ? "both" : "raw";
    this.#resized();
  }

  /** Draw a step into all visible views. */
  draw({ header, bitmaps }, selectionIn, marks) {
    this.#setSize(header.size);
    const camera = this.all.find(({ name }) => name === "steadied");
    if (camera) camera.figure.querySelector("figcaption").textContent = header.camera;
    for (const view of this.visible) {
      const selection = selectionIn(view);
      view.draw(bitmaps.get(view.name), header, this.#size, { ...marks, selection });
    }
  }

  #setSize([width, height]) {
    if (this.#size?.[0] === width && this.#size?.[1] === height) return;
    this.#size = [width, height];
    document.documentElement.style.setProperty("--ratio", String(width / height));
  }

  #resized() {
    this.#redraw();
    this.#request();
  }

  #sendRequest() {
    const widest = Math.max(...this.visible.map(({ width }) => width));
    const rounded = Math.ceil(widest / WIDTH_STEP) * WIDTH_STEP;
    const width = Math.min(Math.max(rounded, MIN_WIDTH), MAX_WIDTH);
    const steadied = this.visible.some(({ name }) => name === "steadied");
    const request = { type: "view", raw: true, steadied, width, quality: QUALITY };
    if (JSON.stringify(request) === this.#requested || !this.#send(request)) return;
    this.#requested = JSON.stringify(request);
  }
}
