"""Streams of frames that break estimators of camera motion, and boxes of broken detectors.

A stream is drawn from its seed alone. It changes between the kinds every few frames, within the
frame or at once, so that every kind follows every other one.
"""

from itertools import count

import cv2
import numpy as np

from ssiam.errors import ArgumentError
from ssiam.integrations.host_motion import HostMotion, SceneMotion
from ssiam.motion import CameraMotion, Motion

MODELS = ("similarity", "rigid", "affine", "homography", "mesh")

# px; most streams are small to be fast, some have less pixels than an estimator needs.
SIZES = ((160, 90), (128, 128), (96, 160), (200, 60), (64, 48))
TINY_SIZES = ((1, 1), (2, 3), (7, 5), (16, 9), (31, 17), (300, 2), (3, 120))
MAX_FRAMES_OF_KIND = 12


def lake(rng, size_wh, scene):
    """Waves that move by themselves, with glints; in half of the streams below a sky."""
    x, y = _grid(size_wh)
    time = scene["time"]
    waves = sum(np.sin(fx * x + fy * y + speed * time) for fx, fy, speed in scene["waves"])
    frame = np.clip(90 + 18 * waves, 0, 255)
    frame[rng.random(frame.shape) > 0.995] = 255
    if scene["coin"]:
        frame[: max(size_wh[1] // 3, 1)] = 190
    return _colored(frame)


def gravel(rng, size_wh, scene):
    """Fine random texture under a camera that moves by any distance."""
    width, height = size_wh
    dx, dy = rng.integers(-width, width), rng.integers(-height, height)
    return np.roll(scene["gravel"], (dy, dx) if rng.random() < 0.5 else (1, 2), axis=(0, 1))


def periodic(rng, size_wh, scene):
    """Stripes or a checkerboard: every period fits."""
    x, y = _grid(size_wh)
    period = scene["period"]
    pattern = (x + rng.integers(period)) // (period // 2) + scene["coin"] * (y // (period // 2))
    return _colored(np.where(pattern % 2 == 0, 40, 210))


def one_color(rng, size_wh, scene):
    """Black, white, or another color."""
    width, height = size_wh
    level = rng.choice([0, 0, 255, rng.integers(256)])
    return np.full((height, width, 3), level, np.uint8)


def nearly_black(rng, size_wh, scene):
    """The noise of a covered sensor."""
    return (rng.random((*size_wh[::-1], 3)) > 0.97).astype(np.uint8)


def noise(rng, size_wh, scene):
    """Independent in each frame."""
    return rng.integers(0, 256, (*size_wh[::-1], 3), np.uint8)


def cut(rng, size_wh, scene):
    """Another scene in each frame."""
    return _smooth(rng, size_wh, rng.choice([3, 9, 30]))


def picture(rng, size_wh, scene):
    """The stream's scene under a small motion."""
    return _moved(scene["picture"], rng.normal(0, 2, 2), rng.normal(0, 0.02), 1.0)


def zoom(rng, size_wh, scene):
    """The stream's scene, smaller or larger by any factor."""
    return _moved(scene["picture"], (0, 0), rng.normal(0, 0.3), np.exp(rng.normal(0, 1.5)))


def mirrored(rng, size_wh, scene):
    """The stream's scene, mirrored or upside down."""
    return np.ascontiguousarray(cv2.flip(scene["picture"], int(rng.integers(-1, 2))))


def flicker(rng, size_wh, scene):
    """The stream's scene under light that changes, up to inverted."""
    gain, offset = rng.choice([0.05, 0.3, 1.0, 3.0, -1.0]), rng.integers(-120, 250)
    moved = picture(rng, size_wh, scene)
    return np.clip(moved * gain + offset, 0, 255).astype(np.uint8)


def torn(rng, size_wh, scene):
    """A decoder's damage: half of the frame black, gray, of another frame, or shifted."""
    frame = picture(rng, size_wh, scene)
    rows = slice(rng.integers(size_wh[1]), None)
    part = frame[rows]
    others = (np.zeros_like(part), np.full_like(part, 128), cut(rng, size_wh, scene)[rows])
    frame[rows] = (*others, np.roll(part, rng.integers(size_wh[0]), axis=1))[rng.integers(4)]
    return frame if rng.random() < 0.5 else np.ascontiguousarray(frame[::-1, ::-1])


def one_pixel(rng, size_wh, scene):
    """One bright pixel, or one bright line, in nothing."""
    frame = np.zeros((*size_wh[::-1], 3), np.uint8)
    frame[rng.integers(size_wh[1]), slice(None) if scene["coin"] else rng.integers(size_wh[0])] = (
        255
    )
    return frame


KINDS = (
    *(lake, gravel, periodic, one_color, nearly_black, noise, cut),
    *(picture, zoom, mirrored, flicker, torn, one_pixel),
)


def stream(seed):
    """Endless (kind, frame) of a stream; all frames have one size."""
    rng = np.random.default_rng(seed)
    sizes = TINY_SIZES if rng.random() < 0.15 else SIZES
    size_wh = sizes[rng.integers(len(sizes))]
    scene = {
        "waves": rng.normal(0, (0.3, 0.3, 2), (6, 3)),
        "gravel": rng.integers(60, 200, (*size_wh[::-1], 3), np.uint8),
        "picture": _smooth(rng, size_wh, 9),
        "period": int(rng.integers(2, 40)),
        "coin": bool(rng.random() < 0.5),
        "time": 0,
    }
    for draw in (KINDS[rng.integers(len(KINDS))] for _ in count()):
        for _ in range(rng.integers(1, MAX_FRAMES_OF_KIND)):
            scene["time"] += 1
            yield draw.__name__, draw(rng, size_wh, scene)


def hostile_boxes(rng, size_wh):
    """Boxes left, top, right, bottom of a broken detector, and whether all of them are finite."""
    width, height = size_wh
    rows = rng.uniform(-0.2, 1.2, (rng.integers(0, 8), 4)) * (width, height, width, height)
    odd = rng.integers(6)
    if len(rows) and odd == 0:
        rows[0, rng.integers(4)] = rng.choice([np.nan, np.inf, -np.inf])
    if len(rows) and odd == 1:
        rows[-1] = (-1e300, -1e300, 1e300, 1e300)
    if odd == 2:
        rows = np.array([[0, 0, width, height]], np.float64)
    if odd > 2:
        rows = np.sort(rows.reshape(-1, 2, 2), axis=1).reshape(-1, 4)
    return rows, bool(np.isfinite(rows).all())


def _grid(size_wh):
    width, height = size_wh
    return np.arange(width)[None, :], np.arange(height)[:, None]


def _colored(gray):
    return np.repeat(gray.astype(np.uint8)[:, :, None], 3, axis=2)


def _smooth(rng, size_wh, cells):
    coarse = rng.integers(0, 256, (cells, cells, 3), np.uint8)
    return cv2.resize(coarse, size_wh, interpolation=cv2.INTER_CUBIC)


def _moved(image, shift_xy, angle, scale):
    height, width = image.shape[:2]
    to_from_from = cv2.getRotationMatrix2D((width / 2, height / 2), np.degrees(angle), scale)
    to_from_from[:, 2] += shift_xy
    return cv2.warpAffine(image, to_from_from, (width, height), borderMode=cv2.BORDER_REFLECT)


def checked_stream(seed, count):
    """(kind, reliable, fault) of the first frames of a stream; the fault is "" if all is well.

    Each stream goes through `CameraMotion` with one of the models, and through one of the two parts
    that the adapters consist of. Boxes that are not finite are refused by the first and ignored by
    the others.
    """
    camera = CameraMotion(model=MODELS[seed % len(MODELS)])
    host = HostMotion() if seed // len(MODELS) % 2 else SceneMotion()
    rng = np.random.default_rng([seed, 1])
    for (kind, frame), _ in zip(stream(seed), range(count), strict=False):
        boxes, all_finite = hostile_boxes(rng, frame.shape[1::-1])
        try:
            motion = _motion(camera, frame, boxes, all_finite)
            fault = _fault(motion) or _host_fault(host, frame, boxes)
        except Exception as error:
            yield kind, False, f"{type(error).__name__}: {error}"
        else:
            yield kind, motion.reliable, fault


def _motion(camera, frame, boxes, all_finite):
    low, size = boxes[:, :2], boxes[:, 2:] - boxes[:, :2]
    xywh = np.hstack([low, size])
    if all_finite:
        return camera.update(frame, xywh)
    try:
        camera.update(frame, xywh)
    except ArgumentError:
        return camera.update(frame)
    raise AssertionError(f"boxes are accepted: {xywh.tolist()}")


def _fault(motion):
    if not motion.is_plausible:
        return f"not plausible: {motion.cur_from_prev.tolist()}"
    corner = Motion(motion.at((0.0, 0.0)), 1.0, True, motion.size_wh)
    if not corner.is_plausible:
        return f"not plausible at a corner: {corner.cur_from_prev.tolist()}"
    if not motion.reliable and not np.array_equal(motion.cur_from_prev, np.eye(3)):
        return f"not reliable, but not the identity: {motion.cur_from_prev.tolist()}"
    return ""


def _host_fault(host, frame, boxes):
    if isinstance(host, HostMotion):
        matrix = np.vstack([host.affine(frame, boxes), (0, 0, 1)])
        return _fault(Motion(matrix, 1.0, True, frame.shape[1::-1]))
    matrix = host.update(frame, boxes).homography_matrix
    is_invertible = np.isfinite([matrix, np.linalg.inv(matrix)]).all()
    return "" if is_invertible else f"the scene is lost: {matrix.tolist()}"
