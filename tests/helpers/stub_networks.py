"""Stub networks: some return the reference's fixed maps, others detect a marker.

Each has the interface of a `Network` and records its inputs.
"""

import cv2
import numpy as np

from helpers.synthetic import generator

MARKER = (255, 0, 255)  # the same in BGR and RGB
ANCHOR = 2  # index of the anchor of 64 x 64 px


class Stub:
    """Returns ``answer(t, *inputs)`` at call t = 1, 2, ...; `calls` has the inputs."""

    input_shapes = output_shapes = ()
    convolution_count = 0

    def __init__(self, answer):
        self.answer, self.calls = answer, []

    def __call__(self, *inputs):
        self.calls.append(inputs)
        return self.answer(len(self.calls), *inputs)


def kernels(t, crop):
    """A template network that returns the crop itself, in two parts."""
    return [crop[:, :1], crop[:, 1:]]


def fixed_maps(side):
    """Search network that returns the reference's random maps for any crop."""

    def answer(t, crop, *kernels):
        cls = generator(1000 + t).standard_normal((1, 10, side, side)).astype(np.float32)
        loc = (0.3 * generator(2000 + t).standard_normal((1, 20, side, side))).astype(np.float32)
        return [cls, loc]

    return Stub(answer)


def fixed_features():
    """As `fixed_maps`, with the features of a mask network, all zero."""
    maps = fixed_maps(25)
    shapes = ((1, 1, 25, 25), (1, 1, 125, 125), (1, 1, 63, 63), (1, 1, 31, 31))
    features = [np.zeros(shape, np.float32) for shape in shapes]
    return Stub(lambda t, *inputs: [*maps(*inputs), *features])


def fixed_refinement():
    """Refinement network that returns the reference's rotating ellipse with a limb."""

    def answer(t, *windows):
        angle, cx, cy = 0.15 * t + 0.3, 63 + 2 * np.sin(t), 63 + 3 * np.cos(t)
        v, u = np.mgrid[0:127, 0:127].astype(float)
        p = (u - cx) * np.cos(angle) + (v - cy) * np.sin(angle)
        q = -(u - cx) * np.sin(angle) + (v - cy) * np.cos(angle)
        a, b = 34 + t, 20
        body = 6 * (1 - (p / a) ** 2 - (q / b) ** 2)
        limb = 6 * (1 - ((p - a) / 8) ** 2 - ((q - 4) / 14) ** 2)
        logits = np.maximum(np.maximum(body, limb), -12)
        return [logits.reshape(1, -1).astype(np.float32)]

    return Stub(answer)


def fixed_responses():
    """SiamFC's search network that returns the reference's moving peak."""

    def answer(t, crops, kernel):
        px, py = 8 + 2 * np.sin(t), 8 + 1.5 * np.cos(2 * t)
        yy, xx = np.mgrid[0:17, 0:17]
        bump = np.exp(-((xx - px) ** 2 + (yy - py) ** 2) / 8)
        stack = [bump * (0.95 + 0.01 * (t % 7)), bump, bump * (0.95 + 0.01 * (t % 9))]
        noise = 0.02 * generator(3000 + t).standard_normal((3, 17, 17))
        return [(np.stack(stack) + noise).astype(np.float32)[:, None]]

    return Stub(answer)


def marked(crop):
    """Pixels (S, S) of a crop (3, S, S) in the marker's color."""
    return (np.abs(crop - np.array(MARKER)[:, None, None]) < 90).all(axis=0)


def marker_maps(side=25):
    """Search network that puts one anchor exactly on the marker; all scores are low without one."""

    def answer(t, crop, *kernels):
        cls = np.zeros((1, 10, side, side), np.float32)
        cls[:, :5] = 8
        loc = np.zeros((1, 20, side, side), np.float32)
        rows, columns = np.nonzero(marked(crop[0]))
        if len(rows):
            center = (crop.shape[-1] - 1) / 2
            dx, dy = (columns.mean() - center) / 8, (rows.mean() - center) / 8
            column, row = (int(np.clip(np.rint(d) + side // 2, 0, side - 1)) for d in (dx, dy))
            cls[0, ANCHOR, row, column], cls[0, 5 + ANCHOR, row, column] = 0, 8
            regression = (
                (dx - column + side // 2) / 8,
                (dy - row + side // 2) / 8,
                np.log((np.ptp(columns) + 1) / 64),
                np.log((np.ptp(rows) + 1) / 64),
            )
            loc[0, ANCHOR::5, row, column] = regression
        return [cls, loc]

    return Stub(answer)


def marker_cells(crop, side):
    """Logits (side, side), high at the marker's center, and distances (4, side, side) of boxes.

    The boxes of cells near the center are the marker's, those of the others 16 px large.
    """
    logits = np.full((side, side), -8, np.float32)
    distances = np.full((4, side, side), 8, np.float32)
    rows, columns = np.nonzero(marked(crop))
    if len(rows):
        offsets = (np.arange(side) - side // 2) * 16
        y, x = np.meshgrid(offsets, offsets, indexing="ij")
        middle = crop.shape[-1] / 2
        left, right = columns.min() - middle, columns.max() + 1 - middle
        top, bottom = rows.min() - middle, rows.max() + 1 - middle
        near = np.hypot(x - (left + right) / 2, y - (top + bottom) / 2) < 17
        logits[near] = 8
        edges = np.stack([x - left, y - top, right - x, bottom - y])
        distances[:, near] = edges[:, near]
    return logits, distances


def marker_features():
    """As `marker_maps`, with x0 = 1 on the marker: feature i is crop pixel 2 * i + 3."""
    maps = marker_maps()

    def answer(t, crop, *kernels):
        x0 = np.zeros((1, 1, 125, 125), np.float32)
        x0[0, 0] = marked(crop[0])[3:253:2, 3:253:2]
        others = [np.zeros((1, 1, n, n), np.float32) for n in (25, 63, 31)]
        return [*maps(crop), others[0], x0, *others[1:]]

    return Stub(answer)


def marker_refinement():
    """Refinement network with logits of 8 or -8 by the x0 of `marker_features`."""

    def answer(t, x0, p1, p2, corr):
        fine = cv2.resize(x0[0, 0], (122, 122), interpolation=cv2.INTER_NEAREST)
        logits = np.full((127, 127), -8, np.float32)
        logits[2:124, 2:124] += 16 * fine
        return [logits.reshape(1, -1)]

    return Stub(answer)


def marker_responses():
    """SiamFC's search network with a peak on the marker, highest at its true scale."""

    def answer(t, crops, kernel):
        yy, xx = np.mgrid[0:17, 0:17]
        true_area = max(marked(kernel[0]).sum(), 1)
        responses = np.zeros((3, 1, 17, 17), np.float32)
        for crop, response in zip(crops, responses, strict=True):
            rows, columns = np.nonzero(marked(crop))
            if len(rows):
                px, py = columns.mean() / 8 - 7.875, rows.mean() / 8 - 7.875
                height = 4 - 4 * abs(np.log(len(rows) / true_area))
                response += height * np.exp(-((xx - px) ** 2 + (yy - py) ** 2) / 4)
        return [responses]

    return Stub(answer)
