"""The effect of bf16 and int8 on the boxes of NanoTrack on the real sequences.

    python benchmarks/accuracy/precision.py [--tracker NAME] [--frames N] [--runtime NAME]

Each sequence is tracked once from its first box, without stabilization. The goals are a success
(area under OTB's curve) within .01 of that of f32, and a mean overlap of .90 with the boxes of f32.
The table also has both numbers for every second sequence, on which the int8 scheme was chosen, and
for the other sequences. int8 is calibrated on other images: two videos and a photo. Needs the
folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam import FrameView
from ssiam.datasets import VideoSequence
from ssiam.errors import check_choice
from ssiam.evaluation.measures.success import mean_success, success
from ssiam.geometry import Image, iou
from ssiam.runtime import Network, load_network
from ssiam.runtime.openvino import supports_bf16
from ssiam.runtime.quantization import calibration_feeds, quantize
from ssiam.trackers.nanotrack import CONFIDENCE, PARAMETERS, NanoTrack, NanoTrackNetworks
from ssiam.video import open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import SHARED, VIDEOS, nanotrack_weights, read_bgr, sequences

CALIBRATION = ("handheld.mp4", "shaky-5.avi")  # videos
PHOTO = SHARED / "data" / "photo.jpg"
FRAMES = 16  # of each video
SUBSETS = {"all": slice(None), "chosen by": slice(0, None, 2), "others": slice(1, None, 2)}
SHAPES = ((1, 3, 127, 127), (1, 3, 255, 255))  # of template and search crop

Floats = NDArray[np.float64]


def networks(files: list[Path], runtime: str, precision: str) -> NanoTrackNetworks:
    """NanoTrack's networks from the files of backbone, backbone of the search region, and head."""

    def load(path: Path, shape: tuple[int, ...] | None = None) -> Network:
        return load_network(path, shape, runtime=runtime, precision=precision)  # type: ignore[arg-type]

    template, search, head = files
    return NanoTrackNetworks(load(template, SHAPES[0]), load(search, SHAPES[1]), load(head))


def calibration_images() -> list[Image]:
    """Images for the calibration of int8: the photo, and frames of each video."""
    found = [read_bgr(PHOTO)]
    for name in CALIBRATION:
        with open_source(VIDEOS / name) as source:
            frames = [frame.image for frame in source]
        found += [frames[i * len(frames) // FRAMES] for i in range(FRAMES)]
    return found


def in_int8(files: list[Path], folder: Path) -> list[Path]:
    """The files with the search region's backbone quantized as by `ssiam weights export`."""
    template = networks(files, "openvino", "f32").template
    feeds = calibration_feeds(template, SHAPES[1], calibration_images())
    quantize(files[1], folder / "search.onnx", [[crop] for crop, _ in feeds])
    return [files[0], folder / "search.onnx", files[2]]


def tracked(tracker: NanoTrack, sequence: VideoSequence, count: int) -> Floats:
    """Boxes (n, 4) of at most `count` frames; the first box is the true one."""
    frames = islice(sequence.images(), count)
    boxes = [sequence.box(0)]
    tracker.init(FrameView(next(frames)), boxes[0])
    return np.array([*boxes, *(tracker.update(FrameView(frame)).box for frame in frames)])


def true_boxes(sequence: VideoSequence, count: int) -> Floats:
    """Upright boxes (count, 4) of the first frames."""
    return np.array([sequence.box(i) for i in range(count)])


def cells(runs: list[Floats], exact: list[Floats], clips: list[VideoSequence]) -> str:
    """Two cells: mean overlap with the boxes of f32, and success."""
    same = np.mean([iou(*pair).mean() for pair in zip(runs, exact, strict=True)])
    pairs = zip(runs, clips, strict=True)
    auc = mean_success([success(run, true_boxes(clip, len(run))) for run, clip in pairs]).auc
    return f"{same:.4f} | {auc:.4f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracker", default="nanotrack_v2")
    parser.add_argument("--frames", type=int, default=10_000, help="at most, per sequence")
    parser.add_argument("--runtime", default="openvino")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    name = check_choice("tracker", arguments.tracker, list(PARAMETERS))
    folder = nanotrack_weights(arguments.tracker)
    backbone, head = (next(folder.glob(f"*{part}*.onnx")) for part in ("backbone", "head"))
    files = [backbone, backbone, head]
    clips = sequences()
    found: dict[str, list[Floats]] = {}
    with TemporaryDirectory() as temporary:
        forms = {"f32": files, "int8": in_int8(files, Path(temporary))}
        if arguments.runtime == "openvino" and supports_bf16():
            forms["bf16"] = files
        for precision, paths in forms.items():
            arithmetic = "bf16" if precision == "bf16" else "f32"  # int8 is part of the file
            loaded = networks(paths, arguments.runtime, arithmetic)
            tracker = NanoTrack(loaded, PARAMETERS[name], CONFIDENCE[name])
            found[precision] = [tracked(tracker, clip, arguments.frames) for clip in clips.values()]
    if "bf16" not in found:
        print("bf16 is left out: this CPU or runtime does not support it\n")
    print("| sequences | precision | overlap with the boxes of f32 | success (AUC) |")
    print("|---|---|---|---|")
    for subset, which in SUBSETS.items():
        truths = list(clips.values())[which]
        for precision, all_runs in found.items():
            row = cells(all_runs[which], found["f32"][which], truths)
            print(f"| {subset} | {precision} | {row} |")


if __name__ == "__main__":
    main()
