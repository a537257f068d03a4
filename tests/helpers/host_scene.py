"""A real clip from a shaking camera, and boxes of small things that stand still in its scene."""

import importlib
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from ssiam.geometry import frame_center, map_points, rigid

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
COUNT = 40  # frames
SIDE = 24  # px of a box; half of the motions between two frames are larger than 18 px
CENTERS = np.array([(x, y) for x in (150, 270, 390, 510) for y in (90, 180, 270)], np.float64)


def frames():
    """The first frames (H, W, 3) of the example clip."""
    video = cv2.VideoCapture(str(EXAMPLES / "shaky-walker.mp4"))
    return [video.read()[1] for _ in range(COUNT)]


def boxes():
    """left, top, right, bottom (12, 4) in each frame, by the true motion of the image."""
    rows = np.loadtxt(EXAMPLES / "shaky-walker-motion.csv", delimiter=",", skiprows=1)
    poses = [rigid(dx, dy, angle, frame_center((640, 360))) for _, dx, dy, angle in rows[:COUNT]]
    centers = [map_points(pose, CENTERS) for pose in poses]
    return [np.hstack([each - SIDE / 2, each + SIDE / 2]) for each in centers]


def switches(identities):
    """How often a thing changes its identity; `identities` are lists (12,), None without one."""
    last, count = {}, 0
    for found in identities:
        for thing, identity in enumerate(found):
            if identity is not None:
                count += last.get(thing, identity) != identity
                last[thing] = identity
    return count


def roboflow_trackers():
    """The package `trackers`, which tests/trackers is not; skips the test without it."""
    pytest.importorskip("trackers.core.base", exc_type=ImportError)
    return importlib.import_module("trackers")


def assert_kept(identities):
    """Every thing has one identity, and has it in the last frames."""
    assert switches(identities) == 0
    assert all(len(set(found) - {None}) == len(CENTERS) for found in identities[-10:])


def assert_not_kept(identities):
    """Identities change, or most boxes have none."""
    with_identity = sum(one is not None for found in identities for one in found)
    assert switches(identities) > 20 or with_identity < len(CENTERS) * COUNT / 2


def by_index(pairs):
    """Identities (12,) of pairs of an index and an identity."""
    found = [None] * len(CENTERS)
    for index, identity in pairs:
        found[int(index)] = int(identity)
    return found


def hostile(frame):
    """Frames that a camera may give after `frame`: black, noise, smaller, gray, and again."""
    noise = np.random.default_rng(0).integers(0, 256, frame.shape, np.uint8)
    return [np.zeros_like(frame), noise, frame, noise[:180, :320], frame]


def run_example(name):
    """Run the example of an adapter in the documentation, on a part of the example clip."""
    page = (ROOT / "docs" / "how-to" / "other-trackers.md").read_text(encoding="utf-8")
    detector, *examples = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (example,) = [code for code in examples if f"ssiam.integrations.{name} " in code]
    scope = {}
    exec(detector, scope)
    scope["frames"] = lambda: frames()[:5]
    exec(example, scope)
    return scope
