/** Plots of the last ten seconds, drawn like an oscilloscope's: newest at the right. */

const SPAN = 10; // seconds
const MOST = 2400; // points of a trace
const BREAK = 1.5; // seconds without a value that a line does not bridge
const FONT = "11px system-ui, sans-serif";
const GROUND = "#10171c";
const GRID = "#2a353f";
const LETTERS = "#93a2af";
const LEFT = 40; // CSS pixels, as all lengths here
const TOP = 22; // where the caption is
const EDGE = 5;

/** @typedef {{name: string, colour: string}} Trace */

/** One plot: some traces over the same time, in the same unit. */
export class Plot {
  #points = []; // [time, Map from the trace's key to its value], oldest first
  /** @type {Map<string | number, Trace>} */ #traces = new Map();
  #range;
  #context;
  #key;

  /**
   * @param {HTMLElement} figure
   * @param {{least: number} | {fixed: [number, number]}} range symmetric and at least ±least, or fixed
   */
  constructor(figure, range) {
    this.canvas = figure.querySelector("canvas");
    this.#context = this.canvas.getContext("2d", { alpha: false });
    this.#key = figure.querySelector(".key");
    this.#range = range;
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  /** What the traces are called and coloured; others are not drawn. */
  setTraces(traces) {
    const same = JSON.stringify([...traces]) === JSON.stringify([...this.#traces]);
    this.#traces = traces;
    if (!same) this.#key.replaceChildren(...[...traces.values()].map(keyEntry));
  }

  /** Take the values of a moment in; a time before the last one starts the plot anew. */
  add(time, values) {
    if (this.#points.length && time < this.#points.at(-1)[0]) this.clear();
    if (this.#points.at(-1)?.[0] === time) this.#points.pop();
    this.#points.push([time, values]);
    const old = this.#points.findIndex(([when]) => when >= time - SPAN);
    this.#points.splice(0, Math.max(old, this.#points.length - MOST));
  }

  clear() {
    this.#points.length = 0;
  }

  /** Draw, and say in words what the plot shows. */
  draw() {
    const { canvas } = this;
    const context = this.#context;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const [wide, high] = [width, height].map((value) => Math.round(value * devicePixelRatio));
    if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
    context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    context.fillStyle = GROUND;
    context.fillRect(0, 0, width, height);
    const [low, top] = this.#limits();
    const end = this.#points.at(-1)?.[0] ?? 0;
    const x = (time) => width - EDGE - ((end - time) / SPAN) * (width - LEFT - EDGE);
    const y = (value) => height - EDGE - ((value - low) / (top - low)) * (height - TOP - EDGE);
    this.#drawGrid(width, [low, (low + top) / 2, top], y, (second) => x(end - second));
    for (const [key, { colour }] of this.#traces) this.#drawTrace(key, colour, x, y);
  }

  /** The newest values, in words. */
  describe(what) {
    const values = this.#points.at(-1)?.[1] ?? new Map();
    const parts = [...this.#traces].map(([key, { name }]) => {
      return `${name} ${values.get(key)?.toFixed(2) ?? "unknown"}`;
    });
    this.canvas.setAttribute("aria-label", `${what}: ${parts.join(", ") || "nothing yet"}`);
  }

  #limits() {
    if (this.#range.fixed) return this.#range.fixed;
    let most = this.#range.least;
    for (const [, values] of this.#points) {
      for (const key of this.#traces.keys()) most = Math.max(most, Math.abs(values.get(key) ?? 0));
    }
    return [-rounded(most), rounded(most)];
  }

  #drawGrid(width, values, y, atSecond) {
    const context = this.#context;
    context.font = FONT;
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.lineWidth = 1;
    context.strokeStyle = GRID;
    context.fillStyle = LETTERS;
    const [low, , top] = values;
    context.beginPath();
    for (const value of values) {
      context.moveTo(LEFT, Math.round(y(value)) + 0.5);
      context.lineTo(width - EDGE, Math.round(y(value)) + 0.5);
    }
    for (let second = 0; second <= SPAN; second += 2) {
      context.moveTo(Math.round(atSecond(second)) - 0.5, y(low));
      context.lineTo(Math.round(atSecond(second)) - 0.5, y(top));
    }
    context.stroke();
    context.fillText(short(top), LEFT - 4, y(top) + 5);
    context.fillText(short(low), LEFT - 4, y(low) - 5);
  }

  #drawTrace(key, colour, x, y) {
    const context = this.#context;
    context.strokeStyle = colour;
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    context.beginPath();
    let last = -Infinity;
    for (const [time, values] of this.#points) {
      const value = values.get(key) ?? null;
      if (value === null) continue;
      if (time - last > BREAK) context.moveTo(x(time), y(value));
      context.lineTo(x(time), y(value));
      last = time;
    }
    context.stroke();
  }
}

/** The next of 1, 2, 5, 10, ... (or 0.1, 0.2, ...) that is not below the value. */
function rounded(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.999);
}

function short(value) {
  return String(Number(value.toPrecision(2))).replace("-", "−");
}

function keyEntry({ name, colour }) {
  const entry = document.createElement("span");
  const mark = document.createElement("i");
  mark.style.backgroundColor = colour;
  entry.append(mark, name);
  return entry;
}
