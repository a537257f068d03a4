"""Overlaps against masks that are drawn pixel by pixel."""

import numpy as np
import pytest
from hypothesis import given, settings

from helpers.any_regions import BOUNDS, POLYGONS
from ssiam.evaluation.measures.overlap import toolkit_overlap, vot_overlap


def drawn(polygon, width, height, closed):
    """Mask of a polygon with integer corners, filled row by row as in the toolkits."""
    polygon = polygon.astype(np.float64)
    mask = np.zeros((height, width), bool)
    for row in range(height):
        nodes = []
        for i in range(4):
            (x, y), (px, py) = polygon[i], polygon[i - 1]
            if not min(y, py) <= row <= max(y, py) or (y == py and not closed):
                continue
            nodes.append(int(x + (row - y) / (py - y) * (px - x)) if y != py else int(x))
        nodes.sort()
        i = 0
        while i < len(nodes) - 1:
            if nodes[i] == nodes[i + 1] and (not closed or i < len(nodes) - 2):
                i += 1
                continue
            mask[row, max(nodes[i], 0) : max(nodes[i + 1] + 1, 0)] = True
            i += 2
    return mask


def away_from_zero(values):
    return np.sign(values) * np.floor(np.abs(values) + 0.5)


@settings(max_examples=150, deadline=None)
@given(a=POLYGONS, b=POLYGONS)
def test_vot_overlap_is_the_overlap_of_drawn_masks(a, b):
    sides = [polygon.reshape(4, 2).astype(np.float32) for polygon in (a, b)]
    low = [np.maximum(np.floor(p.min(axis=0)), 0) for p in sides]
    high = [np.minimum(np.ceil(p.max(axis=0)), BOUNDS) for p in sides]
    found = vot_overlap(a, b, BOUNDS)[0]
    if any((end <= start).any() for start, end in zip(low, high, strict=True)):
        return  # one is outside of the image; covered by the golden numbers
    both = np.minimum(*high) - np.maximum(*low)
    if both.prod() <= 0:
        assert found == 0
        return
    if both.max() < 0:
        assert not found > 0  # 0, or nan if neither covers a pixel
        return
    corner = np.minimum(*low)
    width, height = (np.maximum(*high) - corner).astype(int) + 1
    masks = [drawn(away_from_zero(p - corner), width, height, closed=False) for p in sides]
    covered = (masks[0] | masks[1]).sum()
    if covered == 0:
        assert np.isnan(found)
    else:
        assert found == pytest.approx((masks[0] & masks[1]).sum() / covered, abs=1e-6)


@settings(max_examples=150, deadline=None)
@given(a=POLYGONS, b=POLYGONS)
def test_toolkit_overlap_is_the_overlap_of_drawn_masks(a, b):
    sides = [np.round(polygon.reshape(4, 2).astype(np.float32)) for polygon in (a, b)]
    low = np.maximum(np.min([p.min(axis=0) for p in sides], axis=0), 0)
    high = np.minimum(np.max([p.max(axis=0) for p in sides], axis=0), np.array(BOUNDS) - 1)
    found = toolkit_overlap(a, b, BOUNDS)[0]
    if (low >= high).any():
        return
    width, height = (high - low).astype(int) + 1
    masks = [drawn(p - low, width, height, closed=True) for p in sides]
    covered = (masks[0] | masks[1]).sum()
    expected = (masks[0] & masks[1]).sum() / covered if covered else 0
    assert found == pytest.approx(expected, abs=1e-9)
