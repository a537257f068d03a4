"""What the runs of benchmarks/shake.py measure."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from loading import load as load_any
from shake_report import TRUE_MOTION
from shake_run import NO_SHAKE, Run
from shared_data import sequences
from ssiam.datasets import Sequence, Shake, shaken
from ssiam.datasets.camera_paths import SHAKE_KINDS
from ssiam.evaluation.lines import write_lines
from ssiam.evaluation.overlap import vot_overlap
from ssiam.evaluation.protocols import run
from ssiam.evaluation.regions import upright
from ssiam.evaluation.success import success
from ssiam.evaluation.trajectory import Status, Trajectory
from ssiam.motion import CameraMotion, Motion
from ssiam.stabilize import METHODS, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

PARTS = ("choose", "speed", "turn", "trust", "find")
WITHOUT = "predict without "
SETTINGS = (*METHODS, *(WITHOUT + part for part in PARTS), TRUE_MOTION)
BURN_IN = 10  # frames from each start on that do not count for the accuracy


@dataclass(frozen=True, eq=False, kw_only=True)
class Filmed(Sequence):
    """A sequence whose pictures are at hand, for many runs."""

    pictures: list[np.ndarray]

    def images(self, start: int = 0) -> Iterator[np.ndarray]:
        """The pictures from index `start` on."""
        return iter(self.pictures[start:])


class Witness:
    """A tracker that is told the camera's true motion, if any, and counts where it was lost."""

    def __init__(
        self, tracker: StabilizedTracker, filmed: Filmed, motions: list[Motion] | None
    ) -> None:
        self._tracker, self._motions = tracker, motions
        self._order = enumerate(filmed.pictures)
        self.told_lost = 0

    def init(self, frame: np.ndarray, box: tuple[float, ...]) -> None:
        """Start on the target in `box`."""
        self._tracker.init(frame, box)

    def update(self, frame: np.ndarray) -> Track:
        """The target in the next frame."""
        index = next(index for index, picture in self._order if picture is frame)
        motion = None if self._motions is None else self._motions[index]
        track = self._tracker.update(frame, motion=motion)
        self.told_lost += track.lost
        return track


def chunk(out: Path, one_pass: bool, todo: list[Run]) -> int:
    """Make runs of one sequence, and write each; how many there were."""
    cv2.setNumThreads(1)
    loaded: dict[tuple[str, str], StabilizedTracker] = {}
    shown = None
    for each in todo:
        if each.shaken != shown:
            plain = sequences()[each.sequence]
            sequence = shaken(plain, Shake(each.strength, _kind(each), each.seed))
            filmed, shown = film(sequence), each.shaken
            motions = true_motions(out, plain, sequence.shaken_from_raw)
        key = each.tracker, each.setting
        loaded[key] = loaded.get(key) or load(*key)
        given = motions if each.setting == TRUE_MOTION else None
        done = measured(each, one_pass, loaded[key], filmed, given)
        write_lines(each.path(out), [json.dumps(asdict(done))])
    return len(todo)


def film(sequence: Sequence) -> Filmed:
    """The sequence with its pictures in memory."""
    pictures = list(sequence.images())
    return Filmed(
        name=sequence.name, frames=sequence.frames, truth=sequence.truth, pictures=pictures
    )


def load(tracker: str, setting: str) -> StabilizedTracker:
    """The tracker with a setting, by their names."""
    config = StabilizerConfig(setting if setting in METHODS else "predict")
    if setting.startswith(WITHOUT):
        config = replace(config, **{setting.removeprefix(WITHOUT): False})
    return load_any(tracker, config)


def true_motions(out: Path, plain: Sequence, shaken_from_raw: np.ndarray) -> list[Motion]:
    """The shake, and the motion that the footage had before it; by frame."""
    path = out / "motions" / f"{plain.name}.json"
    if not path.exists():
        write_lines(path, [json.dumps(unshaken_motions(plain).tolist())])
    raw = np.array(json.loads(path.read_text()))
    raw_from_prev_shaken = raw[1:] @ np.linalg.inv(shaken_from_raw[:-1])
    height, width = next(plain.images()).shape[:2]
    return [
        Motion.given(cur_from_prev, (width, height))
        for cur_from_prev in (np.eye(3), *(shaken_from_raw[1:] @ raw_from_prev_shaken))
    ]


def unshaken_motions(plain: Sequence) -> np.ndarray:
    """cur_from_prev (N, 3, 3) of the frames as they are, without a look at the target."""
    camera = CameraMotion()
    boxes = upright(plain.truth)
    told = [None, *(box if np.isfinite(box).all() else None for box in boxes[:-1])]
    motions = [camera.update(*each) for each in zip(plain.images(), told, strict=True)]
    return np.stack([motion.cur_from_prev for motion in motions])


def measured(
    each: Run,
    one_pass: bool,
    tracker: StabilizedTracker,
    filmed: Filmed,
    motions: list[Motion] | None,
) -> Run:
    """The run with its figures."""
    began = time.perf_counter()
    witness = Witness(tracker.clone(), filmed, motions)
    supervised = run(witness, filmed)
    found = replace(each, frames=len(filmed), told_lost=witness.told_lost)
    found = replace(found, **overlaps(supervised, filmed))
    if one_pass:
        witness = Witness(tracker.clone(), filmed, motions)
        boxes = upright(run(witness, filmed, "ope").regions)
        boxes[0] = filmed.box(0)
        auc = success(boxes, upright(filmed.truth)).auc
        found = replace(found, success=auc, one_pass_told_lost=witness.told_lost)
    return replace(found, seconds=time.perf_counter() - began)


def overlaps(supervised: Trajectory, filmed: Filmed) -> dict[str, float]:
    """Figures of a supervised run; the overlap is pysot's."""
    height, width = filmed.pictures[0].shape[:2]
    overlap = vot_overlap(supervised.regions, filmed.truth, (width, height))
    tracked = supervised.status == Status.TRACKED
    known = tracked & np.isfinite(overlap)
    settled = known & ~supervised.burning_in(BURN_IN)
    return {
        "lost": len(supervised.failures),
        "tracked": int(tracked.sum()),
        "overlap": float(overlap[known].sum()),
        "counted": int(known.sum()),
        "settled_overlap": float(overlap[settled].sum()),
        "settled": int(settled.sum()),
    }


def _kind(each: Run) -> str:
    return SHAKE_KINDS[0] if each.kind == NO_SHAKE else each.kind
