"""Identity switches of other people's trackers under shake: off, their own motion, and ours.

    python benchmarks/motion/hosts.py [--hosts norfair ...] [--clips TUD-Campus ...]
        [--strengths 0.02 0.05] [--seeds 5] [--frames 60] [--runs runs/hosts]

The four multi-object clips of the test data are shaken by independent shifts of a share of the
width, with roll. The detector's boxes are the true ones with noise: of 3 % of the box in position
and size, 5 % are missing, and those with less than 40 % inside of the frame. Boxes and noise are
the same for every tracker and every motion. An identity switch is a box of an object whose
identity is another one than that of the object's last box with an identity.

"extra" is the sum over the shaken clips of the switches beyond those of the same tracker with the
same motion on the unshaken clip; "beyond off", beyond those of the tracker without any motion on
the unshaken clip, since a wrong motion also ends identities where nothing shakes. Intervals (95 %)
are from a bootstrap over clips, strengths and seeds. "with identity" is the share of the boxes that
have one. Times are process times per frame, tracker included.

The hosts are installed into build/hosts, as by `make hosts`. Finished clips are kept in `--runs`,
so that the benchmark may be stopped and continued. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.common.data import CHECKOUT, MOT, read_bgr
from benchmarks.common.environments import EstimatorFailed, JsonProcess, environment
from benchmarks.common.host_packages import ENVIRONMENTS, REQUIREMENTS
from benchmarks.common.tables import head, line
from ssiam.datasets.mot import MotClip, clip_folders, read_clip
from ssiam.datasets.shake import Shake
from ssiam.datasets.shake.camera import shaking_camera
from ssiam.geometry import map_points
from ssiam.outputs import atomic_write, make_folder

MOTIONS = ("off", "own", "ssiam")
WITHOUT_OWN = ("supervision",)
NOISE = 0.03  # standard deviation of a box's center and of the log of its sides, share of the side
MISSING = 0.05  # share of the boxes
MIN_VISIBLE = 0.4  # share of a box inside of the frame
RESAMPLES = 2000

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """The result of a tracker on a clip.

    Attributes
    ----------
    host, motion, clip : str
    strength : float
        0 for the unshaken clip.
    seed : int
    switches, boxes, with_identity : int
    ms : float
        Median over the frames.
    """

    host: str
    motion: str
    clip: str
    strength: float
    seed: int
    switches: int
    boxes: int
    with_identity: int
    ms: float


def switches(objects: Sequence[Sequence[int]], identities: Sequence[Sequence[int | None]]) -> int:
    """How often the identity of an object changes, over the frames in which it has one."""
    last: dict[int, int] = {}
    count = 0
    for numbers, found in zip(objects, identities, strict=True):
        for number, identity in zip(numbers, found, strict=True):
            if identity is not None:
                count += last.get(number, identity) != identity
                last[number] = identity
    return count


def write_clip(
    clip: MotClip, frames: int, strength: float, seed: int, folder: Path
) -> list[list[int]]:
    """Write frames.npy and boxes.json of a shaken clip; returns the objects of the boxes."""
    images = [read_bgr(path) for path in clip.paths(0)[:frames]]
    height, width = images[0].shape[:2]
    camera = shaking_camera(Shake(strength, seed=seed), len(images), (width, height), clip.name)
    poses = camera.poses(np.arange(len(images), dtype=np.float64))
    np.save(folder / "frames.npy", [camera.render(image, i) for i, image in enumerate(images)])
    rng = np.random.default_rng([seed, len(images)])
    objects: list[list[int]] = [[] for _ in images]
    boxes: list[list[list[float]]] = [[] for _ in images]
    for each in clip.objects:
        for index, xywh in zip(each.frames[each.frames < frames].tolist(), each.xywh, strict=False):
            noise, is_missing = rng.normal(0, NOISE, 4), rng.random() < MISSING
            size = xywh[2:] * np.exp(noise[2:])
            center = xywh[:2] + xywh[2:] * (0.5 + noise[:2])
            center = map_points(poses[index], center[None])[0]
            corners = np.array([center - size / 2, center + size / 2])
            inside = np.clip(corners, 0, (width, height))
            if not is_missing and np.prod(np.diff(inside, axis=0) / size) >= MIN_VISIBLE:
                objects[index].append(each.number)
                boxes[index].append(inside.ravel().tolist())
    (folder / "boxes.json").write_text(json.dumps(boxes))
    return objects


def score(
    host: str, worker: JsonProcess, folder: Path, objects: Sequence[Sequence[int]]
) -> Iterator[tuple[str, dict[str, float]]]:
    """(motion, results) of a host's tracker on a written clip."""
    for motion in MOTIONS:
        if motion == "own" and host in WITHOUT_OWN:
            continue
        answer = worker.ask({"clip": str(folder), "motion": motion})
        found = answer["identities"]
        yield (
            motion,
            {
                "switches": switches(objects, found),
                "boxes": sum(map(len, objects)),
                "with_identity": sum(one is not None for frame in found for one in frame),
                "ms": float(np.median(answer["ms"])),
            },
        )


def extras(rows: Sequence[Score], motion: str, reference: str) -> Floats:
    """Switches of each shaken clip beyond the unshaken clip with the motion `reference`."""
    still = {(r.clip, r.seed): r.switches for r in rows if r.motion == reference and not r.strength}
    shaken = {(r.clip, r.seed, r.strength): r for r in rows if r.motion == motion and r.strength}
    return np.array([shaken[key].switches - still[key[:2]] for key in sorted(shaken)], np.float64)


def interval(numerator: Floats, denominator: Floats | None = None) -> str:
    """A sum, or a ratio of two sums in %, with its bootstrap interval."""
    picks = np.random.default_rng(0).integers(len(numerator), size=(RESAMPLES, len(numerator)))
    sums = numerator[picks].sum(axis=1)
    value = numerator.sum()
    if denominator is None:
        low, high = np.percentile(sums, (2.5, 97.5))
        return f"{value:.0f} [{low:.0f}, {high:.0f}]"
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = 100 * sums / denominator[picks].sum(axis=1)
        low, high = np.nanpercentile(ratios, (2.5, 97.5))
        return f"{100 * value / denominator.sum():.0f} % [{low:.0f}, {high:.0f}]"


def report(rows: Sequence[Score], strengths: Sequence[float]) -> None:
    """Print a row for each host and motion."""
    columns = ["host", "motion", "unshaken", *(f"at {100 * share:g} %" for share in strengths)]
    columns += ["extra", "of its own", "beyond off", "of its own", "with identity", "ms"]
    print(head(columns))
    for host in dict.fromkeys(row.host for row in rows):
        of_host = [row for row in rows if row.host == host]
        for motion in dict.fromkeys(row.motion for row in of_host):
            of_motion = [row for row in of_host if row.motion == motion]
            shaken = [row for row in of_motion if row.strength]
            counts = [
                sum(row.switches for row in of_motion if row.strength == strength)
                for strength in (0, *strengths)
            ]
            cells: list[object] = [host, motion, *counts]
            for references in ((motion, "own"), ("off", "off")):
                extra = extras(of_host, motion, references[0])
                own = extras(of_host, "own", references[1])
                cells.append(interval(extra))
                cells.append(interval(extra, own) if motion == "ssiam" and own.sum() > 0 else "")
            share = sum(r.with_identity for r in shaken) / sum(r.boxes for r in shaken)
            cells += [f"{100 * share:.1f} %", f"{np.median([row.ms for row in shaken]):.1f}"]
            print(line(cells))


def main() -> None:
    """Run what is not finished, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hosts", nargs="+", choices=REQUIREMENTS, default=list(REQUIREMENTS))
    parser.add_argument("--clips", nargs="+", default=None, metavar="NAME")
    parser.add_argument("--strengths", nargs="+", type=float, default=[0.02, 0.05])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=60, help="of each clip")
    parser.add_argument("--runs", type=Path, default=Path("runs/hosts"), metavar="FOLDER")
    options = parser.parse_args()
    clips = [read_clip(folder) for folder in clip_folders(MOT)]
    clips = [clip for clip in clips if options.clips is None or clip.name in options.clips]
    strengths = (0.0, *options.strengths)
    with ExitStack() as stack:
        workers: dict[str, JsonProcess] = {}
        rows: list[Score] = []
        for seed, clip, strength in product(range(options.seeds), clips, strengths):
            objects: list[list[int]] = []
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            for host in options.hosts:
                path = (
                    options.runs / f"{host}-{clip.name}-{options.frames}-{strength:g}-{seed}.json"
                )
                if not path.is_file():
                    print(path.stem, file=sys.stderr, flush=True)
                    workers[host] = workers.get(host) or stack.enter_context(_started(host))
                    objects = objects or write_clip(clip, options.frames, strength, seed, folder)
                    found = dict(score(host, workers[host], folder, objects))
                    make_folder(path.parent)
                    with atomic_write(path, "w") as file:
                        json.dump(found, file)
                results = json.loads(path.read_text())
                rows += [
                    Score(host, motion, clip.name, strength, seed, **values)
                    for motion, values in results.items()
                ]
            (folder / "frames.npy").unlink(missing_ok=True)
    report(rows, options.strengths)


def _started(host: str) -> JsonProcess:
    try:
        python = environment(host, REQUIREMENTS[host], ENVIRONMENTS)
        script = Path(__file__).with_name("host_trackers.py")
        return JsonProcess([python, script, host], {"PYTHONPATH": str(CHECKOUT / "src")})
    except EstimatorFailed as error:
        raise SystemExit(f"{host}: {error}; leave it out with --hosts") from None


if __name__ == "__main__":
    main()
