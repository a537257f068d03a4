"""The worker process of benchmarks/motion/hosts.py: runs the tracker of one host on clips.

    python benchmarks/motion/host_trackers.py HOST

It runs in the environment of the host, and therefore imports only the host, NumPy, OpenCV and the
adapters of ssiam. It first writes a line {"versions": {...}}. Then it reads lines of JSON,

    {"clip": "folder with frames.npy (N, H, W, 3) and boxes.json", "motion": "off"}

and answers each with {"identities": for each frame, one for each box or null, "ms": per frame} or
{"failed": reason}. "motion" is "off", "own" or "ssiam". Everything else is the host's default.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, TextIO, TypeAlias

import cv2
import numpy as np

Array: TypeAlias = "np.ndarray[Any, np.dtype[Any]]"
Identities: TypeAlias = "list[int | None]"
Step: TypeAlias = Callable[[Array, Array], Identities]  # from a frame and its boxes (N, 4), xyxy

SCORE = 0.9  # of every box


def norfair(motion: str) -> Step:
    """`norfair.Tracker` on the overlap of boxes; the motion sees the frame without the boxes."""
    from norfair import Detection, Tracker
    from norfair.camera_motion import MotionEstimator

    from ssiam.integrations.norfair import MotionEstimator as Ours

    tracker = Tracker(distance_function="iou", distance_threshold=0.7)
    estimators = {"own": MotionEstimator, "ssiam": Ours}
    estimator = None if motion == "off" else estimators[motion]()
    frames = iter(range(sys.maxsize))

    def step(frame: Array, boxes: Array) -> Identities:
        number = next(frames)
        mask = np.ones(frame.shape[:2], np.uint8)
        for left, top, right, bottom in np.maximum(boxes, 0).astype(int):
            mask[top:bottom, left:right] = 0
        moved = estimator and estimator.update(frame, mask)
        detections = [
            Detection(box.reshape(2, 2), data=(number, index)) for index, box in enumerate(boxes)
        ]
        identities: Identities = [None] * len(boxes)
        for target in tracker.update(detections, coord_transformations=moved):
            seen, index = target.last_detection.data
            if seen == number:
                identities[index] = target.id
        return identities

    return step


def ultralytics(motion: str) -> Step:
    """`BOTSORT` with the numbers of botsort.yaml."""
    from ultralytics.engine.results import Boxes
    from ultralytics.trackers.bot_sort import BOTSORT
    from ultralytics.utils import YAML, IterableSimpleNamespace
    from ultralytics.utils.checks import check_yaml

    from ssiam.integrations.ultralytics import GMC

    arguments = YAML.load(check_yaml("botsort.yaml"))
    if motion == "off":
        arguments["gmc_method"] = "none"
    tracker = BOTSORT(IterableSimpleNamespace(**arguments))
    if motion == "ssiam":
        tracker.gmc = GMC()

    def step(frame: Array, boxes: Array) -> Identities:
        rows = np.column_stack([boxes, np.full(len(boxes), SCORE), np.zeros(len(boxes))])
        tracks = tracker.update(Boxes(rows.astype(np.float32), frame.shape[:2]), frame)
        return _identities(len(boxes), ((row[-1], row[4]) for row in tracks))

    return step


def boxmot(motion: str) -> Step:
    """`BotSort` without appearance; its own motion is ECC."""
    from boxmot import BotSort

    from ssiam.integrations.boxmot import CMC

    tracker = BotSort(use_embeddings=False, use_cmc=motion != "off")
    if motion == "ssiam":
        tracker.cmc = CMC()

    def step(frame: Array, boxes: Array) -> Identities:
        rows = np.column_stack([boxes, np.full(len(boxes), SCORE), np.zeros(len(boxes))])
        tracks = np.asarray(tracker.update(rows.astype(np.float32), frame))
        return _identities(len(boxes), ((row[7], row[4]) for row in tracks))

    return step


def trackers(motion: str) -> Step:
    """`BoTSORTTracker` of roboflow's trackers."""
    import supervision

    from ssiam.integrations.roboflow_trackers import CMC
    from trackers import BoTSORTTracker

    tracker = BoTSORTTracker(enable_cmc=motion != "off")
    if motion == "ssiam":
        tracker.cmc = CMC()
    return _of_detections(supervision, lambda frame, found: tracker.update(found, frame))


def supervision(motion: str) -> Step:
    """`ByteTrackTracker` on supervision's detections; neither has a motion of its own."""
    import supervision

    from ssiam.integrations.supervision import SceneTracker
    from trackers import ByteTrackTracker

    tracker = ByteTrackTracker()
    if motion != "ssiam":
        return _of_detections(supervision, lambda frame, found: tracker.update(found))
    return _of_detections(supervision, SceneTracker(tracker.update).update)


def _of_detections(supervision: Any, update: Callable[[Array, Any], Any]) -> Step:
    def step(frame: Array, boxes: Array) -> Identities:
        found = supervision.Detections(
            xyxy=boxes.astype(np.float32),
            confidence=np.full(len(boxes), SCORE, np.float32),
            class_id=np.zeros(len(boxes), int),
            data={"index": np.arange(len(boxes))},
        )
        tracked = update(frame, found)
        pairs = zip(tracked.data.get("index", ()), tracked.tracker_id, strict=False)
        return _identities(len(boxes), ((index, one) for index, one in pairs if one >= 0))

    return step


def _identities(count: int, pairs: Any) -> Identities:
    identities: Identities = [None] * count
    for index, identity in pairs:
        identities[int(index)] = int(identity)
    return identities


HOSTS: dict[str, Callable[[str], Step]] = {
    "norfair": norfair,
    "ultralytics": ultralytics,
    "boxmot": boxmot,
    "trackers": trackers,
    "supervision": supervision,
}


def run(host: str, clip: str, motion: str) -> dict[str, Any]:
    """Run a new tracker over a clip; the answer to one request."""
    frames = np.load(Path(clip) / "frames.npy", mmap_mode="r")
    boxes = json.loads((Path(clip) / "boxes.json").read_text())
    cv2.setNumThreads(1)
    step = HOSTS[host](motion)
    answer: dict[str, Any] = {"identities": [], "ms": []}
    for frame, found in zip(frames, boxes, strict=True):
        image, rows = np.array(frame), np.reshape(found, (-1, 4)).astype(np.float64)
        start = time.process_time()
        answer["identities"].append(step(image, rows))
        answer["ms"].append(1e3 * (time.process_time() - start))
    return answer


def greeting(host: str) -> dict[str, dict[str, str]]:
    """Versions of the host's package and of OpenCV, after importing the host."""
    HOSTS[host]("off")
    return {"versions": {host: version(host), "OpenCV": cv2.__version__}}


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
    parser.add_argument("host", choices=HOSTS)
    host = parser.parse_args().host
    answers = _reserved_stdout()
    print(_attempt(greeting, host), file=answers)
    for line in sys.stdin:
        request = json.loads(line)
        print(_attempt(run, host, request["clip"], request["motion"]), file=answers)


if __name__ == "__main__":
    main()
