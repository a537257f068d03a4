"""Track a walker through a shaking clip: as it is, on the steadied view, and on the predicted one.

    python examples/demo.py [--out FOLDER] [--tracker NAME] [--weights PATH]

Writes the videos, a sheet of frames with all boxes, and the camera's path; prints how well each run
held the walker.
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
from ssiam.video import PathPlot, VideoSink, draw_tracks, open_source, side_by_side

HERE = Path(__file__).resolve().parent
CLIP = HERE / "shaky-walker.mp4"
TRUTH = HERE / "shaky-walker.txt"
SHEET_FRAMES = (0, 15, 24, 45, 70, 110)
WHITE = (255, 255, 255)  # BGR, of the true box
COLOURS = {"off": (60, 60, 235), "paper": (230, 170, 40), "predict": (90, 200, 60)}


@dataclass(frozen=True)
class Run:
    """One pass over the clip: the boxes, and their overlap with the true ones."""

    stabilize: str
    boxes: NDArray[np.float64]
    overlaps: NDArray[np.float64]


def main(argv: Sequence[str] | None = None) -> None:
    """Run the demo with the arguments given."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("demo-out"), help="folder to write to")
    parser.add_argument("--tracker", default="lite", choices=ssiam.TRACKERS)
    parser.add_argument("--weights", type=Path, help="of trackers that have any")
    arguments = parser.parse_args(argv)
    arguments.out.mkdir(parents=True, exist_ok=True)
    truth = np.loadtxt(TRUTH, delimiter=",")
    runs = []
    print(f"{arguments.tracker}:")
    for stabilize in COLOURS:
        tracker = ssiam.load_tracker(
            arguments.tracker, weights=arguments.weights, stabilize=stabilize
        )
        runs.append(follow(tracker, truth, arguments.out))
        print(verdict(runs[-1]))
    sheet(runs, truth, arguments.out / "comparison.png")
    print(f"\nThe pictures are in {arguments.out}/:")
    print("  off.mp4, paper.mp4, predict.mp4   the tracked clip, with the tracker's view beside it")
    print("  comparison.png   six frames: true box white, off red, paper blue, predict green")
    print("  paper-path.png, predict-path.png   the camera's path, and what steadying did to it")


def follow(tracker: ssiam.StabilizedTracker, truth: NDArray[np.float64], out: Path) -> Run:
    """Track through the clip, writing the video and, when steadied, the path."""
    config = tracker.config
    boxes = [truth[0]]
    with (
        open_source(CLIP) as frames,
        VideoSink(out / f"{config.stabilize}.mp4", frames.fps) as video,
        PathPlot(out / f"{config.stabilize}-path.png", config.window) as plot,
    ):
        first = next(frames)
        tracker.init(first.image, truth[0])
        start = draw_tracks(first.image, [ssiam.Track(tuple(truth[0].tolist()))])
        video.write(start if config.stabilize == "off" else side_by_side(start, start), first.time)
        for frame in frames:
            track = tracker.update(frame.image)
            boxes.append(np.array(track.box))
            plot.write(track)
            picture = draw_tracks(frame.image, [track])
            if track.stab_from_raw is not None:
                view = ssiam.FrameView(picture, track.stab_from_raw, config.border)
                picture = side_by_side(picture, view.render())
            video.write(picture, frame.time)
    return Run(config.stabilize, np.array(boxes), iou(boxes, truth))


def verdict(run: Run) -> str:
    """One line on how well a run held the walker."""
    held = int((run.overlaps >= 0.5).sum())
    return (
        f"stabilize={run.stabilize:7} held the walker in {held:3d} of {len(run.overlaps)} frames, "
        f"mean overlap {run.overlaps.mean():.2f}"
    )


def sheet(runs: Sequence[Run], truth: NDArray[np.float64], path: Path) -> None:
    """Write six frames of the clip with the boxes of all runs and the true one."""
    panels = []
    with open_source(CLIP) as frames:
        for frame in frames:
            if frame.index in SHEET_FRAMES:
                panel = frame.image.copy()
                drawn = [(truth, WHITE), *((run.boxes, COLOURS[run.stabilize]) for run in runs)]
                for boxes, colour in drawn:
                    x, y, w, h = (round(v) for v in boxes[frame.index])
                    cv2.rectangle(panel, (x, y), (x + w, y + h), colour, 2, cv2.LINE_AA)
                label = f"frame {frame.index}"
                cv2.putText(panel, label, (12, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.8, WHITE, 2)
                panels.append(panel)
    rows = [cv2.hconcat(panels[i : i + 2]) for i in range(0, len(panels), 2)]
    cv2.imwrite(str(path), cv2.vconcat(rows))


if __name__ == "__main__":
    main()
