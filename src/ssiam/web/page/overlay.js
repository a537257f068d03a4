/** Draws targets over an image. */

import { cornersOf, mapPoint } from "./geometry.js";

const FONT = "600 12px system-ui, sans-serif"; // CSS pixels, as all lengths here
const LINE = 18;
const GAP = 6;
const DASHES = [7, 5];
const DARK = "rgb(8 12 15 / 82%)";
const LOST = "#ff8f8f";
const SELECTION = "#ffffff";
const HANDLE = matchMedia("(pointer: coarse)").matches ? 7 : 4; // half of a handle's side

/**
 * @typedef {object} Surface
 * @property {CanvasRenderingContext2D} context in CSS pixels
 * @property {number} width
 * @property {number} height
 * @property {number} scale CSS pixels per frame pixel
 * @property {import("./geometry.js").Transform} viewFromRaw
 */

/**
 * Draw boxes with names and scores, and the names of lost targets in the lower left corner.
 * @param {Surface} surface
 * @param {(import("./steps.js").Target & {guide?: boolean})[]} targets a guide is dashed
 * @param {(target: object) => "tracking" | "lost" | "found"} stateOf
 * @param {number | null} selected
 */
export function drawTargets(surface, targets, stateOf, selected) {
  const lost = [];
  for (const target of targets) {
    if (target.lost) lost.push(target.name);
    else drawTarget(surface, target, stateOf(target) === "found", target.id === selected);
  }
  lost.forEach((name, line) => {
    const y = surface.height - GAP - (lost.length - line) * LINE;
    drawLabel(surface, `LOST ${name}`, GAP, y, LOST, DARK);
  });
}

/** Draw the box that the user is drawing, in pixels of the view. */
export function drawSelection({ context, scale }, [x, y, w, h]) {
  const corners = cornersOf([x, y, w, h]).map((corner) => corner.map((value) => value * scale));
  context.fillStyle = "rgb(255 255 255 / 12%)";
  context.fillRect(x * scale, y * scale, w * scale, h * scale);
  drawOutline(context, corners, SELECTION, 1.5);
}

function drawTarget(surface, target, found, selected) {
  const { context, scale, viewFromRaw } = surface;
  const { colour: color } = target;
  const toView = (points) =>
    points.map((point) => mapPoint(viewFromRaw, point).map((value) => value * scale));
  const box = toView(cornersOf(target.box));
  const lineWidth = (found ? 4 : 2) + (selected ? 1 : 0);
  context.setLineDash(target.guide ? DASHES : []);
  drawOutline(context, box, color, target.corners ? 1 : lineWidth);
  context.setLineDash([]);
  if (target.corners) drawOutline(context, toView(target.corners), color, lineWidth);
  if (selected && !target.guide) drawHandles(context, box, color);
  const points = target.corners ? [...box, ...toView(target.corners)] : box;
  const score = target.score === null ? "" : ` ${target.score.toFixed(2)}`;
  const text = `${found ? "FOUND " : ""}${target.name}${score}`;
  const colors = found ? [DARK, color] : [color, DARK];
  drawLabel(surface, text, ...labelPosition(surface, points), ...colors);
}

/** Position of a label above the points, or below them if there is no room. */
function labelPosition({ height }, points) {
  const top = Math.min(...points.map(([, y]) => y)) - LINE - GAP / 2;
  const bottom = Math.max(...points.map(([, y]) => y)) + GAP / 2;
  const y = top >= 0 ? top : bottom;
  return [Math.min(...points.map(([x]) => x)), Math.max(0, Math.min(y, height - LINE))];
}

function drawOutline(context, points, color, width) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  context.closePath();
  context.lineJoin = "round";
  for (const [style, lineWidth] of [["rgb(0 0 0 / 60%)", width + 2], [color, width]]) {
    context.strokeStyle = style;
    context.lineWidth = lineWidth;
    context.stroke();
  }
}

/** Handles at the corners of an upright box, beside them for a finger: they must not hide it. */
function drawHandles(context, points, color) {
  const offset = HANDLE > 4 ? HANDLE : 0;
  for (const [index, [cornerX, cornerY]] of points.entries()) {
    const x = cornerX + (index === 0 || index === 3 ? -offset : offset);
    const y = cornerY + (index < 2 ? -offset : offset);
    context.fillStyle = DARK;
    context.fillRect(x - HANDLE, y - HANDLE, 2 * HANDLE, 2 * HANDLE);
    context.fillStyle = color;
    context.fillRect(x - HANDLE + 1, y - HANDLE + 1, 2 * HANDLE - 2, 2 * HANDLE - 2);
  }
}

function drawLabel({ context, width }, text, x, y, color, background) {
  context.font = FONT;
  context.textBaseline = "middle";
  const labelWidth = Math.min(context.measureText(text).width + 2 * GAP, width);
  const left = Math.max(0, Math.min(x, width - labelWidth));
  context.fillStyle = background;
  context.fillRect(left, y, labelWidth, LINE);
  context.fillStyle = color;
  context.fillText(text, left + GAP, y + LINE / 2 + 0.5, labelWidth - 2 * GAP);
}
