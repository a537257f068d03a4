"""The template memory (THOR) and the handling of distractors, on and off.

    python benchmarks/accuracy/related.py [--trackers nanotrack_v2 lite] [--frames 150]
        [--sets reserve mot] [--strengths 0 0.03] [--seed 0] [--stabilize predict] [--out FILE]
    python benchmarks/accuracy/related.py --sets sequences adl [...]

Each tracker runs with each setting: "base" has neither, "memory" and "distractors" one of them,
"both" has both. One pass of up to --frames frames over each sequence, unshaken and shaken by
independent shifts (kind "white") with one seed. The camera's motion is estimated once for each
clip, without the true box, and is the same for all runs. The table has the mean success over the
sequences, the difference from "base" with a bootstrap 95 % interval over the sequences, the
sequences that end off the target (median overlap of the last five annotated frames below .1), and
the time of a frame without that of the motion, relative to "base" in the same run.

The sets "reserve" (ten sequences of OTB) and "mot" (the 24 targets of
benchmarks/accuracy/distractors.py, without those that the shake moves out of the first frame) are
only reported; nothing was chosen on them. The parameters of the memory were chosen on "sequences"
(the ten test sequences) and "adl" (five targets of ADL-Rundle-6). Needs the folder of test data
(see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import islice, product
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.datasets import Shake, VideoSequence, shaken
from ssiam.evaluation.measures.compare import paired_difference
from ssiam.evaluation.measures.regions import upright
from ssiam.evaluation.measures.success import success
from ssiam.geometry import Image, iou
from ssiam.motion import Motion
from ssiam.stabilize import METHODS
from ssiam.trackers import StabilizedTracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.distractors import CLIPS, LAST, OFF, targets
from benchmarks.common.data import MOT, RESERVE, SEQUENCES, sequences
from benchmarks.common.loading import load
from benchmarks.common.tables import head, line

SETTINGS = {  # template memory, distractors
    "base": (False, False),
    "memory": (True, False),
    "distractors": (False, True),
    "both": (True, True),
}
SETS = ("reserve", "mot", "sequences", "adl")
ADL_TARGETS = 5
COLUMNS = ("tracker", "set", "shake", "success", "difference", "off in the end", "time")


@dataclass(frozen=True)
class Run:
    """One pass of a tracker over a sequence.

    Attributes
    ----------
    tracker, setting, data : str
        `data` is the name of the set.
    strength : float
        Of the shake, share of the width.
    seed, frames, stabilize
        As on the command line.
    sequence : str
    success : float
        Area under the success curve, 0..1.
    off : bool
        Whether it ends off the target.
    seconds : float
        Time of a frame.
    """

    tracker: str
    setting: str
    data: str
    strength: float
    seed: int
    frames: int
    stabilize: str
    sequence: str
    success: float = 0.0
    off: bool = False
    seconds: float = 0.0

    @property
    def planned(self) -> Run:
        """The run without its results."""
        return replace(self, success=0.0, off=False, seconds=0.0)


def sequences_of(data: str) -> Iterator[VideoSequence]:
    """The sequences of a set."""
    if data == "mot":
        yield from targets(list(CLIPS))
    elif data == "adl":
        yield from islice(targets([MOT / "ADL-Rundle-6"]), ADL_TARGETS)
    else:
        yield from sequences(RESERVE if data == "reserve" else SEQUENCES).values()


@dataclass(frozen=True, eq=False)
class Clip:
    """The first frames of a sequence, unshaken or shaken, with the motion of its camera.

    Attributes
    ----------
    name : str
    frames : list of (H, W, 3) uint8 BGR
    motions : list of Motion
        To each frame but the first, estimated without the true box.
    truth : (N, 4) float64
        x, y, w, h in pixels; nan where unknown.
    """

    name: str
    frames: list[Image]
    motions: list[Motion]
    truth: NDArray[np.float64]


def sequence_of(unshaken: VideoSequence, strength: float, seed: int) -> VideoSequence:
    """A sequence shaken by a share of the width."""
    return shaken(unshaken, Shake(strength, "white", seed)) if strength else unshaken


def clip_of(unshaken: VideoSequence, strength: float, seed: int, count: int) -> Clip:
    """The first frames of a sequence, shaken by a share of the width."""
    sequence = sequence_of(unshaken, strength, seed)
    frames = list(islice(sequence.images(), count))
    truth = upright(sequence.truth[: len(frames)])
    camera = ssiam.CameraMotion(model="rigid")
    known = [box if np.isfinite(box).all() else None for box in truth]
    motions = [
        camera.update(frame, box) for frame, box in zip(frames, [None, *known], strict=False)
    ]
    return Clip(unshaken.name, frames, motions[1:], truth)


def one_pass(tracker: StabilizedTracker, clip: Clip) -> tuple[float, bool, float]:
    """Success, whether the end is off the target, and seconds of a frame."""
    truth, first = clip.truth, tuple(clip.truth[0].tolist())
    tracker.init(clip.frames[0], first)
    start = time.perf_counter()
    pairs = zip(clip.frames[1:], clip.motions, strict=True)
    boxes = [first, *(tracker.update(frame, motion).box for frame, motion in pairs)]
    seconds = time.perf_counter() - start
    known = np.isfinite(truth).all(axis=1)
    overlap = iou(np.array(boxes)[known], truth[known])
    auc = success(np.array(boxes)[known], truth[known]).auc
    return auc, float(np.median(overlap[-LAST:])) < OFF, seconds / max(len(boxes) - 1, 1)


def runs(chosen: argparse.Namespace) -> list[Run]:
    """All runs; those of a sequence are next to each other in time, if they are not stored."""
    stored = {} if chosen.out is None else stored_runs(chosen.out)
    loaded = {}
    for tracker, setting in product(chosen.trackers, chosen.settings):
        memory, distractors = SETTINGS[setting]
        loaded[tracker, setting] = load(
            tracker, chosen.stabilize, template_memory=memory, distractors=distractors
        )
    found = []
    for data in chosen.sets:
        for unshaken, strength in product(sequences_of(data), chosen.strengths):
            if not np.isfinite(sequence_of(unshaken, strength, chosen.seed).truth[0]).all():
                continue  # the shake moves the target out of the first frame
            clip = None
            for (tracker, setting), prototype in loaded.items():
                run = Run(
                    *(tracker, setting, data, strength),
                    *(chosen.seed, chosen.frames, chosen.stabilize),
                    unshaken.name,
                )
                if run not in stored:
                    clip = clip or clip_of(unshaken, strength, chosen.seed, chosen.frames)
                    auc, off, seconds = one_pass(prototype.clone(), clip)
                    stored[run] = replace(run, success=auc, off=off, seconds=seconds)
                    print(stored[run], file=sys.stderr, flush=True)
                    if chosen.out is not None:
                        with chosen.out.open("a") as file:
                            file.write(json.dumps(asdict(stored[run])) + "\n")
                found.append(stored[run])
    return found


def stored_runs(path: Path) -> dict[Run, Run]:
    """The runs of a file of results, by the runs without results."""
    lines = path.read_text().splitlines() if path.exists() else []
    found = [Run(**json.loads(text)) for text in lines]
    return {run.planned: run for run in found}


def row(own: list[Run], base: list[Run]) -> str:
    """A line of the table: a tracker with a setting, on a set under a shake."""
    first = own[0]
    ours, theirs = ({each.sequence: each.success for each in runs} for runs in (own, base))
    gain = paired_difference(ours, theirs)
    is_base = first.setting == base[0].setting
    ratio = sum(each.seconds for each in own) / sum(each.seconds for each in base)
    cells = (
        f"{first.tracker} {first.setting}",
        f"{first.data} ({len(own)})",
        f"{100 * first.strength:g} %" if first.strength else "none",
        f"{np.mean(list(ours.values())):.3f}",
        "" if is_base else f"{gain.value:+.3f} [{gain.low:+.3f}, {gain.high:+.3f}]",
        str(sum(each.off for each in own)),
        f"{ratio:.2f}",
    )
    return line(cells)


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trackers", nargs="+", default=["nanotrack_v2", "lite"])
    parser.add_argument("--settings", nargs="+", default=list(SETTINGS), choices=SETTINGS)
    parser.add_argument("--sets", nargs="+", default=SETS[:2], choices=SETS)
    parser.add_argument("--strengths", nargs="+", type=float, default=[0.0, 0.03])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--frames", type=int, default=150, help="of each sequence, at most")
    parser.add_argument("--out", type=Path, help="file of results; finished runs are not repeated")
    parser.add_argument("--stabilize", default="predict", choices=METHODS)
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = parsed_arguments()
    cv2.setNumThreads(1)
    found = runs(chosen)
    print(f"    python benchmarks/accuracy/related.py {shlex.join(sys.argv[1:])}\n")
    print(head(COLUMNS))
    for data, strength, tracker in product(chosen.sets, chosen.strengths, chosen.trackers):
        same = [
            each
            for each in found
            if (each.data, each.strength, each.tracker) == (data, strength, tracker)
        ]
        base = [each for each in same if each.setting == chosen.settings[0]]
        for setting in chosen.settings:
            print(row([each for each in same if each.setting == setting], base))


if __name__ == "__main__":
    main()
