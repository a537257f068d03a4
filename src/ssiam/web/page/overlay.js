/** Targets, drawn over a picture. */

import { cornersOf, mapPoint } from "./geometry.js";

const FONT = "600 12px system-ui, sans-serif"; // CSS pixels, as all lengths here
const LINE = 18;
const GAP = 6;
const INK = "rgb(8 12 15 / 82%)";
const LOST = "#ff8f8f";
const BAND = "#ffffff";

/**
 * @typedef {object} Ground what is drawn on
 * @property {CanvasRenderingContext2D} context in CSS pixels
 * @property {number} width
 * @property {number} height
 * @property {number} scale CSS pixels to a frame pixel
 * @property {import("./geometry.js").Transform} viewFromRaw
 */

/**
 * Boxes with names and scores; lost targets as a line in the lower left corner.
 * @param {Ground} ground
 * @param {import("./steps.js").Target[]} targets
 * @param {(target: object) => "tracking" | "lost" | "found"} stateOf
 * @param {number | null} selected
 */
export function drawTargets(ground, targets, stateOf, selected) {
  const lost = [];
  for (const target of targets) {
    if (target.lost) lost.push(target.name);
    else drawTarget(ground, target, stateOf(target) === "found", target.id === selected);
  }
  lost.forEach((name, line) => {
    const y = ground.height - GAP - (lost.length - line) * LINE;
    tag(ground, `LOST ${name}`, GAP, y, LOST, INK);
  });
}

/** The box that is being drawn, in the view's own pixels. */
export function drawBand({ context, scale }, [x, y, w, h]) {
  const corners = cornersOf([x, y, w, h]).map((corner) => corner.map((value) => value * scale));
  context.fillStyle = "rgb(255 255 255 / 12%)";
  context.fillRect(x * scale, y * scale, w * scale, h * scale);
  outline(context, corners, BAND, 1.5);
}

function drawTarget(ground, target, found, selected) {
  const { context, scale, viewFromRaw } = ground;
  const placed = (points) =>
    points.map((point) => mapPoint(viewFromRaw, point).map((value) => value * scale));
  const box = placed(cornersOf(target.box));
  const weight = (found ? 4 : 2) + (selected ? 1 : 0);
  outline(context, box, target.colour, target.corners ? 1 : weight);
  if (target.corners) outline(context, placed(target.corners), target.colour, weight);
  if (selected) handles(context, box, target.colour);
  const drawn = target.corners ? [...box, ...placed(target.corners)] : box;
  const text = `${found ? "FOUND " : ""}${target.name} ${target.score.toFixed(2)}`;
  const colours = found ? [INK, target.colour] : [target.colour, INK];
  tag(ground, text, ...beside(ground, drawn), ...colours);
}

/** Place of a label over what is drawn; under it if there is no room. */
function beside({ height }, points) {
  const top = Math.min(...points.map(([, y]) => y)) - LINE - GAP / 2;
  const bottom = Math.max(...points.map(([, y]) => y)) + GAP / 2;
  const y = top >= 0 ? top : bottom;
  return [Math.min(...points.map(([x]) => x)), Math.max(0, Math.min(y, height - LINE))];
}

function outline(context, points, colour, width) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  context.closePath();
  context.lineJoin = "round";
  for (const [style, thick] of [["rgb(0 0 0 / 60%)", width + 2], [colour, width]]) {
    context.strokeStyle = style;
    context.lineWidth = thick;
    context.stroke();
  }
}

function handles(context, points, colour) {
  for (const [x, y] of points) {
    context.fillStyle = INK;
    context.fillRect(x - 4, y - 4, 8, 8);
    context.fillStyle = colour;
    context.fillRect(x - 3, y - 3, 6, 6);
  }
}

function tag({ context, width }, text, x, y, colour, ground) {
  context.font = FONT;
  context.textBaseline = "middle";
  const wide = Math.min(context.measureText(text).width + 2 * GAP, width);
  const left = Math.max(0, Math.min(x, width - wide));
  context.fillStyle = ground;
  context.fillRect(left, y, wide, LINE);
  context.fillStyle = colour;
  context.fillText(text, left + GAP, y + LINE / 2 + 0.5, wide - 2 * GAP);
}
