"""Track a woman through two shaking clips: the tracker alone, and with the shake predicted.

    python examples/demo.py [--out FOLDER]

Prints what happened in each of them, and writes demo.mp4 (left: the tracker alone, right: the same
tracker with ``stabilize="predict"``, the default) and demo.png (three frames of each clip).
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
from ssiam.geometry import Image, iou
from ssiam.video import VideoSink, open_source

FOLDER = Path(__file__).resolve().parent / "demo"
ON_TARGET = 0.5  # overlap from which a box counts as being on the target
LAST_FRAMES = 10  # a target on which the box is in one of these is not lost

RED, GREEN, WHITE, GRAY = (60, 60, 235), (90, 200, 60), (255, 255, 255), (40, 40, 40)  # BGR
CAPTION = 28  # height of the line above each half of the video, pixels
AFTER_LOSS = 4  # frames from the loss to the frame that is shown in the image


@dataclass(frozen=True)
class Clip:
    """A clip of the demo, chosen by scripts/choose_demo.py: NAME.mp4, and boxes in NAME.txt."""

    name: str
    title: str

    @property
    def video(self) -> Path:
        """The video file."""
        return FOLDER / f"{self.name}.mp4"

    @property
    def boxes(self) -> Path:
        """The file with the true box x,y,w,h of each frame."""
        return FOLDER / f"{self.name}.txt"


CLIPS = (
    Clip("rough-road", "The woman in red, camera on a rough road"),
    Clip("vibration", "The woman in red, camera on a vibrating mast"),
)


@dataclass(frozen=True, eq=False)
class Comparison:
    """A clip, tracked without and with stabilization.

    Attributes
    ----------
    clip : Clip
    fps : float
        Frames per second of the clip.
    images : list of (H, W, 3) uint8, BGR
    truth, alone, stabilized : (N, 4) float64
        Boxes x, y, w, h in pixels of the frames: true, tracked alone, tracked with stabilization.
    """

    clip: Clip
    fps: float
    images: list[Image]
    truth: NDArray[np.float64]
    alone: NDArray[np.float64]
    stabilized: NDArray[np.float64]

    @property
    def alone_lost(self) -> int | None:
        """Index of the frame from which the tracker alone has lost its target, or None."""
        return lost_from(iou(self.alone, self.truth))

    @property
    def stabilized_lost(self) -> int | None:
        """Index of the frame from which it is lost in spite of stabilization, or None."""
        return lost_from(iou(self.stabilized, self.truth))


def main(argv: Sequence[str] | None = None) -> None:
    """Run the demo; `argv` defaults to the command line's arguments."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("demo-out"), help="folder to write to")
    out = parser.parse_args(argv).out
    out.mkdir(parents=True, exist_ok=True)
    alone, stabilized = ssiam.load_tracker(stabilize="off"), ssiam.load_tracker()
    comparisons = [compare(clip, alone, stabilized) for clip in CLIPS]
    for comparison in comparisons:
        print(sentence(comparison))
    write_video(comparisons, out / "demo.mp4")
    write_image(comparisons, out / "demo.png")
    print(f"See for yourself: {out / 'demo.mp4'} (video) and {out / 'demo.png'} (image).")


def compare(
    clip: Clip, alone: ssiam.StabilizedTracker, stabilized: ssiam.StabilizedTracker
) -> Comparison:
    """Track the target of a clip from its true box in the first frame, with both trackers."""
    with open_source(clip.video) as source:
        fps = float(source.fps)
        images = [frame.image for frame in source]
    truth = np.loadtxt(clip.boxes, delimiter=",")
    boxes = [track(tracker, images, truth[0]) for tracker in (alone, stabilized)]
    return Comparison(clip, fps, images, truth, *boxes)


def track(
    tracker: ssiam.StabilizedTracker, images: Sequence[Image], box: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The box x, y, w, h in each image (N, 4), given that in the first one."""
    tracker.init(images[0], box.tolist())
    return np.array([box, *(tracker.update(image).box for image in images[1:])])


def lost_from(overlaps: NDArray[np.float64]) -> int | None:
    """Index of the frame from which a target is lost to the end; None if it is not."""
    after_last = int(np.flatnonzero(overlaps >= ON_TARGET).max(initial=-1)) + 1
    return after_last if after_last <= len(overlaps) - LAST_FRAMES else None


def sentence(comparison: Comparison) -> str:
    """What happened to the target, in seconds of the clip."""
    seconds = len(comparison.images) / comparison.fps

    def fate(lost: int | None, keeps: str, loses: str) -> str:
        if lost is None:
            return f"{keeps} her to the end of {seconds:.1f} seconds"
        return f"{loses} her after {lost / comparison.fps:.1f} seconds"

    alone = fate(comparison.alone_lost, "keeps", "loses")
    stabilized = fate(comparison.stabilized_lost, "follows", "loses")
    return f"{comparison.clip.title}: the tracker alone {alone}; with ssiam it {stabilized}."


def write_video(comparisons: Sequence[Comparison], path: Path) -> None:
    """Write all clips, one after the other: left the tracker alone, right with stabilization."""
    with VideoSink(path, comparisons[0].fps, overwrite=True) as video:
        for each in comparisons:
            alone_lost, stabilized_lost = each.alone_lost, each.stabilized_lost
            for index, image in enumerate(each.images):
                left = panel(image, each.alone[index], RED, "tracker alone", index, alone_lost)
                right = panel(
                    image, each.stabilized[index], GREEN, "with ssiam", index, stabilized_lost
                )
                video.write(np.hstack([left, right]))


def panel(
    image: Image,
    box: NDArray[np.float64],
    color: tuple[int, int, int],
    label: str,
    index: int,
    lost: int | None,
) -> Image:
    """One half of a frame of the video: a line of text, and the frame with the box."""
    drawn = image.copy()
    draw_box(drawn, box, color)
    line = np.full((CAPTION, image.shape[1], 3), GRAY, np.uint8)
    if lost is not None and index >= lost:
        label += ": lost"
    write(line, label, color)
    return np.vstack([line, drawn])


def write_image(comparisons: Sequence[Comparison], path: Path) -> None:
    """Write three frames of each clip, a row each: the first, one after the loss, the last."""
    rows = []
    for each in comparisons:
        last = len(each.images) - 1
        lost = each.alone_lost
        between = last // 2 if lost is None else min(lost + AFTER_LOSS, last)
        tiles = [each.images[index].copy() for index in (0, between, last)]
        for tile, index in zip(tiles, (0, between, last), strict=True):
            draw_box(tile, each.alone[index], RED)
            draw_box(tile, each.stabilized[index], GREEN)
            write(tile, f"{index / each.fps:.1f} s", WHITE)
        rows.append(np.hstack(tiles))
    legend = np.full((CAPTION, rows[0].shape[1], 3), GRAY, np.uint8)
    write(legend, "red: tracker alone    green: with ssiam", WHITE)
    cv2.imwrite(str(path), np.vstack([legend, *rows]))


def draw_box(image: Image, box: NDArray[np.float64], color: tuple[int, int, int]) -> None:
    """Draw a box x, y, w, h in pixels."""
    x, y, w, h = (round(value) for value in box.tolist())
    cv2.rectangle(image, (x, y), (x + w, y + h), color, 2, cv2.LINE_AA)


def write(image: Image, text: str, color: tuple[int, int, int]) -> None:
    """Write a line of text at the top left."""
    cv2.putText(image, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, color, 1, cv2.LINE_AA)


if __name__ == "__main__":
    main()
