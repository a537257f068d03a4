"""Execution and measures of the runs of benchmarks/shake/run.py."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.data import sequences
from benchmarks.common.loading import load as load_any
from benchmarks.shake.records import NO_SHAKE, ShakeRun
from benchmarks.shake.report import MODELS, TRUE_MOTION
from ssiam.datasets import Shake, VideoSequence, shaken
from ssiam.datasets.shake.path import SHAKE_KINDS, ShakeKind
from ssiam.errors import check_choice
from ssiam.evaluation.measures.overlap import vot_overlap
from ssiam.evaluation.measures.regions import upright
from ssiam.evaluation.measures.success import success
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.runs.protocols import run
from ssiam.evaluation.runs.result_files import write_lines
from ssiam.geometry import Image
from ssiam.motion import CameraMotion, Motion
from ssiam.stabilize import METHODS, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

PARTS = ("choose", "speed", "turn", "trust", "prefer", "find")
WITHOUT = "predict without "
SETTINGS = (*METHODS, *(WITHOUT + part for part in PARTS), TRUE_MOTION)
BURN_IN = 10  # frames from each start on that accuracy leaves out


@dataclass(frozen=True, eq=False, kw_only=True)
class CachedSequence(VideoSequence):
    """A sequence with its frames in memory, for many runs."""

    cached: list[Image]

    def images(self, start: int = 0) -> Iterator[Image]:
        """The frames from index `start` on."""
        return iter(self.cached[start:])


class RecordingTracker:
    """A tracker that optionally receives the true camera motion, and counts frames reported lost.

    Parameters
    ----------
    tracker : StabilizedTracker
    sequence : CachedSequence
    motions : list of Motion, optional
        True motion of each frame.
    """

    def __init__(
        self, tracker: StabilizedTracker, sequence: CachedSequence, motions: list[Motion] | None
    ) -> None:
        self._tracker, self._motions = tracker, motions
        self._frames = enumerate(sequence.cached)
        self.reported_lost = 0

    def init(self, frame: Image, box: Sequence[float]) -> None:
        """Start on the target in `box`, x, y, w, h in pixels."""
        self._tracker.init(frame, box)

    def update(self, frame: Image) -> Track:
        """Track the target into the next frame."""
        index = next(index for index, cached in self._frames if cached is frame)
        motion = None if self._motions is None else self._motions[index]
        track = self._tracker.update(frame, motion=motion)
        self.reported_lost += track.lost
        return track


def run_all(out: Path, data: Path, one_pass: bool, todo: list[ShakeRun]) -> int:
    """Execute runs on the sequences of `data`, each into its file; returns their number."""
    cv2.setNumThreads(1)
    loaded: dict[tuple[str, str], StabilizedTracker] = {}
    previous = None
    for each in todo:
        if each.shaken != previous:
            unshaken = sequences(data)[each.sequence]
            sequence = shaken(unshaken, Shake(each.strength, _kind(each), each.seed))
            frames, previous = cached(sequence), each.shaken
            motions = None
            if any(one.setting == TRUE_MOTION for one in todo):
                motions = true_motions(out, unshaken, sequence.shaken_from_raw)
        key = each.tracker, each.setting
        loaded[key] = loaded.get(key) or load(*key)
        known = motions if each.setting == TRUE_MOTION else None
        result = measured(each, one_pass, loaded[key], frames, known)
        write_lines(each.path(out), [result.to_json()])
    return len(todo)


def cached(sequence: VideoSequence) -> CachedSequence:
    """The sequence with its frames read into memory."""
    return CachedSequence(
        name=sequence.name,
        frames=sequence.frames,
        truth=sequence.truth,
        cached=list(sequence.images()),
    )


def load(tracker: str, setting: str) -> StabilizedTracker:
    """Load a tracker with one of `SETTINGS`."""
    method = setting if setting in METHODS else "predict"
    config = StabilizerConfig(check_choice("stabilize", method, METHODS))
    if setting.startswith(WITHOUT):
        off: dict[str, Any] = {setting.removeprefix(WITHOUT): False}
        config = config.with_options(**off)
    if setting in MODELS:
        config = config.with_options(motion_model=MODELS[setting])
    return load_any(tracker, config)


def true_motions(
    out: Path, unshaken: VideoSequence, shaken_from_raw: NDArray[np.float64]
) -> list[Motion]:
    """Motion of each frame: the shake combined with the estimated motion of the unshaken frames."""
    path = out / "motions" / f"{unshaken.name}.json"
    if not path.exists():
        write_lines(path, [json.dumps(unshaken_motions(unshaken).tolist())])
    raw = np.array(json.loads(path.read_text()))
    raw_from_prev_shaken = raw[1:] @ np.linalg.inv(shaken_from_raw[:-1])
    height, width = next(unshaken.images()).shape[:2]
    return [
        Motion.from_transform(cur_from_prev, (width, height))
        for cur_from_prev in (np.eye(3), *(shaken_from_raw[1:] @ raw_from_prev_shaken))
    ]


def unshaken_motions(sequence: VideoSequence) -> NDArray[np.float64]:
    """Estimated cur_from_prev (N, 3, 3) of a sequence, with the true box excluded."""
    camera = CameraMotion()
    boxes = upright(sequence.truth)
    known = [None, *(box.tolist() if np.isfinite(box).all() else None for box in boxes[:-1])]
    motions = [camera.update(*each) for each in zip(sequence.images(), known, strict=True)]
    return np.stack([motion.cur_from_prev for motion in motions])


def measured(
    each: ShakeRun,
    one_pass: bool,
    tracker: StabilizedTracker,
    sequence: CachedSequence,
    motions: list[Motion] | None,
) -> ShakeRun:
    """Execute a run: the run with its measures."""
    start = time.perf_counter()
    recording = RecordingTracker(tracker.clone(), sequence, motions)
    supervised = run(recording, sequence)
    found = replace(each, frames=len(sequence), reported_lost=recording.reported_lost)
    found = with_overlaps(found, supervised, sequence)
    if one_pass:
        recording = RecordingTracker(tracker.clone(), sequence, motions)
        boxes = upright(run(recording, sequence, "ope").regions)
        boxes[0] = sequence.box(0)
        auc = success(boxes, upright(sequence.truth)).auc
        found = replace(found, success=auc, one_pass_reported_lost=recording.reported_lost)
    return replace(found, seconds=time.perf_counter() - start)


def with_overlaps(each: ShakeRun, supervised: Trajectory, sequence: CachedSequence) -> ShakeRun:
    """The run with the measures of its supervised trajectory; the overlap is pysot's."""
    height, width = sequence.cached[0].shape[:2]
    overlap = vot_overlap(supervised.regions, sequence.truth, (width, height))
    tracked = supervised.status == Status.TRACKED
    known = tracked & np.isfinite(overlap)
    settled = known & ~supervised.burn_in(BURN_IN)
    return replace(
        each,
        lost=len(supervised.failures),
        tracked=int(tracked.sum()),
        overlap=float(overlap[known].sum()),
        counted=int(known.sum()),
        settled_overlap=float(overlap[settled].sum()),
        settled=int(settled.sum()),
    )


def _kind(each: ShakeRun) -> ShakeKind:
    return SHAKE_KINDS[0] if each.kind == NO_SHAKE else check_choice("kind", each.kind, SHAKE_KINDS)
