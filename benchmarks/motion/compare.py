"""Camera motion: the estimators of this project and of other libraries against known motion.

    python benchmarks/motion/compare.py [--frames 60] [--seeds 3] [--no-peers] [--plot PATH]

On drawn scenes (bench/motion_bench.py of the test data) the error c is the root mean square over
the frames of the mean distance of the four corners, in pixels. Real footage is shaken by
independent shifts of 2, 3 and 5 % of the width with 1 degree of roll, and by a hand-held path
(1/f). The estimate on a shaken pair of frames should be the estimate on the unshaken pair with the
known shake applied; the error is the mean distance of the corners between the two, in % of the
width.

Every estimator runs in a separate process on one thread, the peers in virtual environments that are
created with pip on the first run. All estimators run on a clip in turn, so that changes of the
machine's speed affect all of them. Times are process times, medians over the frames of a clip,
with color conversion and resizing. Estimators with a mask receive the target's box in the previous
frame. Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from itertools import chain
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.environments import EstimatorFailed
from benchmarks.motion.clips import UNSHAKEN, Clip, drawn_clips, real_clips
from benchmarks.motion.peers import PEERS, Run, Worker
from benchmarks.motion.plot import draw
from benchmarks.motion.report import Score, tables

OURS = ("ssiam-direct", "ssiam-direct-rigid", "ssiam-orb", "ssiam-gftt")
BASELINE = "vidstab-gftt"
SCENES = ("synthetic", "real")
PLOT = Path(__file__).resolve().parents[2] / "docs" / "images" / "motion-pareto.png"
MIN_FRAMES = 5  # the first three of a drawn scene do not count


def scores(clips: Iterator[Clip], workers: Sequence[Worker]) -> Iterator[Score]:
    """Score every estimator on every clip, clip by clip."""
    unshaken: dict[str, Run | EstimatorFailed] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.npz"
        for clip in clips:
            print(f"{clip.source} {clip.scene}: {clip.name}", file=sys.stderr, flush=True)
            clip.save(path)
            for worker in workers:
                run: Run | EstimatorFailed
                try:
                    run = worker.run(path, exclude=clip.exclude)
                except EstimatorFailed as error:
                    run = error
                if clip.scene == UNSHAKEN:
                    unshaken[worker.name] = run
                else:
                    yield score(worker.name, clip, run, unshaken.get(worker.name))


def score(
    estimator: str, clip: Clip, run: Run | EstimatorFailed, unshaken: Run | EstimatorFailed | None
) -> Score:
    """The score of an estimator on a clip, from its results on it and on the unshaken footage."""
    names = estimator, clip.source, clip.scene, clip.name
    if isinstance(run, EstimatorFailed):
        return Score(*names, np.empty(0), failed=str(run))
    if isinstance(unshaken, EstimatorFailed):
        return Score(*names, np.empty(0), failed=f"unshaken: {unshaken}")
    found_unshaken = None if unshaken is None else unshaken.cur_from_prev
    errors = clip.errors(run.cur_from_prev, found_unshaken)
    return Score(*names, errors, float(np.median(run.ms)), float(run.reliable.mean()))


def start(names: Sequence[str], environments: Path, stack: ExitStack) -> Iterator[Worker]:
    """Yield the estimators that can be started, and print a table of all of them."""
    print("| estimator | versions |\n|---|---|")
    for name in names:
        try:
            worker = stack.enter_context(Worker(name, environments))
        except EstimatorFailed as error:
            print(f"| {name} | {error} |", flush=True)
            continue
        versions = ", ".join(f"{package} {number}" for package, number in worker.versions.items())
        print(f"| {name} | {versions} |", flush=True)
        yield worker
    print()


def comma_separated(text: str) -> list[str]:
    """The values of a comma-separated option."""
    return [word.strip() for word in text.split(",") if word.strip()]


def sizes(text: str) -> list[tuple[int, int]]:
    """(width, height) of each size in a text such as "640x360,1280x720"."""
    pairs = [word.split("x") for word in comma_separated(text)]
    return [(int(width), int(height)) for width, height in pairs]


def parsed_arguments() -> argparse.Namespace:
    """Parse and check the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = parser.add_argument_group("what is measured")
    what.add_argument(
        "--estimators",
        type=comma_separated,
        default=[*OURS, *PEERS],
        metavar="A,B,...",
        help="ssiam-KEYPOINTS[-MODEL][-least_squares] or a peer. Default: "
        + ", ".join([*OURS, *PEERS]),
    )
    what.add_argument("--no-peers", action="store_true", help="without the peers")
    what.add_argument(
        "--scenes",
        type=comma_separated,
        default=[*SCENES],
        metavar="A,B",
        help="drawn scenes, real footage. Default: synthetic,real",
    )
    what.add_argument(
        "--no-exclude",
        type=comma_separated,
        default=["hard"],
        metavar="A,B,...",
        help="drawn scenes measured again without the target's box. Default: hard",
    )
    amount = parser.add_argument_group("amount")
    amount.add_argument("--frames", type=int, default=60, help="frames of a clip. Default: 60")
    amount.add_argument("--seeds", type=int, default=3, help="clips of a drawn scene. Default: 3")
    amount.add_argument(
        "--sizes",
        type=sizes,
        default=[(640, 360), (1280, 720)],
        metavar="WxH,...",
        help="sizes of the drawn scenes. Default: 640x360,1280x720",
    )
    where = parser.add_argument_group("output")
    where.add_argument(
        "--by-sequence",
        type=comma_separated,
        default=["ssiam-direct"],
        metavar="A,B,...",
        help="estimators with a table by real sequence. Default: ssiam-direct",
    )
    where.add_argument(
        "--plot",
        type=Path,
        default=PLOT,
        metavar="PATH",
        help="plot of speed against error. Default: docs/images/motion-pareto.png",
    )
    where.add_argument("--json", type=Path, metavar="PATH", help="file of all scores")
    where.add_argument(
        "--environments",
        type=Path,
        default=Path(tempfile.gettempdir()) / "ssiam-motion-peers",
        metavar="DIR",
        help="folder of the peers' virtual environments. Default: in the temporary folder",
    )
    arguments = parser.parse_args()
    if arguments.frames < MIN_FRAMES:
        parser.error(f"--frames {arguments.frames}: must be at least {MIN_FRAMES}")
    for name in arguments.estimators:
        if name not in PEERS and not name.startswith("ssiam-"):
            parser.error(f"unknown estimator {name!r}")
    for scenes in arguments.scenes:
        if scenes not in SCENES:
            parser.error(f"unknown scenes {scenes!r}")
    return arguments


def main() -> None:
    """Run the estimators, and print the tables."""
    arguments = parsed_arguments()
    names = [n for n in arguments.estimators if not (arguments.no_peers and n in PEERS)]
    count = arguments.frames
    clips = {
        "synthetic": drawn_clips(arguments.sizes, count, arguments.seeds, arguments.no_exclude),
        "real": real_clips(count),
    }
    with ExitStack() as stack:
        workers = list(start(names, arguments.environments, stack))
        chosen = chain.from_iterable(clips[s] for s in SCENES if s in arguments.scenes)
        results = list(scores(chosen, workers))
    print(tables(results, BASELINE, arguments.by_sequence))
    for result in results:
        if result.failed:
            clip = f"{result.source} {result.scene}, {result.clip}"
            print(f"\n{result.estimator} failed on {clip}: {result.failed}")
    if arguments.json:
        arguments.json.write_text(json.dumps([r.summary() for r in results], indent=1))
    draw(results, arguments.plot)


if __name__ == "__main__":
    main()
