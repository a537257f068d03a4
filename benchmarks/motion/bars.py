"""Camera motion where part of the frame shows no scene: bars, a round image, moving borders.

    python benchmarks/motion/bars.py [--keypoints direct,orb] [--codec] [--only round]

The demo clip (examples/), whose true motion is known, in many forms. The error of an estimate is
the distance of the content's center from its true position. It is compared with the error on the
video cropped to its content. With `--codec` every form is compressed as JPEG at quality 70 first.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.errors import check_choice
from ssiam.geometry import Image, frame_center, map_points, rigid
from ssiam.motion import KEYPOINTS
from ssiam.video import open_source

CLIP = Path(__file__).resolve().parents[2] / "examples" / "shaky-walker.mp4"
TOLERANCE = 0.1  # px, by which the error may exceed that on the cropped video
HEAD = (
    "form",
    "content",
    "keypoints",
    "error (worst), px",
    "on the cropped video",
    "unreliable",
    "on the cropped video",
    f"larger by more than {TOLERANCE} px",
)

Floats = NDArray[np.float64]
Form = Callable[[int, Image], Image]  # from frame index and frame
Content = tuple[int, int, int, int]  # left, top, right, bottom, px


def demo() -> tuple[list[Image], Floats]:
    """Frames of the demo clip, and the transform clip_from_still of each."""
    frames = [frame.image for frame in open_source(str(CLIP))]
    with CLIP.with_name("shaky-walker-motion.csv").open() as file:
        rows = [[float(row[key]) for key in ("dx", "dy", "angle")] for row in csv.DictReader(file)]
    return frames, np.stack([rigid(dx, dy, angle, (319.5, 179.5)) for dx, dy, angle in rows])


def barred(side: int, top: int, color: int = 0) -> Form:
    """Bars of one color, widths in pixels."""

    def form(_: int, frame: Image) -> Image:
        out = np.full_like(frame, color)
        rows, columns = slice(top, len(frame) - top), slice(side, frame.shape[1] - side)
        out[rows, columns] = frame[rows, columns]
        return out

    return form


def blurred(side: int) -> Form:
    """The enlarged and blurred content at both sides."""

    def form(_: int, frame: Image) -> Image:
        height, width = frame.shape[:2]
        content = frame[:, side : width - side]
        zoom = width / content.shape[1]
        large = cv2.resize(content, None, fx=zoom, fy=zoom)
        top = (len(large) - height) // 2
        background = cv2.GaussianBlur(large[top : top + height, :width], (0, 0), 12)
        out = np.asarray(background, np.uint8)
        out[:, side : width - side] = content
        return out

    return form


def round_image(_: int, frame: Image) -> Image:
    """A disc on black, the image of an endoscope or a telescope."""
    height, width = frame.shape[:2]
    disc = np.zeros((height, width), np.uint8)
    cv2.circle(disc, (width // 2, height // 2), height // 2, 255, -1)
    return np.asarray(cv2.bitwise_and(frame, frame, mask=disc), np.uint8)


def subtitled(t: int, frame: Image) -> Image:
    """2.35:1 with a line of text in the lower bar."""
    out = barred(0, 44)(t, frame)
    origin, font = (180, 346), cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(out, "What did you say?", origin, font, 0.9, (255, 255, 255), 2)
    return out


def patterned(t: int, frame: Image) -> Image:
    """Bars at the sides with a static pattern."""
    pattern = np.random.default_rng(5).integers(0, 256, (36, 64, 3)).astype(np.uint8)
    height, width = frame.shape[:2]
    resized = cv2.resize(pattern, (width, height), interpolation=cv2.INTER_NEAREST)
    out = np.asarray(resized, np.uint8)
    out[:, 100:-100] = frame[:, 100:-100]
    return out


def forms(poses: Floats) -> Iterator[tuple[str, Form, Content]]:
    """Name, function and content of each form."""
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

    def stabilized(t: int, frame: Image) -> Image:
        return warped(frame, np.linalg.inv(poses[t]))

    yield "stabilized, black borders", stabilized, still

    def half(t: int, frame: Image) -> Image:
        dx, dy = poses[t][:2, 2] - poses[0][:2, 2]
        return warped(frame, rigid(-0.7 * dx, -0.7 * dy, 0))

    yield "half stabilized, shifts alone", half, still


def warped(frame: Image, out_from_frame: Floats) -> Image:
    """The frame warped to 640x360 pixels, with black borders."""
    return np.asarray(cv2.warpAffine(frame, out_from_frame[:2], (640, 360)), np.uint8)


def true_motion(name: str, poses: Floats) -> Floats:
    """cur_from_prev (N - 1, 3, 3) of a form."""
    if name.startswith("stabilized"):
        return np.tile(np.eye(3), (len(poses) - 1, 1, 1))
    if name.startswith("half"):
        shifts = poses[:, :2, 2] - poses[0, :2, 2]
        back = [rigid(-0.7 * dx, -0.7 * dy, 0) for dx, dy in shifts]
        poses = np.stack([b @ pose for b, pose in zip(back, poses, strict=True)])
    return np.stack([b @ np.linalg.inv(a) for a, b in pairwise(poses)])


def motions(frames: list[Image], keypoints: str) -> tuple[Floats, NDArray[np.bool_]]:
    """Estimated cur_from_prev (N - 1, 3, 3) and `reliable` (N - 1,)."""
    camera = ssiam.CameraMotion(check_choice("keypoints", keypoints, KEYPOINTS))
    found = [camera.update(frame) for frame in frames][1:]
    return np.stack([m.cur_from_prev for m in found]), np.array([m.reliable for m in found])


def errors(found: Floats, truth: Floats, content: Content, offset: tuple[int, int]) -> Floats:
    """Distance (N - 1,) of the content's center from its true position, px."""
    left, top, right, bottom = content
    x, y = frame_center((right - left, bottom - top))
    back = rigid(offset[0], offset[1], 0)
    moved = [map_points(back @ f @ np.linalg.inv(back), [(x + left, y + top)])[0] for f in found]
    wanted = [map_points(t, [(x + left, y + top)])[0] for t in truth]
    return np.asarray(np.linalg.norm(np.subtract(moved, wanted), axis=1))


def through_jpeg(image: Image) -> Image:
    """The image compressed as JPEG at quality 70 and read again."""
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 70])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def mean_and_worst(error: Floats) -> str:
    """A cell of the table."""
    return f"{error.mean():.3f} ({error.max():.2f})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keypoints", default="direct,orb", help="comma-separated")
    parser.add_argument("--codec", action="store_true", help="compress as JPEG first")
    parser.add_argument("--only", default="", help="forms whose name contains this")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    frames, poses = demo()
    print("| " + " | ".join(HEAD) + " |")
    print("|---" * len(HEAD) + "|")
    for name, form, content in forms(poses):
        if arguments.only not in name:
            continue
        left, top, right, bottom = content
        images = [form(t, frame) for t, frame in enumerate(frames)]
        if arguments.codec:
            images = [through_jpeg(image) for image in images]
        truth = true_motion(name, poses)
        covered = np.pi * 180**2 if name == "round" else (right - left) * (bottom - top)
        cropped = [np.ascontiguousarray(f[top:bottom, left:right]) for f in images]
        for keypoints in arguments.keypoints.split(","):
            found, reliable = motions(images, keypoints)
            found_cropped, reliable_cropped = motions(cropped, keypoints)
            error = errors(found, truth, content, (0, 0))
            error_cropped = errors(found_cropped, truth, content, (left, top))
            both = reliable & reliable_cropped
            cells = (
                name,
                f"{100 * covered / 640 / 360:.0f} %",
                keypoints,
                mean_and_worst(error[reliable]),
                mean_and_worst(error_cropped[reliable_cropped]),
                f"{100 * (~reliable).mean():.1f} %",
                f"{100 * (~reliable_cropped).mean():.1f} %",
                f"{(error[both] > error_cropped[both] + TOLERANCE).sum()} of {both.sum()}",
            )
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
