/** The three plots of the page: the camera's shift and turn, the targets' scores. */

import { Plot } from "./plots.js";

const DX = "#5cc8ff";
const DY = "#ffb454";
const DA = "#d7a3ff";
const DEGREES = 180 / Math.PI;

const figure = (id) => document.getElementById(id);

export class Charts {
  #shift = new Plot(figure("plot-shift"), { least: 2 });
  #turn = new Plot(figure("plot-turn"), { least: 0.2 });
  #score = new Plot(figure("plot-score"), { fixed: [0, 1] });

  constructor() {
    const named = (name, colour) => [name, { name, colour }];
    this.#shift.setTraces(new Map([named("dx", DX), named("dy", DY)]));
    this.#turn.setTraces(new Map([named("da", DA)]));
  }

  get #all() {
    return [this.#shift, this.#turn, this.#score];
  }

  /** Take a step in; a motion that cannot be told leaves a gap. */
  add({ time: told, motion, targets }) {
    const time = told ?? performance.now() / 1000;
    const known = motion?.reliable ? motion : null;
    const shifts = known ? [["dx", known.dx], ["dy", known.dy]] : [];
    this.#shift.add(time, new Map(shifts));
    this.#turn.add(time, new Map(known ? [["da", known.angle * DEGREES]] : []));
    this.#score.add(time, new Map(targets.map(({ id, score }) => [id, score])));
    this.#score.setTraces(new Map(targets.map(({ id, name, colour }) => [id, { name, colour }])));
  }

  draw() {
    for (const plot of this.#all) plot.draw();
  }

  describe() {
    this.#shift.describe("Camera shift in pixels a frame");
    this.#turn.describe("Camera turn in degrees a frame");
    this.#score.describe("Scores");
  }

  clear() {
    for (const plot of this.#all) plot.clear();
  }
}
