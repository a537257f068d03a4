"""The worker process of benchmarks/motion/compare.py: runs one camera-motion estimator on clips.

    python benchmarks/motion/estimators.py NAME

It runs in the environment of the estimator, and therefore imports only NumPy, OpenCV and the
package of the estimator. It first writes a line {"versions": {...}}. Then it reads lines of JSON,

    {"clip": "clip.npz with frames (N, H, W, 3) and boxes (N, 4)", "exclude": true}

and answers each with {"cur_from_prev": (N, 3, 3), "reliable": (N,), "ms": (N,)} or
{"failed": reason}. Each clip is run with a new estimator on one OpenCV thread. If "exclude" is
true, estimators that can exclude a target receive its box in the previous frame. Where an estimator
gives no result (None or non-finite numbers), the frame is unreliable and its motion the identity.
Times are process times: on a busy machine, wall time counts the other programs, and the more the
longer a frame takes.
"""

from __future__ import annotations

import argparse
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

Array: TypeAlias = "np.ndarray[Any, np.dtype[Any]]"
Box: TypeAlias = "Array | None"  # (4,) x, y, w, h of the target in the previous frame, px
Result: TypeAlias = "tuple[Array | None, bool]"  # cur_from_prev (3, 3), reliable
Estimate: TypeAlias = Callable[[Array, Box], Result]


def ssiam_camera(keypoints: str, *words: str) -> Estimate:
    """`CameraMotion` with these keypoints; `words` may contain its model and its fit.

    With "luma" it gets the luma of limited range; its times contain that conversion.
    """
    import ssiam

    options: dict[str, Any] = {
        "fit" if word == "least_squares" else "model": word for word in words if word != "luma"
    }
    camera = ssiam.CameraMotion(keypoints, **options)  # type: ignore[arg-type]

    def estimate(frame: Array, box: Box) -> Result:
        if "luma" in words:
            gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
            frame = np.rint(gray * (219 / 255) + 16).astype(np.uint8)
        motion = camera.update(frame, exclude=None if box is None else box.tolist())
        return motion.cur_from_prev, motion.reliable

    return estimate


def vidstab(kp_method: str) -> Estimate:
    """`VidStab.stabilize_frame` up to the raw transform; no smoothing, no warp."""
    from vidstab import VidStab

    stabilizer = VidStab(kp_method.upper())
    stabilizer.frame_queue.reset_queue(max_len=31, max_frames=math.inf)

    def estimate(frame: Array, box: Box) -> Result:
        if stabilizer.prev_gray is None:
            stabilizer._process_first_frame(array=frame)
            return None, True
        stabilizer.frame_queue.read_frame(array=frame, pop_ind=False)
        stabilizer._gen_next_raw_transform()
        return _rigid_at_origin(*stabilizer._raw_transforms[-1]), True

    return estimate


def vidgear() -> Estimate:
    """The per-frame motion of the zero-latency stabilizer; no filter, no warp."""
    from vidgear.gears.stabilizer import Stabilizer, StabilizerMode

    stabilizer = Stabilizer(mode=StabilizerMode.KALMAN)
    previous: list[Any] = []

    def estimate(frame: Array, box: Box) -> Result:
        gray = stabilizer._to_gray(frame)
        motion = stabilizer._estimate_motion(*previous, gray) if previous else None
        previous[:] = gray, stabilizer._detect_keypoints(gray)
        return None if motion is None else _rigid_at_origin(*motion), True

    return estimate


def norfair() -> Estimate:
    """The homography from the previous frame, from the two relative to the reference frame."""
    from norfair.camera_motion import HomographyTransformationGetter, MotionEstimator

    estimator = MotionEstimator(transformations_getter=HomographyTransformationGetter())
    prev_from_reference = np.eye(3)

    def estimate(frame: Array, box: Box) -> Result:
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
    """`create_cmc` with its defaults; ECC estimates only a shift unless `words` has "euclidean"."""
    from boxmot.motion.cmc import create_cmc

    options = {"warp_mode": cv2.MOTION_EUCLIDEAN} if "euclidean" in words else {}
    compensation = create_cmc(method, **options)

    def estimate(frame: Array, box: Box) -> Result:
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


def _rigid_at_origin(dx: float, dy: float, angle: float) -> Array:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, dx], [sin, cos, dy], [0, 0, 1]])


def _mask(frame: Array, box: Array) -> Array:
    """(H, W) uint8, 0 on the box and 1 elsewhere."""
    mask = np.ones(frame.shape[:2], dtype=np.uint8)
    left, top = np.maximum(box[:2], 0).astype(int)
    right, bottom = np.maximum(box[:2] + box[2:], 0).astype(int)
    mask[top:bottom, left:right] = 0
    return mask


def run(name: str, clip: str, exclude: bool) -> dict[str, list[Any]]:
    """Run a new estimator over a clip; the answer to one request."""
    with np.load(clip) as arrays:
        frames, boxes = arrays["frames"], arrays["boxes"]
    estimate = load_estimator(name)
    cv2.setNumThreads(1)
    answer: dict[str, list[Any]] = {"cur_from_prev": [], "reliable": [], "ms": []}
    for index, frame in enumerate(frames):
        box = boxes[max(index - 1, 0)] if exclude else None
        start = time.process_time()
        cur_from_prev, reliable = estimate(frame, box)
        milliseconds = 1e3 * (time.process_time() - start)
        if cur_from_prev is None or not np.isfinite(cur_from_prev).all():
            cur_from_prev, reliable = np.eye(3), reliable and index == 0
        answer["cur_from_prev"].append(cur_from_prev.tolist())
        answer["reliable"].append(bool(reliable))
        answer["ms"].append(milliseconds)
    return answer


def greeting(name: str) -> dict[str, dict[str, str]]:
    """Versions of the estimator's package and of OpenCV, after loading the estimator."""
    load_estimator(name)
    family = name.split("-")[0]
    return {"versions": {family: version(family), "OpenCV": cv2.__version__}}


def _reserved_stdout() -> TextIO:
    """Standard output for the answers; output of packages is redirected to standard error."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return answers


def _attempt(action: Callable[..., dict[str, Any]], *arguments: Any) -> str:
    """The result of the action, or the reason of its failure, as a line of JSON."""
    try:
        return json.dumps(action(*arguments))
    except Exception as error:
        return json.dumps({"failed": " ".join(f"{type(error).__name__}: {error}".split())})


def main() -> None:
    """Answer requests until the input ends."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", metavar="NAME", help="such as ssiam-direct or vidstab-orb")
    name = parser.parse_args().name
    answers = _reserved_stdout()
    print(_attempt(greeting, name), file=answers)
    for line in sys.stdin:
        request = json.loads(line)
        print(_attempt(run, name, request["clip"], request["exclude"]), file=answers)


if __name__ == "__main__":
    main()
