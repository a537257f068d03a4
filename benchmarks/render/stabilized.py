"""Stabilized views against ffmpeg's vid.stab (two passes) and vidstab (live).

Two passes: vid.stab (vidstabdetect, vidstabtransform with optalgo=gauss) for several values of its
smoothing, with the zoom that hides its border in 99 % of the frames; ours with the same smoothing
(a Gaussian of .354 times vid.stab's number, in frames) and the same cropped share. Live: vidstab
with its default window of 30 frames, which delays by 30 frames; ours without delay, with the same
cropped share.

What is measured, on the images alone: corners outside of the target's box are followed by optical
flow through the written images, a similarity is fitted to them by RANSAC, so that other moving
objects do not count, and evaluated at nine points of the image. (The box, the ground truth or that
of lite, is mapped by registering each raw frame with its written image.) *Shake* is the mean
distance (pixels a frame, of the enlarged image) of their motion from its mean over a second;
*motion* is their mean motion. *Cropped* is the share of width and height; *border* the share of
frames in which border is visible.

    python benchmarks/render/stabilized.py [CLIP ...]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import ssiam
from benchmarks.common.data import EXAMPLES, VIDEOS, sequences
from benchmarks.common.environments import EstimatorFailed, environment
from benchmarks.common.tables import head, line
from benchmarks.motion.peers import REQUIREMENTS
from ssiam.datasets.shake import Shake, shaken
from ssiam.geometry import XYWH, Image, corners_from_xywh, map_points
from ssiam.motion import CameraMotion, Motion
from ssiam.render import (
    CameraView,
    Crop,
    Renderer,
    ScenePath,
    StabilizedCamera,
    stabilized_views,
)
from ssiam.render.stabilized import SMOOTHING
from ssiam.video import open_source

_WORKER: Final = Path(__file__).with_name("vidstab_worker.py")
_SMOOTHINGS: Final = (15, 30)  # vid.stab's option; 15 is its default, 30 often advised
# vid.stab's kernel is exp(-(i / (smoothing / 2))^2), a Gaussian of smoothing / 2 / sqrt(2).
_SIGMA: Final = 1 / 8**0.5
_WINDOW: Final = 30  # frames, vidstab's default
_COVERED: Final = 0.99  # share of the frames in which the border must be hidden
_DARKEST: Final = 24  # of the clips' values, so that black is border
_BORDER: Final = 8  # values below this are border
_MOST: Final = 0.8  # of width and height is cut away at most
_BOXES: Final = {"handheld.mp4": (260.0, 195.0, 225.0, 285.0)}  # of the target in the first frame
_SHAKES: Final = {
    "Crossing, shaken 3 %": ("Crossing", Shake(0.03, "handheld", border="crop")),
    "Bolt2, shaken 1 %": ("Bolt2", Shake(0.01, "white", border="crop")),
}

Images = NDArray[np.uint8]
"""(N, H, W, 3) BGR."""


@dataclass(frozen=True)
class Clip:
    """Frames of a clip.

    Attributes
    ----------
    name : str
    frames : (N, H, W, 3) uint8 BGR
        No value is below `_DARKEST`.
    fps : float
    boxes : (N, 4) float64 or None
        The target's x, y, w, h in each frame, nan if it is unknown; None if nothing moves.
    """

    name: str
    frames: Images
    fps: float
    boxes: NDArray[np.float64] | None = None

    @property
    def size_wh(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.frames.shape[2], self.frames.shape[1]


def clip_of(name: str, limit: int) -> Clip:
    """A shaken sequence, or a file of the videos or anywhere, with at most `limit` frames."""
    if name in _SHAKES:
        sequence, shake = _SHAKES[name]
        clip = shaken(sequences()[sequence], shake)
        return Clip(name, _prepared(islice(clip.images(), limit)), 30.0, clip.truth[:limit, :4])
    path = Path(name) if Path(name).exists() else VIDEOS / name
    with open_source(path) as source:
        frames = _prepared(frame.image for frame in islice(source, limit))
        clip_fps = float(source.fps)
    box = _BOXES.get(path.name)
    return Clip(path.name, frames, clip_fps, None if box is None else _tracked(frames, box))


def _prepared(images: Iterable[Image]) -> Images:
    """The images, of even size, without values below `_DARKEST`."""
    stacked = np.array(list(images))
    height, width = stacked.shape[1] // 2 * 2, stacked.shape[2] // 2 * 2
    return np.asarray(np.maximum(stacked[:, :height, :width], _DARKEST), np.uint8)


def _tracked(frames: Images, box: XYWH) -> NDArray[np.float64]:
    """The target's box in each frame, by the default tracker."""
    tracker = ssiam.load_tracker()
    tracker.init(frames[0], box)
    return np.array([box, *(tracker.update(frame).box for frame in frames[1:])])


@dataclass(frozen=True)
class Moved:
    """Frames that a stabilizer has moved, not enlarged.

    Attributes
    ----------
    images : (N, H, W, 3) uint8 BGR
    needed : (N,) float64
        Share of width and height to cut away to hide the border of each.
    """

    images: Images
    needed: NDArray[np.float64]

    @property
    def share(self) -> float:
        """Share of width and height to cut away to hide the border in most of the frames."""
        return min(float(np.quantile(self.needed, _COVERED, method="higher")), _MOST)


def vid_stab(clip: Clip, smoothing: int, folder: Path) -> Moved:
    """The clip after ffmpeg's vidstabdetect and vidstabtransform.

    vidstabtransform continues the edge, so its border is found by moving images with a black edge.
    """
    import imageio_ffmpeg

    transforms = folder / "transforms.trf"
    width, height = clip.size_wh
    raw = ["-f", "rawvideo", "-pix_fmt", "bgr24"]
    read = [*raw, "-s", f"{width}x{height}", "-r", f"{clip.fps:.3f}", "-i", "-"]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", *read, "-vf"]

    def filtered(frames: Images, *words: str) -> bytes:
        done = subprocess.run(
            [*command, *words, "-"], input=frames.tobytes(), capture_output=True, check=True
        )
        return done.stdout

    if not transforms.exists():
        detect = f"vidstabdetect=shakiness=10:accuracy=15:result={transforms}"
        filtered(clip.frames, detect, "-f", "null")
    options = f"input={transforms}:smoothing={smoothing}:optalgo=gauss:optzoom=0:crop=black"
    move = (f"format=yuv444p,vidstabtransform={options},format=bgr24", *raw)
    edged = np.zeros_like(clip.frames)
    edged[:, 2:-2, 2:-2] = 255
    moved, masks = (
        np.frombuffer(filtered(frames, *move), np.uint8).reshape(-1, height, width, 3)
        for frames in (clip.frames, edged)
    )
    return Moved(moved, _needed(masks[..., 1] < 128))


def vidstab(clip: Clip, environments: Path, folder: Path) -> Moved:
    """The clip after vidstab's live stabilizer, whose border is black."""
    given, found = folder / "frames.npy", folder / "vidstab.npy"
    np.save(given, clip.frames)
    python = environment("vidstab", REQUIREMENTS["vidstab"], environments)
    subprocess.run([python, _WORKER, given, found, str(_WINDOW)], check=True)
    images: Images = np.load(found)
    return Moved(images, _needed(np.asarray((images < _BORDER).all(axis=3), np.bool_)))


def _needed(masks: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Share of width and height to cut away to hide the border `masks` (N, H, W) of each frame.

    Two pixels at the edge may be border.
    """
    height, width = masks.shape[1:]
    x = np.abs(np.arange(width) - (width - 1) / 2) / (width / 2)
    y = np.abs(np.arange(height) - (height - 1) / 2) / (height / 2)
    distance = np.maximum(x[None], y[:, None])  # 0 in the middle, 1 at the edges
    inner = masks.copy()
    inner[:, :2] = inner[:, -2:] = inner[:, :, :2] = inner[:, :, -2:] = False
    return np.array([1 - np.min(distance, initial=1.0, where=mask) for mask in inner])


def motions_of(clip: Clip) -> list[Motion]:
    """The camera motion to each frame, as `ssiam track` measures it, without the target."""
    camera = CameraMotion(model="similarity")
    boxes: list[XYWH | None] = [None] * len(clip.frames)
    if clip.boxes is not None:
        boxes = [None, *(None if np.isnan(box).any() else tuple(box) for box in clip.boxes[:-1])]
    return [camera.update(f, exclude=box) for f, box in zip(clip.frames, boxes, strict=True)]


def rendered(clip: Clip, views: list[CameraView]) -> Images:
    """The images of the views, with a black border."""
    renderer = Renderer("black")
    return np.array(
        [renderer.render(frame, view) for frame, view in zip(clip.frames, views, strict=False)]
    )


def enlarged(images: Images, share: float) -> Images:
    """The middle of the images, `share` of width and height cut away, in their size."""
    height, width = images.shape[1:3]
    zoom = 1 / (1 - share)
    x, y = (width - 1) / 2, (height - 1) / 2
    matrix = np.array([[zoom, 0, x - zoom * x], [0, zoom, y - zoom * y]])
    return np.array([cv2.warpAffine(image, matrix, (width, height)) for image in images], np.uint8)


def measured(images: Images, clip: Clip) -> tuple[float, float]:
    """Shake and motion of the background, pixels a frame."""
    height, width = images.shape[1:3]
    inner = corners_from_xywh((width / 4, height / 4, width / 2, height / 2))
    middle = np.array([[width / 2, height / 2]])
    points = np.vstack([inner, middle, (inner + np.roll(inner, 1, axis=0)) / 2])
    gray = [_gray(image) for image in images]
    masks = _background(gray, clip)
    steps = np.array(
        [
            map_points(_similarity(a, b, mask), points) - points
            for (a, b), mask in zip(pairwise(gray), masks, strict=False)
        ]
    )
    half = max(1, round(clip.fps / 2))
    slow = np.array(
        [steps[max(i - half, 0) : i + half + 1].mean(axis=0) for i in range(len(steps))]
    )
    shake = np.linalg.norm(steps - slow, axis=2).mean()
    return float(shake), float(np.linalg.norm(steps, axis=2).mean())


def _background(gray: list[Image], clip: Clip) -> list[Image]:
    """Masks (H, W) of what is not the target in each written image: 255, else 0."""
    masks = [np.full(image.shape, 255, np.uint8) for image in gray]
    if clip.boxes is None:
        return masks
    out_from_raw = np.eye(3)
    for mask, image, frame, box in zip(masks, gray, clip.frames, clip.boxes, strict=False):
        raw = _gray(frame)
        height, width = raw.shape
        near = np.asarray(cv2.warpAffine(raw, out_from_raw[:2], (width, height)), np.uint8)
        out_from_raw = _similarity(near, image) @ out_from_raw
        if not np.isnan(box).any():
            x, y, w, h = box
            wide = corners_from_xywh((x - 0.1 * w, y - 0.1 * h, 1.2 * w, 1.2 * h))
            polygon = np.rint(map_points(out_from_raw, wide)).astype(np.int32)
            cv2.fillConvexPoly(mask, polygon, 0)
    return masks


def _gray(image: Image) -> Image:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def _similarity(first: Image, second: Image, mask: Image | None = None) -> NDArray[np.float64]:
    """Motion (3, 3) of most of what `mask` shows, by corners, optical flow and RANSAC."""
    corners = cv2.goodFeaturesToTrack(first, 300, 0.005, 8, mask=mask)
    motion = np.eye(3)
    if corners is None:
        return motion
    moved, status, _ = cv2.calcOpticalFlowPyrLK(
        first, second, corners, np.empty_like(corners), winSize=(21, 21), maxLevel=4
    )
    is_found = status.ravel().astype(bool)
    if is_found.sum() >= 6:
        cv2.setRNGSeed(0)
        found, _ = cv2.estimateAffinePartial2D(
            corners[is_found], moved[is_found], ransacReprojThreshold=1.0, maxIters=5000
        )
        if found is not None:
            motion[:2] = found
    return motion


def main() -> None:
    """Print one table for each clip."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    videos = [str(EXAMPLES / "shaky-walker.mp4"), "handheld.mp4", "shaky-5.avi", *_SHAKES]
    parser.add_argument("clips", nargs="*", default=videos, metavar="CLIP")
    parser.add_argument("--frames", type=int, default=240, help="at most so many of each clip")
    parser.add_argument("--environments", type=Path, default=Path("build/peers"))
    arguments = parser.parse_args()
    for name in arguments.clips:
        clip = clip_of(name, arguments.frames)
        width, height = clip.size_wh
        print(f"\n{clip.name}, {width}x{height}, {len(clip.frames)} frames\n")
        print(head(("method", "delay", "cropped", "shake", "motion", "frames with border")))
        with tempfile.TemporaryDirectory() as folder:
            _compare(clip, arguments.environments, Path(folder))


def _compare(clip: Clip, environments: Path, folder: Path) -> None:
    _row("raw", "", 0.0, clip.frames, clip, 0.0)
    motions = motions_of(clip)
    path = ScenePath(motions, clip.size_wh)
    for smoothing in _SMOOTHINGS:
        moved = vid_stab(clip, smoothing, folder)
        _theirs(f"vid.stab, smoothing {smoothing}", "clip", moved, clip)
        seconds = _SIGMA * smoothing / clip.fps
        for name, wanted in (("same", seconds), ("default", SMOOTHING)):
            views, share = stabilized_views(
                path, clip.fps, crop=Crop(moved.share), smoothing=wanted
            )
            _ours(f"ssiam, {name} smoothing", "clip", clip, views, share)
    views, share = stabilized_views(path, clip.fps)
    _ours("ssiam, all defaults", "clip", clip, views, share)
    try:
        moved = vidstab(clip, environments, folder)
    except EstimatorFailed as error:
        print(f"vidstab: {error}", file=sys.stderr)
        return
    _theirs("vidstab, live", f"{_WINDOW} frames", moved, clip)
    for name, crop in (("ssiam, live", Crop(moved.share)), ("ssiam, live, defaults", Crop())):
        camera = StabilizedCamera(clip.size_wh, clip.fps, crop=crop)
        views = [camera.update(motion) for motion in motions]
        _ours(name, "0", clip, views[: len(moved.images)], camera.share)


def _theirs(name: str, delay: str, moved: Moved, clip: Clip) -> None:
    border = float((moved.needed > moved.share).mean())
    _row(name, delay, moved.share, enlarged(moved.images, moved.share), clip, border)


def _ours(name: str, delay: str, clip: Clip, views: list[CameraView], share: float) -> None:
    images = rendered(clip, views)
    border = float(np.mean([not view.is_filled_by(clip.size_wh) for view in views]))
    _row(name, delay, share, images, clip, border)


def _row(name: str, delay: str, share: float, images: Images, clip: Clip, border: float) -> None:
    shake, motion = measured(images, clip)
    cells = (f"{100 * share:.1f} %", f"{shake:.2f}", f"{motion:.2f}", f"{100 * border:.0f} %")
    print(line((name, delay, *cells)), flush=True)


if __name__ == "__main__":
    main()
