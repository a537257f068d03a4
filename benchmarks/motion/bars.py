"""Camera motion where part of the frame shows no scene: bars, a round image, moving borders.

    python benchmarks/motion/bars.py [--keypoints direct,orb] [--codec] [--only round]

The demo clip (examples/), whose true motion is known, in many forms. The error of an estimate is
the distance of the content's middle from where it should be; it is compared with the error on the
video cut to its content. With `--codec` every form goes through JPEG at quality 70 first.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

import ssiam
from ssiam.geometry import frame_centre, map_points, rigid
from ssiam.video import open_source

CLIP = Path(__file__).parents[1] / "examples" / "shaky-walker.mp4"
MOST = 0.1  # px by which the error may be larger than on the cut video
HEAD = (
    "form",
    "content",
    "keypoints",
    "error (worst), px",
    "on the cut video",
    "unreliable",
    "on the cut video",
    f"larger by more than {MOST} px",
)

Frames = list[np.ndarray]
Box = tuple[int, int, int, int]  # left, top, right, bottom


def demo() -> tuple[Frames, np.ndarray]:
    """Frames of the demo clip, and clip_from_still of each."""
    frames = [frame.image for frame in open_source(str(CLIP))]
    with CLIP.with_name("shaky-walker-motion.csv").open() as file:
        rows = [[float(row[key]) for key in ("dx", "dy", "angle")] for row in csv.DictReader(file)]
    return frames, np.stack([rigid(*row, (319.5, 179.5)) for row in rows])


def barred(side: int, top: int, color: int = 0) -> Callable[[int, np.ndarray], np.ndarray]:
    """Bars of one color."""

    def form(_: int, frame: np.ndarray) -> np.ndarray:
        out = np.full_like(frame, color)
        rows, columns = slice(top, len(frame) - top), slice(side, frame.shape[1] - side)
        out[rows, columns] = frame[rows, columns]
        return out

    return form


def blurred(side: int) -> Callable[[int, np.ndarray], np.ndarray]:
    """The content's own enlarged and blurred image at both sides."""

    def form(_: int, frame: np.ndarray) -> np.ndarray:
        height, width = frame.shape[:2]
        content = frame[:, side : width - side]
        zoom = width / content.shape[1]
        large = cv2.resize(content, None, fx=zoom, fy=zoom)
        top = (len(large) - height) // 2
        out = cv2.GaussianBlur(large[top : top + height, :width], (0, 0), 12)
        out[:, side : width - side] = content
        return out

    return form


def round_image(_: int, frame: np.ndarray) -> np.ndarray:
    """A disc in black, as an endoscope or a telescope shows it."""
    height, width = frame.shape[:2]
    disc = np.zeros((height, width), np.uint8)
    cv2.circle(disc, (width // 2, height // 2), height // 2, 255, -1)
    return cv2.bitwise_and(frame, frame, mask=disc)


def subtitled(t: int, frame: np.ndarray) -> np.ndarray:
    """2.35:1 with a line of text in the lower bar."""
    out = barred(0, 44)(t, frame)
    place, font = (180, 346), cv2.FONT_HERSHEY_SIMPLEX
    return cv2.putText(out, "What did you say?", place, font, 0.9, (255, 255, 255), 2)


def patterned(t: int, frame: np.ndarray) -> np.ndarray:
    """Bars at the sides with a pattern that stands still."""
    out = np.random.default_rng(5).integers(0, 256, (36, 64, 3)).astype(np.uint8)
    out = cv2.resize(out, frame.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    out[:, 100:-100] = frame[:, 100:-100]
    return out


def forms(poses: np.ndarray) -> Iterator[tuple[str, Callable[[int, np.ndarray], np.ndarray], Box]]:
    """Name, what it does to a frame, and its content."""
    still = (60, 40, 580, 320)
    for name, side, top, color in (
        ("4:3 in 16:9", 80, 0, 0),
        ("2.35:1", 0, 44, 0),
        ("2.35:1 in 4:3 in 16:9", 80, 44, 0),
        ("9:16 in 16:9", 219, 0, 0),
        ("narrow strip", 260, 0, 0),
        ("4:3, white", 80, 0, 255),
        ("4:3, gray", 80, 0, 128),
        ("lines of a capture card", 7, 3, 0),
    ):
        yield name, barred(side, top, color), (side, top, 640 - side, 360 - top)
    yield "4:3, blurred background", blurred(80), (80, 0, 560, 360)
    yield "9:16, blurred background", blurred(219), (219, 0, 421, 360)
    yield "round", round_image, (193, 53, 447, 307)
    yield "2.35:1 with a subtitle", subtitled, (0, 44, 640, 316)
    yield "4:3, pattern at the sides", patterned, (100, 0, 540, 360)

    def stabilized(t: int, frame: np.ndarray) -> np.ndarray:
        return cv2.warpAffine(frame, np.linalg.inv(poses[t])[:2], (640, 360))

    yield "stabilized, black borders", stabilized, still

    def half(t: int, frame: np.ndarray) -> np.ndarray:
        dx, dy = poses[t][:2, 2] - poses[0][:2, 2]
        return cv2.warpAffine(frame, rigid(-0.7 * dx, -0.7 * dy, 0)[:2], (640, 360))

    yield "half stabilized, shifts alone", half, still


def true_motion(name: str, poses: np.ndarray) -> np.ndarray:
    """cur_from_prev of each frame but the first in a form."""
    if name.startswith("stabilized"):
        return np.tile(np.eye(3), (len(poses) - 1, 1, 1))
    if name.startswith("half"):
        shifts = poses[:, :2, 2] - poses[0, :2, 2]
        poses = np.stack([rigid(*(-0.7 * s), 0) @ p for s, p in zip(shifts, poses, strict=True)])
    return np.stack([b @ np.linalg.inv(a) for a, b in pairwise(poses)])


def motions(frames: Frames, keypoints: str) -> tuple[np.ndarray, np.ndarray]:
    """cur_from_prev (N - 1, 3, 3) and `reliable` (N - 1,)."""
    camera = ssiam.CameraMotion(keypoints)
    found = [camera.update(frame) for frame in frames][1:]
    return np.stack([m.cur_from_prev for m in found]), np.array([m.reliable for m in found])


def errors(
    found: np.ndarray, truth: np.ndarray, content: Box, offset: tuple[int, int]
) -> np.ndarray:
    """Distance of the content's middle from where it should be, px."""
    left, top, right, bottom = content
    x, y = frame_centre((right - left, bottom - top))
    back = rigid(*offset, 0)
    moved = [map_points(back @ f @ np.linalg.inv(back), [(x + left, y + top)])[0] for f in found]
    wanted = [map_points(t, [(x + left, y + top)])[0] for t in truth]
    return np.linalg.norm(np.subtract(moved, wanted), axis=1)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keypoints", default="direct,orb", help="with commas")
    parser.add_argument("--codec", action="store_true", help="through JPEG first")
    parser.add_argument("--only", default="", help="forms whose name has this in it")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    frames, poses = demo()
    print("| " + " | ".join(HEAD) + " |")
    print("|---" * len(HEAD) + "|")
    for name, form, content in forms(poses):
        if chosen.only not in name:
            continue
        left, top, right, bottom = content
        shown = [form(t, frame) for t, frame in enumerate(frames)]
        if chosen.codec:
            coded = [cv2.imencode(".jpg", f, [cv2.IMWRITE_JPEG_QUALITY, 70])[1] for f in shown]
            shown = [cv2.imdecode(c, cv2.IMREAD_COLOR) for c in coded]
        truth = true_motion(name, poses)
        covered = np.pi * 180**2 if name == "round" else (right - left) * (bottom - top)
        cut_frames = [np.ascontiguousarray(f[top:bottom, left:right]) for f in shown]
        for keypoints in chosen.keypoints.split(","):
            found, told = motions(shown, keypoints)
            cut, cut_told = motions(cut_frames, keypoints)
            own = errors(found, truth, content, (0, 0))
            least = errors(cut, truth, content, (left, top))
            both = told & cut_told
            cells = (
                name,
                f"{100 * covered / 640 / 360:.0f} %",
                keypoints,
                f"{own[told].mean():.3f} ({own[told].max():.2f})",
                f"{least[cut_told].mean():.3f} ({least[cut_told].max():.2f})",
                f"{100 * (~told).mean():.1f} %",
                f"{100 * (~cut_told).mean():.1f} %",
                f"{(own[both] > least[both] + MOST).sum()} of {both.sum()}",
            )
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
