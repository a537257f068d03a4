"""What fewer bits do to the boxes: NanoTrack over the real sequences in f32, bf16 and int8.

    python benchmarks/accuracy/precision.py [--tracker NAME] [--frames N] [--runtime NAME]

Each sequence is tracked once from its first box, without steadying. The goal is a success (the
area under OTB's curve) within .01 of that of f32, and a mean overlap of .90 with the boxes of f32.
Both are told of every second sequence too, by which int8 was chosen, and of the others. int8 is
calibrated on other pictures: two videos and a photo. Needs the folder of test data (see
shared_data.py).
"""

from __future__ import annotations

import argparse
import sys
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from ssiam import FrameView
from ssiam.datasets import Sequence
from ssiam.evaluation.measures.success import mean_success, success
from ssiam.geometry import iou
from ssiam.runtime import Network, load_network
from ssiam.runtime.calibration import calibration_feeds, quantise
from ssiam.runtime.openvino import computes_in_bf16
from ssiam.trackers.nanotrack import CONFIDENCE, PARAMETERS, NanoTrack, NanoTrackNetworks
from ssiam.video import open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import SHARED, VIDEOS, WEIGHTS, sequences

CALIBRATION = ("handheld.mp4", "shaky-5.avi")  # videos
PHOTO = SHARED / "data" / "photo.jpg"
FRAMES = 16  # of each video
HALVES = {"all": slice(None), "chosen by": slice(0, None, 2), "others": slice(1, None, 2)}
SHAPES = ((1, 3, 127, 127), (1, 3, 255, 255))


def networks(files: list[Path], runtime: str, precision: str) -> NanoTrackNetworks:
    """NanoTrack's networks from [backbone, backbone of the search region, head]."""

    def load(path: Path, shape: tuple[int, ...] | None = None) -> Network:
        return load_network(path, shape, runtime=runtime, precision=precision)  # type: ignore[arg-type]

    template, search, head = files
    return NanoTrackNetworks(load(template, SHAPES[0]), load(search, SHAPES[1]), load(head))


def pictures() -> list[np.ndarray]:
    """What int8 is calibrated on, (H, W, 3) uint8 BGR: the photo, and frames of each video."""
    found = [cv2.imread(str(PHOTO))]
    for name in CALIBRATION:
        with open_source(VIDEOS / name) as source:
            frames = [frame.image for frame in source]
        found += [frames[i * len(frames) // FRAMES] for i in range(FRAMES)]
    return found


def in_int8(files: list[Path], folder: Path) -> list[Path]:
    """The files with the search region's backbone quantised, as `ssiam weights export` does it."""
    template = networks(files, "openvino", "f32").template
    feeds = calibration_feeds(template, SHAPES[1], pictures())
    quantise(files[1], folder / "search.onnx", [[crop] for crop, _ in feeds])
    return [files[0], folder / "search.onnx", files[2]]


def followed(tracker: NanoTrack, sequence: Sequence, count: int) -> np.ndarray:
    """Boxes (n, 4) of all frames, the first one's given."""
    frames = islice(sequence.images(), count)
    boxes = [sequence.box(0)]
    tracker.init(FrameView(next(frames)), boxes[0])
    return np.array([*boxes, *(tracker.track(FrameView(frame)).box for frame in frames)])


def true_boxes(sequence: Sequence, count: int) -> np.ndarray:
    """Upright boxes (count, 4) of the first frames."""
    return np.array([sequence.box(i) for i in range(count)])


def row(runs: list[np.ndarray], exact: list[np.ndarray], clips: list[Sequence]) -> str:
    """Two cells: overlap of the runs' boxes with the exact ones, and success."""
    same = np.mean([iou(*pair).mean() for pair in zip(runs, exact, strict=True)])
    pairs = zip(runs, clips, strict=True)
    auc = mean_success([success(run, true_boxes(clip, len(run))) for run, clip in pairs]).auc
    return f"{same:.4f} | {auc:.4f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracker", default="nanotrack_v2")
    parser.add_argument("--frames", type=int, default=10_000, help="at most, of a sequence")
    parser.add_argument("--runtime", default="openvino")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    folder = WEIGHTS / given.tracker.replace("_", "")
    backbone, head = (next(folder.glob(f"*{part}*.onnx")) for part in ("backbone", "head"))
    files = [backbone, backbone, head]
    clips = sequences()
    found: dict[str, list[np.ndarray]] = {}
    with TemporaryDirectory() as temporary:
        forms = {"f32": files, "int8": in_int8(files, Path(temporary))}
        if given.runtime == "openvino" and computes_in_bf16():
            forms["bf16"] = files
        for precision, paths in forms.items():
            arithmetic = "bf16" if precision == "bf16" else "f32"  # int8 is in the file
            loaded = networks(paths, given.runtime, arithmetic)
            tracker = NanoTrack(loaded, PARAMETERS[given.tracker], CONFIDENCE[given.tracker])
            found[precision] = [followed(tracker, clip, given.frames) for clip in clips.values()]
    if "bf16" not in found:
        print("bf16 is left out: this CPU or runtime has no such arithmetic\n")
    print("| sequences | precision | overlap with the boxes of f32 | success (AUC) |")
    print("|---|---|---|---|")
    for half, which in HALVES.items():
        truths = list(clips.values())[which]
        for precision, all_runs in found.items():
            print(f"| {half} | {precision} | {row(all_runs[which], found['f32'][which], truths)} |")


if __name__ == "__main__":
    main()
