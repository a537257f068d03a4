"""The locked view: distance of the target from its position, border, smoothness.

    python benchmarks/render/locked.py --out runs/locked [--sets sequences reserve videos]
        [--frames 80] [--kind white] [--strength 0.03] [--seed 0] [--live]
        [--aspect source] [--zoom follow] [--position middle] [--strips FOLDER]

For each clip, in frames in which lite with "predict" is not lost: root mean square distance of the
target's true center from its wanted position, in raw pixels, beside the error of the tracker's
centers, and that of a plain crop around the box of CSRT, and of CSRT on the frames stabilized by
vidstab. Then the share of output pixels outside of the frame, and the third difference of the
view's center in scene coordinates in relation to the plain crop's: by the recorded motion, and by
the shake and the estimated motion of the unshaken frames. A cell that does not reach its bar has an
asterisk: 1.15 times the tracker's error and not more than either crop, 1 % and 1/3.

The recordings are kept in --out, so that other settings need no tracker; remove the folder when a
tracker changes. The sequences of the reserve choose nothing. The videos have a box in each tenth
frame, drawn by hand or, for the red sculpture of shaky-5.avi, by its color and checked by eye
(boxes.csv). --live measures `LockedCamera`, which knows no later frames. Needs the folder of test
data (see benchmarks/common/data.py), and a package index for vidstab.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from ssiam.datasets.shake.path import SHAKE_KINDS
from ssiam.geometry import Image, Transform
from ssiam.render.locked import LockedViews, locked_views
from ssiam.render.locked_config import ASPECTS, POSITIONS, ZOOMS, LockedConfig
from ssiam.render.locked_live import LockedCamera

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.tables import head, line
from benchmarks.render.recordings import (
    FOLDERS,
    RATE,
    Clip,
    Floats,
    Recording,
    annotated_videos,
    recorded,
    sequence_clip,
    sequence_names,
    video_clip,
)

FACTOR = 1.15  # of the tracker's error
BORDER = 0.01
SMOOTHER = 1 / 3
GRID = 64  # points across and down, at which border is counted
STRIP, STRIP_HEIGHT = 6, 180  # frames of a strip, and the height of each in pixels
COLUMNS = (
    "clip",
    "frames",
    "lost",
    "distance",
    "tracker",
    "ratio",
    "CSRT",
    "vidstab + CSRT",
    "border",
    "third difference",
    "of plain",
    "of plain, true motion",
)


@dataclass(frozen=True)
class Measured:
    """The measures of one clip; distances in raw pixels, shares from 0."""

    frames: int
    lost: int
    distance: float
    tracker: float
    csrt: float
    vidstab_csrt: float
    border: float
    third: float
    third_of_plain: float
    third_of_plain_true: float

    def row(self, name: str) -> str:
        """The line of the table."""
        best = min(self.csrt, self.vidstab_csrt)
        ratio = self.distance / self.tracker
        return line(
            (
                name,
                self.frames,
                self.lost,
                f"{self.distance:.2f}{_star(self.distance > best)}",
                f"{self.tracker:.2f}",
                f"{ratio:.2f}{_star(ratio > FACTOR)}",
                f"{self.csrt:.2f}",
                f"{self.vidstab_csrt:.2f}",
                f"{100 * self.border:.2f} %{_star(self.border > BORDER)}",
                f"{self.third:.2f}",
                f"{self.third_of_plain:.3f}{_star(self.third_of_plain > SMOOTHER)}",
                f"{self.third_of_plain_true:.3f}{_star(self.third_of_plain_true > SMOOTHER)}",
            )
        )


def _star(missed: bool) -> str:
    return " *" if missed else ""


def measure(recording: Recording, views: LockedViews, config: LockedConfig) -> Measured:
    """Measure the views of a recording."""
    truth = centers(recording.truth)
    counted = ~recording.lost & np.isfinite(truth).all(axis=1)
    out_from_raw, size_wh = views.out_from_raw, np.array(views.size_wh, np.float64)
    raw_from_out = np.asarray(np.linalg.inv(out_from_raw), np.float64)
    zoom = np.sqrt(np.linalg.det(out_from_raw[:, :2, :2]))
    wanted = np.array(config.position_xy) * size_wh - 0.5
    missed = (mapped(out_from_raw, truth) - wanted) / zoom[:, None]
    middle = np.tile((size_wh - 1) / 2, (len(truth), 1))
    camera, plain = mapped(raw_from_out, middle), centers(recording.csrt)
    thirds = [
        [third_difference(mapped(scene, path)) for path in (camera, plain)]
        for scene in map(scene_from_raw, (recording.motion, recording.true_motion))
    ]
    return Measured(
        len(truth),
        int(recording.lost.sum()),
        rms(missed[counted]),
        rms((centers(recording.box) - truth)[counted]),
        rms((plain - truth)[counted]),
        rms((centers(recording.vidstab_csrt) - truth)[counted]),
        border(raw_from_out, size_wh, recording.size_wh.astype(np.float64)),
        thirds[0][0],
        thirds[0][0] / thirds[0][1],
        thirds[1][0] / thirds[1][1],
    )


def centers(boxes: Floats) -> Floats:
    """Centers (N, 2) of boxes (N, 4)."""
    return boxes[:, :2] + boxes[:, 2:] / 2


def mapped(matrices: Transform, points: Floats) -> Floats:
    """Map one point (N, 2) by each affine transform (N, 3, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", matrices[:, :2, :2], points) + matrices[:, :2, 2])


def scene_from_raw(cur_from_prev: Transform) -> Transform:
    """Transforms (N, 3, 3) from each frame to the first one."""
    chain = [np.eye(3)]
    for step in cur_from_prev[1:]:
        chain.append(chain[-1] @ np.linalg.inv(step))
    return np.stack(chain)


def third_difference(path: Floats) -> float:
    """Root mean square length of the third difference of a path (N, 2)."""
    return rms(np.diff(path, 3, axis=0))


def rms(vectors: Floats) -> float:
    """Root mean square length of vectors (N, 2)."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def border(raw_from_out: Transform, out_wh: Floats, raw_wh: Floats) -> float:
    """Share of the output's pixels that are outside of the frame."""
    steps = (np.arange(GRID) + 0.5) / GRID
    x, y = np.meshgrid(steps * out_wh[0] - 0.5, steps * out_wh[1] - 0.5)
    points = np.stack([x.ravel(), y.ravel(), np.ones(GRID * GRID)])
    raw = (raw_from_out @ points)[:, :2]
    outside = (raw < -0.5) | (raw > raw_wh[:, None] - 0.5)
    return float(outside.any(axis=1).mean())


def live_views(recording: Recording, config: LockedConfig) -> LockedViews:
    """The views of the live camera."""
    width, height = recording.size_wh.tolist()
    camera = LockedCamera((width, height), config, RATE)
    views = [camera.update(*each) for each in zip(recording.motions, recording.boxes, strict=True)]
    return LockedViews(np.stack(views), camera.out_size_wh)


def strip(frames: list[Image], recording: Recording, views: LockedViews) -> Image:
    """Some frames with box and view, and below each the output; outside of the frame magenta."""
    w, h = views.size_wh
    corners = np.array([[-0.5, w - 0.5, w - 0.5, -0.5], [-0.5, -0.5, h - 0.5, h - 0.5], [1] * 4])
    columns = []
    for index in np.linspace(0, len(frames) - 1, STRIP).astype(int):
        raw, out_from_raw = frames[index].copy(), views.out_from_raw[index]
        view = (np.linalg.inv(out_from_raw) @ corners)[:2].T
        cv2.polylines(raw, [np.round(view).astype(np.int32)], True, (0, 255, 255), 2)
        x, y, box_w, box_h = recording.box[index].astype(int).tolist()
        color = (0, 0, 255) if recording.lost[index] else (0, 255, 0)
        cv2.rectangle(raw, (x, y), (x + box_w, y + box_h), color, 2)
        out = cv2.warpAffine(
            frames[index], out_from_raw[:2], views.size_wh, borderValue=(255, 0, 255)
        )
        pair = [
            cv2.resize(each, (round(each.shape[1] * STRIP_HEIGHT / each.shape[0]), STRIP_HEIGHT))
            for each in (raw, out)
        ]
        widest = max(each.shape[1] for each in pair)
        columns.append(
            np.vstack([np.pad(e, ((0, 0), (0, widest - e.shape[1]), (0, 0))) for e in pair])
        )
    return np.asarray(np.hstack(columns), np.uint8)


def clips(chosen: argparse.Namespace, group: str) -> Iterator[tuple[str, Callable[[], Clip]]]:
    """Names of the clips of a group, and how to make each."""
    if group == "videos":
        for name in annotated_videos():
            yield name, lambda name=name: video_clip(name)  # type: ignore[misc]
        return
    shake = chosen.kind, chosen.strength, chosen.seed
    for name in sequence_names(FOLDERS[group]):
        yield name, lambda name=name: sequence_clip(FOLDERS[group], name, *shake)  # type: ignore[misc]


def shortened(clip: Clip, frames: int | None) -> Clip:
    """The first frames of a clip."""
    motion = None if clip.true_motion is None else clip.true_motion[:frames]
    return replace(clip, frames=clip.frames[:frames], truth=clip.truth[:frames], true_motion=motion)


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    groups = (*FOLDERS, "videos")
    parser.add_argument("--out", type=Path, required=True, help="folder of the recordings")
    parser.add_argument("--sets", nargs="+", default=groups, choices=groups)
    parser.add_argument("--frames", type=int, help="of each clip, from the first; default: all")
    parser.add_argument("--kind", default="white", choices=SHAKE_KINDS)
    parser.add_argument("--strength", type=float, default=0.03)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--live", action="store_true", help="measure the live camera")
    parser.add_argument("--aspect", default="source", choices=ASPECTS)
    parser.add_argument("--zoom", default="follow", choices=ZOOMS)
    parser.add_argument("--position", default="middle", choices=POSITIONS)
    parser.add_argument("--strips", type=Path, help="folder for an image of each clip")
    return parser.parse_args()


def main() -> None:
    """Record what is missing, and print a table for each group of clips."""
    chosen = arguments()
    config = LockedConfig(aspect=chosen.aspect, zoom=chosen.zoom, position=chosen.position)
    for group in chosen.sets:
        shake = "" if group == "videos" else f"-{chosen.kind}-{chosen.strength:g}-{chosen.seed}"
        folder = chosen.out / f"{group}{shake}-{chosen.frames or 'all'}"
        print(f"{group}{shake.replace('-', ' ')}\n\n{head(COLUMNS)}")
        for name, make in clips(chosen, group):
            recording = recorded(
                lambda make=make: shortened(make(), chosen.frames),  # type: ignore[misc]
                folder / f"{name}.npz",
                chosen.out / "environments",
            )
            views = (
                live_views(recording, config)
                if chosen.live
                else locked_views(recording.motions, recording.boxes, config, RATE)
            )
            print(measure(recording, views, config).row(name), flush=True)
            if chosen.strips:
                chosen.strips.mkdir(parents=True, exist_ok=True)
                image = strip(make().frames[: chosen.frames], recording, views)
                cv2.imwrite(str(chosen.strips / f"{name}.png"), image)
        print()


if __name__ == "__main__":
    main()
