"""The effect of bf16 and int8 on the boxes of lite and NanoTrack, and on the time of a frame.

    python benchmarks/accuracy/precision.py [--tracker NAME] [--frames N] [--runtime NAME]
        [--data FOLDER]

Each sequence is tracked once from its first box, without stabilization, with one thread. The goals
are a success (area under OTB's curve) within .005 of that of f32 for lite, .01 for NanoTrack, and a
mean overlap of .90 with the boxes of f32. The table also has both numbers for every second
sequence, on which the int8 scheme was chosen for NanoTrack, and for the other sequences. The time
of a frame is the median of whole updates, all precisions in turn, relative to f32. int8 is
calibrated on other images: two videos and a photo. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
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
from ssiam.runtime import Network, RuntimeOptions, load_network
from ssiam.runtime.export import quantize_export
from ssiam.runtime.openvino import supports_bf16
from ssiam.runtime.quantization import calibration_feeds, quantize
from ssiam.trackers import ViewTracker
from ssiam.trackers.lite import NETWORK, SHIPPED, LiteNetworks, LiteTracker
from ssiam.trackers.nanotrack import (
    CONFIDENCE,
    PARAMETERS,
    NanoTrack,
    NanoTrackName,
    NanoTrackNetworks,
)
from ssiam.video import open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import SHARED, VIDEOS, nanotrack_weights, read_bgr, sequences

CALIBRATION = ("handheld.mp4", "shaky-5.avi")  # videos
PHOTO = SHARED / "data" / "photo.jpg"
FRAMES = 16  # of each video
SUBSETS = {"all": slice(None), "chosen by": slice(0, None, 2), "others": slice(1, None, 2)}
SHAPES = ((1, 3, 127, 127), (1, 3, 255, 255))  # of template and search crop

Floats = NDArray[np.float64]


def nanotrack(files: list[Path], name: NanoTrackName, runtime: str, precision: str) -> NanoTrack:
    """NanoTrack from the files of backbone, backbone of the search region, and head."""

    def load(path: Path, shape: tuple[int, ...] | None = None) -> Network:
        return load_network(path, shape, runtime=runtime, precision=precision)  # type: ignore[arg-type]

    template, search, head = files
    networks = NanoTrackNetworks(load(template, SHAPES[0]), load(search, SHAPES[1]), load(head))
    return NanoTrack(networks, PARAMETERS[name], CONFIDENCE[name])


def calibration_images() -> list[Image]:
    """Images for the calibration of int8: the photo, and frames of each video."""
    found = [read_bgr(PHOTO)]
    for name in CALIBRATION:
        with open_source(VIDEOS / name) as source:
            frames = [frame.image for frame in source]
        found += [frames[i * len(frames) // FRAMES] for i in range(FRAMES)]
    return found


def nanotrack_trackers(name: NanoTrackName, runtime: str) -> dict[str, ViewTracker]:
    """NanoTrack in each precision."""
    folder = nanotrack_weights(name)
    backbone, head = (next(folder.glob(f"*{part}*.onnx")) for part in ("backbone", "head"))
    exact = nanotrack([backbone, backbone, head], name, runtime, "f32")
    template = load_network(backbone, SHAPES[0])
    feeds = calibration_feeds(template, SHAPES[1:], calibration_images())
    with TemporaryDirectory() as folder_int8:
        search = Path(folder_int8) / "search.onnx"
        quantize(backbone, search, feeds)
        found = {"f32": exact, "int8": nanotrack([backbone, search, head], name, runtime, "f32")}
    if has_bf16(runtime):
        found["bf16"] = nanotrack([backbone, backbone, head], name, runtime, "bf16")
    return dict(found)


def lite_trackers(runtime: str) -> dict[str, ViewTracker]:
    """The default tracker in each precision, without masks."""

    def load(folder: Path, precision: str) -> LiteTracker:
        options = RuntimeOptions(runtime, precision=precision)  # type: ignore[arg-type]
        return LiteTracker(LiteNetworks.load(folder, options), masks=False)

    with TemporaryDirectory() as folder_int8:
        quantize_export(SHIPPED, Path(folder_int8), NETWORK, calibration_images())
        found = {"f32": load(SHIPPED, "f32"), "int8": load(Path(folder_int8), "int8")}
    if has_bf16(runtime):
        found["bf16"] = load(SHIPPED, "bf16")
    return dict(found)


def has_bf16(runtime: str) -> bool:
    """Whether this runtime computes in bf16 on this CPU."""
    return runtime == "openvino" and supports_bf16()


def tracked(
    trackers: dict[str, ViewTracker], sequence: VideoSequence, count: int
) -> tuple[dict[str, Floats], dict[str, list[float]]]:
    """Boxes (n, 4) of at most `count` frames by precision, the first one the true one; seconds."""
    frames = islice(sequence.images(), count)
    first = next(frames)
    boxes = {name: [np.array(sequence.box(0))] for name in trackers}
    seconds: dict[str, list[float]] = {name: [] for name in trackers}
    for tracker in trackers.values():
        tracker.init(FrameView(first), sequence.box(0))
    for frame in frames:
        for name, tracker in trackers.items():
            view = FrameView(frame)
            start = time.perf_counter()
            track = tracker.update(view)
            seconds[name].append(time.perf_counter() - start)
            boxes[name].append(np.array(track.box))
    return {name: np.array(found) for name, found in boxes.items()}, seconds


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
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracker", default="lite")
    parser.add_argument("--frames", type=int, default=10_000, help="at most, per sequence")
    parser.add_argument("--runtime", default="openvino")
    parser.add_argument("--data", type=Path, help="other sequences than those of the test data")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if arguments.tracker == "lite":
        trackers = lite_trackers(arguments.runtime)
    else:
        name = check_choice("tracker", arguments.tracker, tuple(PARAMETERS))
        trackers = nanotrack_trackers(name, arguments.runtime)
    clips = sequences() if arguments.data is None else sequences(arguments.data)
    found: dict[str, list[Floats]] = {precision: [] for precision in trackers}
    seconds: dict[str, list[float]] = {precision: [] for precision in trackers}
    for clip in clips.values():
        boxes, times = tracked(trackers, clip, arguments.frames)
        for precision in trackers:
            found[precision].append(boxes[precision])
            seconds[precision] += times[precision]
    if "bf16" not in found:
        print("bf16 is left out: this CPU or runtime does not support it\n")
    print("| sequences | precision | overlap with the boxes of f32 | success (AUC) |")
    print("|---|---|---|---|")
    for subset, which in SUBSETS.items():
        truths = list(clips.values())[which]
        for precision, all_runs in found.items():
            row = cells(all_runs[which], found["f32"][which], truths)
            print(f"| {subset} | {precision} | {row} |")
    print("\n| precision | time of a frame, relative to f32 |")
    print("|---|---|")
    exact_seconds = statistics.median(seconds["f32"])
    for precision, own in seconds.items():
        print(f"| {precision} | {statistics.median(own) / exact_seconds:.2f} |")


if __name__ == "__main__":
    main()
