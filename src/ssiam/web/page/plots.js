/** Plots of the last ten seconds: camera motion and scores, the newest values at the right. */

const DX = "var(--plot-dx)";
const DY = "var(--plot-dy)";
const ROTATION = "var(--plot-rotation)";
const DEGREES = 180 / Math.PI; // in a radian
const SPAN = 10; // seconds
const MAX_POINTS = 2400; // per trace
const MAX_GAP = 1.5; // seconds without a value after which a line is interrupted
const FONT = "11px system-ui, sans-serif";
const BACKGROUND = "var(--plot)";
const GRID = "var(--line)";
const LABELS = "var(--muted)";
const VARIABLE = /^var\((.+)\)$/;
const LEFT = 40; // CSS pixels, as all lengths here
const TOP = 22; // height of the caption
const MARGIN = 5;

const byId = (id) => document.getElementById(id);

/** @typedef {{name: string, color: string}} Trace */

/** A color for the canvas: the value that the theme gives a variable of the style sheets. */
function resolved(color) {
  const variable = VARIABLE.exec(color)?.[1];
  return variable ? getComputedStyle(document.documentElement).getPropertyValue(variable) : color;
}

/** Some traces over the same time, in the same unit. */
class Plot {
  #points = []; // [time, Map from trace key to value], oldest first
  /** @type {Map<string | number, Trace>} */ #traces = new Map();
  #range;
  #context;
  #key;

  /**
   * @param {HTMLElement} figure
   * @param {{minimum: number} | {fixed: [number, number]}} range symmetric and at least ±minimum, or fixed
   */
  constructor(figure, range) {
    this.canvas = figure.querySelector("canvas");
    this.#context = this.canvas.getContext("2d", { alpha: false });
    this.#key = figure.querySelector(".key");
    this.#range = range;
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  /** Set the names and colors of the traces; others are not drawn. */
  setTraces(traces) {
    const same = JSON.stringify([...traces]) === JSON.stringify([...this.#traces]);
    this.#traces = traces;
    if (!same) this.#key.replaceChildren(...[...traces.values()].map(keyEntry));
  }

  /** Add the values at a time; a time before the last one clears the plot. */
  add(time, values) {
    if (this.#points.length && time < this.#points.at(-1)[0]) this.clear();
    if (this.#points.at(-1)?.[0] === time) this.#points.pop();
    this.#points.push([time, values]);
    const old = this.#points.findIndex(([when]) => when >= time - SPAN);
    this.#points.splice(0, Math.max(old, this.#points.length - MAX_POINTS));
  }

  clear() {
    this.#points.length = 0;
  }

  /** Draw the plot. */
  draw() {
    const { canvas } = this;
    const context = this.#context;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const [pixelWidth, pixelHeight] = [width, height].map((value) => Math.round(value * devicePixelRatio));
    if (canvas.width !== pixelWidth || canvas.height !== pixelHeight) {
      [canvas.width, canvas.height] = [pixelWidth, pixelHeight];
    }
    context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    context.fillStyle = resolved(BACKGROUND);
    context.fillRect(0, 0, width, height);
    const [low, high] = this.#limits();
    const end = this.#points.at(-1)?.[0] ?? 0;
    const x = (time) => width - MARGIN - ((end - time) / SPAN) * (width - LEFT - MARGIN);
    const y = (value) => height - MARGIN - ((value - low) / (high - low)) * (height - TOP - MARGIN);
    this.#drawGrid(width, [low, (low + high) / 2, high], y, (second) => x(end - second));
    for (const [key, { color }] of this.#traces) this.#drawTrace(key, color, x, y);
  }

  /** Describe the newest values for screen readers. */
  describe(title) {
    const values = this.#points.at(-1)?.[1] ?? new Map();
    const parts = [...this.#traces].map(([key, { name }]) => {
      return `${name} ${values.get(key)?.toFixed(2) ?? "unknown"}`;
    });
    this.canvas.setAttribute("aria-label", `${title}: ${parts.join(", ") || "no values yet"}`);
  }

  #limits() {
    if (this.#range.fixed) return this.#range.fixed;
    let limit = this.#range.minimum;
    for (const [, values] of this.#points) {
      for (const key of this.#traces.keys()) limit = Math.max(limit, Math.abs(values.get(key) ?? 0));
    }
    return [-roundUp(limit), roundUp(limit)];
  }

  #drawGrid(width, values, y, atSecond) {
    const context = this.#context;
    context.font = FONT;
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.lineWidth = 1;
    context.strokeStyle = resolved(GRID);
    context.fillStyle = resolved(LABELS);
    const [low, , high] = values;
    context.beginPath();
    for (const value of values) {
      context.moveTo(LEFT, Math.round(y(value)) + 0.5);
      context.lineTo(width - MARGIN, Math.round(y(value)) + 0.5);
    }
    for (let second = 0; second <= SPAN; second += 2) {
      context.moveTo(Math.round(atSecond(second)) - 0.5, y(low));
      context.lineTo(Math.round(atSecond(second)) - 0.5, y(high));
    }
    context.stroke();
    context.fillText(short(high), LEFT - 4, y(high) + 5);
    context.fillText(short(low), LEFT - 4, y(low) - 5);
  }

  #drawTrace(key, color, x, y) {
    const context = this.#context;
    context.strokeStyle = resolved(color);
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    context.beginPath();
    let last = -Infinity;
    for (const [time, values] of this.#points) {
      const value = values.get(key) ?? null;
      if (value === null) continue;
      if (time - last > MAX_GAP) context.moveTo(x(time), y(value));
      context.lineTo(x(time), y(value));
      last = time;
    }
    context.stroke();
  }
}

/** The three plots of the page: camera shift, camera rotation, scores of the targets. */
export class Charts {
  #shift = new Plot(byId("plot-shift"), { minimum: 2 });
  #rotation = new Plot(byId("plot-rotation"), { minimum: 0.2 });
  #score = new Plot(byId("plot-score"), { fixed: [0, 1] });

  constructor() {
    const named = (name, color) => [name, { name, color }];
    this.#shift.setTraces(new Map([named("dx", DX), named("dy", DY)]));
    this.#rotation.setTraces(new Map([named("angle", ROTATION)]));
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.draw());
  }

  get #all() {
    return [this.#shift, this.#rotation, this.#score];
  }

  /** Add a step; an unreliable motion leaves a gap. */
  add({ time: frameTime, motion, targets }) {
    const time = frameTime ?? performance.now() / 1000;
    const known = motion?.reliable ? motion : null;
    const shifts = known ? [["dx", known.dx], ["dy", known.dy]] : [];
    this.#shift.add(time, new Map(shifts));
    this.#rotation.add(time, new Map(known ? [["angle", known.angle * DEGREES]] : []));
    this.#score.add(time, new Map(targets.map(({ id, score }) => [id, score])));
    this.#score.setTraces(
      new Map(targets.map(({ id, name, colour: color }) => [id, { name, color }])),
    );
  }

  draw() {
    for (const plot of this.#all) plot.draw();
  }

  describe() {
    this.#shift.describe("Camera shift in pixels per frame");
    this.#rotation.describe("Camera rotation in degrees per frame");
    this.#score.describe("Scores");
  }

  clear() {
    for (const plot of this.#all) plot.clear();
  }
}

/** Round up to 1, 2 or 5 times a power of ten. */
function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.999);
}

function short(value) {
  return String(Number(value.toPrecision(2))).replace("-", "−");
}

function keyEntry({ name, color }) {
  const entry = document.createElement("span");
  const mark = document.createElement("i");
  mark.style.backgroundColor = color;
  entry.append(mark, name);
  return entry;
}
