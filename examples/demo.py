"""Track a walker through a shaking clip: tracker alone, paper's method, and predict.

    python examples/demo.py [--out FOLDER] [--tracker NAME] [--weights PATH]

Writes a video for each, an image of six frames with all boxes, and plots of the camera path. Prints
the number of frames in which each run tracked the walker, and the mean overlap.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.geometry import iou
from ssiam.stabilize import Method
from ssiam.video import PathPlot, VideoSink, draw_tracks, open_source, side_by_side

HERE = Path(__file__).resolve().parent
CLIP = HERE / "shaky-walker.mp4"
TRUTH = HERE / "shaky-walker.txt"
COMPARED_FRAMES = (0, 15, 24, 45, 70, 110)
TRUTH_COLOR = (255, 255, 255)  # BGR
COLORS: dict[Method, tuple[int, int, int]] = {  # BGR, of the runs
    "off": (60, 60, 235),
    "paper": (230, 170, 40),
    "predict": (90, 200, 60),
}


@dataclass(frozen=True)
class Run:
    """One pass over the clip.

    Attributes
    ----------
    stabilize : str
        The stabilization method.
    boxes : (N, 4) float64
        Tracked boxes x, y, w, h in pixels of the raw frames.
    overlaps : (N,) float64
        IoU of the boxes with the ground truth.
    """

    stabilize: Method
    boxes: NDArray[np.float64]
    overlaps: NDArray[np.float64]


def main(argv: Sequence[str] | None = None) -> None:
    """Run the demo; `argv` defaults to the command line's arguments."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("demo-out"), help="folder to write to")
    parser.add_argument("--tracker", default="lite", choices=ssiam.TRACKERS)
    parser.add_argument("--weights", type=Path, help="weights of the tracker, if it needs any")
    arguments = parser.parse_args(argv)
    arguments.out.mkdir(parents=True, exist_ok=True)
    truth = np.loadtxt(TRUTH, delimiter=",")
    runs = []
    print(f"{arguments.tracker}:")
    for stabilize in COLORS:
        tracker = ssiam.load_tracker(
            arguments.tracker, weights=arguments.weights, stabilize=stabilize
        )
        runs.append(track_clip(tracker, truth, arguments.out))
        print(summarize(runs[-1]))
    write_comparison(runs, truth, arguments.out / "comparison.png")
    print(f"\nWritten to {arguments.out}/:")
    print("  off.mp4, paper.mp4, predict.mp4   the tracked clip; right: the stabilized view")
    print("  comparison.png   six frames: ground truth white, off red, paper blue, predict green")
    print("  paper-path.png, predict-path.png   the camera path before and after stabilization")


def track_clip(tracker: ssiam.StabilizedTracker, truth: NDArray[np.float64], out: Path) -> Run:
    """Track the walker through the clip; write the video and, if stabilized, the camera path."""
    config = tracker.config
    boxes = [truth[0]]
    with (
        open_source(CLIP) as frames,
        VideoSink(out / f"{config.stabilize}.mp4", frames.fps) as video,
        PathPlot(out / f"{config.stabilize}-path.png", config.paper.window) as plot,
    ):
        first = next(frames)
        tracker.init(first.image, truth[0])
        start = draw_tracks(first.image, [ssiam.Track(tuple(truth[0].tolist()))])
        video.write(start if config.stabilize == "off" else side_by_side(start, start), first.time)
        for frame in frames:
            track = tracker.update(frame.image)
            boxes.append(np.array(track.box))
            plot.write(track)
            image = draw_tracks(frame.image, [track])
            if track.stab_from_raw is not None:
                view = ssiam.FrameView(image, track.stab_from_raw, config.border)
                image = side_by_side(image, view.render())
            video.write(image, frame.time)
    return Run(config.stabilize, np.array(boxes), iou(boxes, truth))


def summarize(run: Run) -> str:
    """Return one line with the number of frames in which a run overlaps the walker by half."""
    tracked = int((run.overlaps >= 0.5).sum())
    return (
        f"stabilize={run.stabilize:7} tracked the walker in {tracked:3d} of {len(run.overlaps)} "
        f"frames, mean overlap {run.overlaps.mean():.2f}"
    )


def write_comparison(runs: Sequence[Run], truth: NDArray[np.float64], path: Path) -> None:
    """Write an image of six frames with the boxes of all runs and the ground truth."""
    panels = []
    with open_source(CLIP) as frames:
        for frame in frames:
            if frame.index in COMPARED_FRAMES:
                panel = frame.image.copy()
                layers = [(run.boxes, COLORS[run.stabilize]) for run in runs]
                for boxes, color in [(truth, TRUTH_COLOR), *layers]:
                    x, y, w, h = (round(v) for v in boxes[frame.index])
                    cv2.rectangle(panel, (x, y), (x + w, y + h), color, 2, cv2.LINE_AA)
                label = f"frame {frame.index}"
                cv2.putText(panel, label, (12, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.8, TRUTH_COLOR, 2)
                panels.append(panel)
    rows = [cv2.hconcat(panels[i : i + 2]) for i in range(0, len(panels), 2)]
    cv2.imwrite(str(path), cv2.vconcat(rows))


if __name__ == "__main__":
    main()
