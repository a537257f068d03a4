"""One camera-motion estimator, run over clips on request: the worker of benchmarks/motion/compare.py.

    python motion_estimators.py NAME

It runs inside the estimator's own environment, and so imports nothing but NumPy, OpenCV and that
estimator's package. It first writes a line {"versions": {...}}; then for every line of JSON read,

    {"clip": "clip.npz with frames (N, H, W, 3) and boxes (N, 4)", "exclude": true}

it writes one: {"cur_from_prev": (N, 3, 3), "reliable": (N,), "ms": (N,)}, or {"failed": why}.
A clip is run with a new estimator on one OpenCV thread. Estimators that can leave a target out are
given its box of the frame before, if "exclude" is true. Where an estimator tells nothing (None, or
numbers that are not finite), the frame is unreliable and the camera stands still.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any, TextIO, TypeAlias

import cv2
import numpy as np

Box: TypeAlias = np.ndarray | None  # (4,) x, y, w, h of the target in the frame before
Told: TypeAlias = tuple[np.ndarray | None, bool]  # cur_from_prev (3, 3), reliable
Estimate: TypeAlias = Callable[[np.ndarray, Box], Told]


def ssiam_camera(keypoints: str, *words: str) -> Estimate:
    """`CameraMotion` with these keypoints; `words` may name its model and its fit."""
    import ssiam

    options = {"fit" if word == "least_squares" else "model": word for word in words}
    camera = ssiam.CameraMotion(keypoints, **options)

    def estimate(frame: np.ndarray, box: Box) -> Told:
        motion = camera.update(frame, exclude=box)
        return motion.cur_from_prev, motion.reliable

    return estimate


def vidstab(kp_method: str) -> Estimate:
    """What `VidStab.stabilize_frame` does up to the transform it sums up; no smoothing, no warp."""
    from vidstab import VidStab

    stabilizer = VidStab(kp_method.upper())
    stabilizer.frame_queue.reset_queue(max_len=31, max_frames=math.inf)

    def estimate(frame: np.ndarray, box: Box) -> Told:
        if stabilizer.prev_gray is None:
            stabilizer._process_first_frame(array=frame)
            return None, True
        stabilizer.frame_queue.read_frame(array=frame, pop_ind=False)
        stabilizer._gen_next_raw_transform()
        return _rigid_at_origin(*stabilizer._raw_transforms[-1]), True

    return estimate


def vidgear() -> Estimate:
    """What the zero-latency stabiliser adds to its trajectory at each frame; no filter, no warp."""
    from vidgear.gears.stabilizer import Stabilizer, StabilizerMode

    stabilizer = Stabilizer(mode=StabilizerMode.KALMAN)
    previous: list[Any] = []

    def estimate(frame: np.ndarray, box: Box) -> Told:
        gray = stabilizer._to_gray(frame)
        motion = stabilizer._estimate_motion(*previous, gray) if previous else None
        previous[:] = gray, stabilizer._detect_keypoints(gray)
        return None if motion is None else _rigid_at_origin(*motion), True

    return estimate


def norfair() -> Estimate:
    """The homography from the frame before, out of the two from the reference frame."""
    from norfair.camera_motion import HomographyTransformationGetter, MotionEstimator

    estimator = MotionEstimator(transformations_getter=HomographyTransformationGetter())
    prev_from_reference = np.eye(3)

    def estimate(frame: np.ndarray, box: Box) -> Told:
        nonlocal prev_from_reference
        transformation = estimator.update(frame, None if box is None else _mask(frame, box))
        if transformation is None:  # this frame is the new reference
            prev_from_reference = np.eye(3)
            return None, False
        cur_from_reference = transformation.homography_matrix
        cur_from_prev = cur_from_reference @ np.linalg.inv(prev_from_reference)
        prev_from_reference = cur_from_reference
        return cur_from_prev, True

    return estimate


def boxmot(method: str, *words: str) -> Estimate:
    """`create_cmc` with its defaults; ECC finds a shift alone, unless `words` say "euclidean"."""
    from boxmot.motion.cmc import create_cmc

    options = {"warp_mode": cv2.MOTION_EUCLIDEAN} if "euclidean" in words else {}
    compensation = create_cmc(method, **options)

    def estimate(frame: np.ndarray, box: Box) -> Told:
        xyxy = None if box is None else np.array([[*box[:2], *(box[:2] + box[2:])]])
        return np.vstack([compensation.apply(frame, xyxy), (0, 0, 1)]), True

    return estimate


FAMILIES: dict[str, Callable[..., Estimate]] = {
    "ssiam": ssiam_camera,
    "vidstab": vidstab,
    "vidgear": vidgear,
    "norfair": norfair,
    "boxmot": boxmot,
}


def load_estimator(name: str) -> Estimate:
    """The estimator of a name such as "ssiam-direct-rigid" or "vidgear"."""
    family, *words = name.split("-")
    return FAMILIES[family](*words)


def _rigid_at_origin(dx: float, dy: float, angle: float) -> np.ndarray:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, dx], [sin, cos, dy], [0, 0, 1]])


def _mask(frame: np.ndarray, box: np.ndarray) -> np.ndarray:
    """(H, W) uint8, 0 on the box and 1 elsewhere."""
    mask = np.ones(frame.shape[:2], dtype=np.uint8)
    left, top = np.maximum(box[:2], 0).astype(int)
    right, bottom = np.maximum(box[:2] + box[2:], 0).astype(int)
    mask[top:bottom, left:right] = 0
    return mask


def run(name: str, clip: str, exclude: bool) -> dict[str, list[Any]]:
    """The answer to one request."""
    with np.load(clip) as arrays:
        frames, boxes = arrays["frames"], arrays["boxes"]
    estimate = load_estimator(name)
    cv2.setNumThreads(1)
    answer: dict[str, list[Any]] = {"cur_from_prev": [], "reliable": [], "ms": []}
    for index, frame in enumerate(frames):
        box = boxes[max(index - 1, 0)] if exclude else None
        start = time.perf_counter()
        cur_from_prev, reliable = estimate(frame, box)
        took = 1e3 * (time.perf_counter() - start)
        told = cur_from_prev is not None and bool(np.isfinite(cur_from_prev).all())
        answer["cur_from_prev"].append((cur_from_prev if told else np.eye(3)).tolist())
        answer["reliable"].append(bool(reliable and (told or index == 0)))
        answer["ms"].append(took)
    return answer


def greeting(name: str) -> dict[str, dict[str, str]]:
    """Versions of the estimator's package and of OpenCV, once the estimator could be loaded."""
    load_estimator(name)
    family = name.split("-")[0]
    return {"versions": {family: version(family), "OpenCV": cv2.__version__}}


def _answers_alone() -> TextIO:
    """Standard output; what packages print from now on goes to standard error."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers


def _attempt(action: Callable[..., dict[str, Any]], *arguments: Any) -> str:
    """The action's result, or why there is none, as a line of JSON."""
    try:
        return json.dumps(action(*arguments))
    except Exception as error:
        return json.dumps({"failed": " ".join(f"{type(error).__name__}: {error}".split())})


def main() -> None:
    """Answer requests until there are no more."""
    answers = _answers_alone()
    name = sys.argv[1]
    print(_attempt(greeting, name), file=answers)
    for line in sys.stdin:
        request = json.loads(line)
        print(_attempt(run, name, request["clip"], request["exclude"]), file=answers)


if __name__ == "__main__":
    main()
