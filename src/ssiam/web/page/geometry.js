/** Points, boxes and 2×3 transforms; pixels, x right, y down. */

/** @typedef {[[number, number, number], [number, number, number]]} Transform */
/** @typedef {[number, number]} Point */

/** @type {Transform} */
export const IDENTITY = [[1, 0, 0], [0, 1, 0]];

/** @param {Transform} transform @param {Point} point @returns {Point} */
export function mapPoint([[a, b, c], [d, e, f]], [x, y]) {
  return [a * x + b * y + c, d * x + e * y + f];
}

/** @param {Transform} transform @returns {Transform} */
export function inverse([[a, b, c], [d, e, f]]) {
  const determinant = a * e - b * d;
  const [ai, bi, di, ei] = [e, -b, -d, a].map((value) => value / determinant);
  return [[ai, bi, -(ai * c + bi * f)], [di, ei, -(di * c + ei * f)]];
}

/** The corners of a box, clockwise from the upper left one. */
export function cornersOf([x, y, w, h]) {
  return [[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
}

/** The box between two opposite corners. */
export function boxBetween([x0, y0], [x1, y1]) {
  return [Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0)];
}

/** The box with its center mapped by the transform, and its sides scaled by the zoom. */
export function mapBox(transform, [x, y, w, h]) {
  const [cx, cy] = mapPoint(transform, [x + w / 2, y + h / 2]);
  const [[a, b], [d, e]] = transform;
  const zoom = Math.sqrt(Math.abs(a * e - b * d));
  return [cx - w * zoom / 2, cy - h * zoom / 2, w * zoom, h * zoom];
}

export function contains([x, y, w, h], [px, py]) {
  return px >= x && px <= x + w && py >= y && py <= y + h;
}
