"""Make the demo clip: footage of a fixed surveillance camera, with a simulated camera shake.

Conventions as in `ssiam.geometry`: pixels, x right, y down, 0-based; angles in radians, clockwise
on screen; ``clip_from_source @ (x, y, 1)`` maps a source point to the clip. A motion row is
(dx, dy, angle), the motion of the image in the clip: the image in the still window is rotated by
angle about the window's center, then shifted by (dx, dy). The camera itself moves the other way.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import (
    XYWH,
    Image,
    Transform,
    corners_from_xywh,
    frame_center,
    map_box,
    map_points,
    rigid,
)

HERE = Path(__file__).resolve().parent
FIRST_FRAME, LAST_FRAME = 626, 742
CLIP_WH = (640, 360)
CLIP_FPS = 25
CRF = "23"
STILL_WINDOW_XY = (64, 48)

# Standard deviations of dx, dy (pixels) and angle (radians) in each frame. The white jitter is 3 %
# of the clip's width and 1 % of its height; it is clipped at two standard deviations, so that the
# shaken window always fits into the source frame.
JITTER = (19.2, 3.5, 0.006)
JITTER_LIMIT = 2.0  # standard deviations
DRIFT = (7.0, 9.0, 0.010)
DRIFT_CUTOFF = 0.1  # cycles a frame
PAN_PX = 10.0
SEED = 3


def main(argv: Sequence[str] | None = None) -> None:
    """Write the clip, its ground truth and its motion; `argv` defaults to the command line's."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", type=Path, help="vtest.avi of the OpenCV samples")
    parser.add_argument("--out", type=Path, default=HERE, help="folder to write to")
    parser.add_argument(
        "--seed", type=int, default=SEED, help="seed of the shake (default: %(default)s)"
    )
    args = parser.parse_args(argv)
    cv2.setNumThreads(1)
    make_clip(args.source, args.out, args.seed)


def make_clip(source: Path, out: Path, seed: int) -> None:
    """Write shaky-walker.mp4, shaky-walker.txt and shaky-walker-motion.csv into `out`."""
    frames = read_frames(source, FIRST_FRAME, LAST_FRAME)
    motion = shake(len(frames), seed)
    transforms = [clip_from_source(row) for row in motion]
    height, width = frames[0].shape[:2]
    check_window(transforms, (width, height))
    clip = [render(frame, transform) for frame, transform in zip(frames, transforms, strict=True)]
    source_boxes = interpolate_boxes(HERE / "walker-keyboxes.csv", FIRST_FRAME, LAST_FRAME)
    clip_boxes = [map_box(t, xywh) for t, xywh in zip(transforms, source_boxes, strict=True)]
    check_boxes(clip_boxes)
    write_video(out / "shaky-walker.mp4", clip)
    np.savetxt(out / "shaky-walker.txt", clip_boxes, fmt="%.2f", delimiter=",")
    write_motion(out / "shaky-walker-motion.csv", motion)


def read_frames(path: Path, first: int, last: int) -> list[Image]:
    """Read the frames `first` to `last` (inclusive) of a video; (H, W, 3) uint8, BGR."""
    if not path.is_file():
        raise FileNotFoundError(f"no video {path}; README.md says where vtest.avi comes from")
    with av.open(str(path)) as container:
        frames = [
            frame.to_ndarray(format="bgr24").astype(np.uint8, copy=False)
            for index, frame in enumerate(container.decode(video=0))
            if first <= index <= last
        ]
    if len(frames) != last - first + 1:
        raise ValueError(f"{path} ends before frame {last}; is it OpenCV's vtest.avi?")
    return frames


def shake(count: int, seed: int) -> NDArray[np.float64]:
    """Return the motion (N, 3) of the image: slow pan, 1/f drift and white jitter."""
    rng = np.random.default_rng(seed)
    motion = np.column_stack(
        [
            drift_sd * drift(count, rng) + jitter_sd * jitter(count, rng)
            for drift_sd, jitter_sd in zip(DRIFT, JITTER, strict=True)
        ]
    )
    motion[:, 0] += np.linspace(PAN_PX / 2, -PAN_PX / 2, count)
    return motion


def drift(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return 1/f noise (N,) of zero mean and unit standard deviation.

    The amplitude is zero above `DRIFT_CUTOFF`; faster motion comes from the jitter.
    """
    frequency = np.fft.rfftfreq(count)
    slow = (frequency > 0) & (frequency <= DRIFT_CUTOFF)
    amplitude = np.zeros(frequency.shape)
    amplitude[slow] = 1 / frequency[slow]
    phase = rng.uniform(0, 2 * np.pi, frequency.shape)
    noise = np.fft.irfft(amplitude * np.exp(1j * phase), count)
    return np.asarray(noise / noise.std(), dtype=np.float64)


def jitter(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return white Gaussian noise (N,) of unit standard deviation, clipped at `JITTER_LIMIT`."""
    return np.clip(rng.standard_normal(count), -JITTER_LIMIT, JITTER_LIMIT)


def clip_from_source(motion_row: NDArray[np.float64]) -> Transform:
    """Return the transform of one frame: still window's corner to the origin, then the shake."""
    dx, dy, angle = motion_row
    still_from_source = rigid(-STILL_WINDOW_XY[0], -STILL_WINDOW_XY[1], 0.0)
    return rigid(dx, dy, angle, frame_center(CLIP_WH)) @ still_from_source


def render(source_frame: Image, transform: Transform) -> Image:
    """Warp a source frame to a clip frame by `transform` (clip from source); bilinear."""
    warped = cv2.warpAffine(source_frame, transform[:2], CLIP_WH, flags=cv2.INTER_LINEAR)
    return np.asarray(warped, dtype=np.uint8)


def check_window(transforms: Sequence[Transform], source_wh: tuple[int, int]) -> None:
    """Raise `ValueError` if a clip frame would show anything outside the source frame."""
    width, height = CLIP_WH
    clip_corners = corners_from_xywh((0, 0, width - 1, height - 1))
    for index, transform in enumerate(transforms):
        corners = map_points(np.linalg.inv(transform).astype(np.float64), clip_corners)
        if (corners < 0).any() or (corners > np.array(source_wh) - 1).any():
            raise ValueError(f"frame {index} leaves the source frame; choose another seed")


def interpolate_boxes(path: Path, first: int, last: int) -> NDArray[np.float64]:
    """Return boxes xywh (N, 4) in source pixels, linear between the key boxes of a CSV file."""
    keys = np.loadtxt(path, delimiter=",", skiprows=1)
    frames = np.arange(first, last + 1)
    return np.column_stack([np.interp(frames, keys[:, 0], keys[:, k]) for k in range(1, 5)])


def check_boxes(clip_boxes: Sequence[XYWH]) -> None:
    """Raise `ValueError` if the walker's box is not completely inside a frame of the clip."""
    for index, (x, y, w, h) in enumerate(clip_boxes):
        if x < 0 or y < 0 or x + w > CLIP_WH[0] or y + h > CLIP_WH[1]:
            raise ValueError(f"the walker leaves frame {index} of the clip; choose another seed")


def write_video(
    path: Path, frames: Sequence[Image], fps: int = CLIP_FPS, preset: str = "veryslow"
) -> None:
    """Encode BGR frames of one size as H.264 in yuv420p."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=fps)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.thread_count = 1
        stream.options = {"crf": CRF, "preset": preset}
        for index, pixels in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(pixels, format="bgr24")
            frame.pts, frame.time_base = index, Fraction(1, fps)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def write_motion(path: Path, motion: NDArray[np.float64]) -> None:
    """Write rows of frame, dx, dy (pixels) and angle (radians); the clip's frames from 0."""
    rows = np.column_stack([np.arange(len(motion)), motion])
    header = "frame,dx,dy,angle"
    np.savetxt(path, rows, ("%d", "%.3f", "%.3f", "%.6f"), ",", header=header, comments="")


if __name__ == "__main__":
    main()
