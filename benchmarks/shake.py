"""How many targets a shaking camera costs, and how many of them each way of steadying keeps.

    python benchmarks/shake.py --out runs/shake --one-pass --jobs 2 \
        --trackers nanotrack_v1 nanotrack_v2 nanotrack_v3 kcf csrt \
        --settings off paper literal predict "predict, true motion" --kinds white handheld
    python benchmarks/shake.py --out runs/shake --one-pass --jobs 2 --settings all
    python benchmarks/shake.py --out runs/shake --report [--plot docs/images/shake.png]

Every run of a tracker on a shaken sequence starts again five frames after the target was lost
(VOT); with --one-pass there is a second one that never does. Each is kept as a small file in
--out and made only once: a benchmark that was stopped goes on where it was; remove the folder when
the code changes. The tables that benchmarks/shake_report.py makes of all runs there are printed at
the end, or at once with --report. "predict, true motion" is told the camera's motion: the shake,
on top of what is estimated on the unshaken frames with the true box left out. "predict without
find" and the like lack one part each. Needs the folder of test data (see shared_data.py).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path

import cv2
import joblib
import numpy as np

import ssiam
from shake_plot import draw
from shake_report import MAIN, NO_SHAKE, TRUE_MOTION, Run, read_runs, report
from shared_data import WEIGHTS, sequences
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
from ssiam.trackers import SteadiedTracker, Track

PARTS = ("choose", "speed", "turn", "trust", "find")
WITHOUT = "predict without "
SETTINGS = (*METHODS, *(WITHOUT + part for part in PARTS), TRUE_MOTION)
TRACKERS = ("nanotrack_v1", "nanotrack_v2", "nanotrack_v3", "kcf", "csrt")
STRENGTHS = (0.0, 0.01, 0.03, 0.05)
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
        self, tracker: SteadiedTracker, filmed: Filmed, motions: list[Motion] | None
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
    loaded: dict[tuple[str, str], SteadiedTracker] = {}
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


def load(tracker: str, setting: str) -> SteadiedTracker:
    """The tracker with a setting, by their names."""
    weights = WEIGHTS / tracker.replace("_", "") if tracker.startswith("nanotrack") else None
    config = StabilizerConfig(setting if setting in METHODS else "predict")
    if setting.startswith(WITHOUT):
        config = replace(config, **{setting.removeprefix(WITHOUT): False})
    return ssiam.load_tracker(tracker, weights=weights, stabilize=config, threads=1)


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
    tracker: SteadiedTracker,
    filmed: Filmed,
    motions: list[Motion] | None,
) -> Run:
    """The run with its figures."""
    began = time.perf_counter()
    witness = Witness(tracker.another(), filmed, motions)
    supervised = run(witness, filmed)
    found = replace(each, frames=len(filmed), told_lost=witness.told_lost)
    found = replace(found, **overlaps(supervised, filmed))
    if one_pass:
        witness = Witness(tracker.another(), filmed, motions)
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


def chunks(chosen: argparse.Namespace) -> list[list[Run]]:
    """What is not there yet: the runs of a tracker on a sequence under a strength and kind."""
    there = {each.key for each in read_runs(chosen.out) if each.has_one_pass or not chosen.one_pass}
    shakes = [(NO_SHAKE, 0.0, [0])] if 0 in chosen.strengths else []
    shakes += [(k, s, range(chosen.seeds)) for s in chosen.strengths if s for k in chosen.kinds]
    todo = []
    for tracker, (kind, strength, seeds), name in product(
        chosen.trackers, shakes, chosen.sequences
    ):
        own = [
            Run(tracker, setting, kind, strength, seed, name)
            for seed in seeds
            for setting in chosen.settings
        ]
        todo.append([each for each in own if each.key not in there])
    return [own for own in todo if own]


def _kind(each: Run) -> str:
    return SHAKE_KINDS[0] if each.kind == NO_SHAKE else each.kind


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs")
    parser.add_argument("--trackers", nargs="+", default=["nanotrack_v3"], choices=TRACKERS)
    parser.add_argument("--settings", nargs="+", default=MAIN, choices=(*SETTINGS, "all"))
    parser.add_argument("--kinds", nargs="+", default=SHAKE_KINDS, choices=SHAKE_KINDS)
    parser.add_argument("--strengths", nargs="+", type=float, default=STRENGTHS)
    parser.add_argument("--seeds", type=int, default=3, help="how many paths of each shake")
    parser.add_argument("--sequences", nargs="+", help="all of them unless given")
    parser.add_argument("--one-pass", action="store_true", help="one-pass runs too")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--report", action="store_true", help="only the tables of what is there")
    parser.add_argument("--ablate", default="nanotrack_v3", help="tracker of the second table")
    parser.add_argument("--plot", type=Path, help="picture to be drawn")
    chosen = parser.parse_args()
    chosen.settings = SETTINGS if "all" in chosen.settings else chosen.settings
    return chosen


def main() -> None:
    """Make the runs and print the tables."""
    chosen = arguments()
    if not chosen.report:
        chosen.sequences = chosen.sequences or list(sequences())
        todo = chunks(chosen)
        count, done = sum(map(len, todo)), 0
        calls = (joblib.delayed(chunk)(chosen.out, chosen.one_pass, own) for own in todo)
        parallel = joblib.Parallel(n_jobs=chosen.jobs, return_as="generator_unordered")
        for made in parallel(calls):
            done += made
            print(f"{done} of {count} runs", file=sys.stderr, flush=True)
    runs = read_runs(chosen.out)
    print(report(runs, chosen.ablate))
    if chosen.plot:
        draw(runs, chosen.plot)


if __name__ == "__main__":
    main()
