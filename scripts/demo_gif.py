"""Make docs/images/demo.gif: a tracker on the example clip, with and without stabilization.

    python scripts/demo_gif.py [--out docs/images/demo.gif]

The left half shows the raw frame with both boxes, the right half the view that the tracker sees.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path
from typing import Literal

import cv2
import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.video import open_source

ROOT = Path(__file__).parents[1]
CLIP = ROOT / "examples" / "shaky-walker.mp4"
WALKER = (53.2, 114.1, 26.5, 66.4)  # xywh in the first frame, pixels
Mode = Literal["off", "predict"]
COLORS: dict[Mode, tuple[int, int, int]] = {"off": (60, 60, 235), "predict": (90, 200, 60)}  # BGR
LABELS: dict[Mode, str] = {"off": "CSRT alone", "predict": "CSRT, stabilized view"}
WIDTH = 300  # width of each half, pixels
CAPTION = 22  # height, pixels
FPS = 12.5  # every second frame of the clip

Image = NDArray[np.uint8]


def main() -> None:
    """Write the GIF."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images" / "demo.gif")
    args = parser.parse_args()
    trackers = {mode: ssiam.load_tracker("csrt", stabilize=mode) for mode in COLORS}
    with tempfile.TemporaryDirectory() as folder, open_source(CLIP) as frames:
        first = next(frames).image
        for tracker in trackers.values():
            tracker.init(first, WALKER)
        for frame in frames:
            tracks = {mode: each.update(frame.image) for mode, each in trackers.items()}
            if frame.index % 2 == 0:
                image = panels(frame.image, tracks)
                cv2.imwrite(f"{folder}/{frame.index // 2:04d}.png", image)
        encode(Path(folder), args.out)


def panels(image: Image, tracks: dict[Mode, ssiam.Track]) -> Image:
    """The raw frame with the boxes on the left, and the stabilized view on the right."""
    raw = image.copy()
    for mode, track in tracks.items():
        draw(raw, track.box, COLORS[mode])
    stab_from_raw = tracks["predict"].stab_from_raw
    view = ssiam.FrameView(raw, np.eye(3) if stab_from_raw is None else stab_from_raw, 0)
    height = round(image.shape[0] * WIDTH / image.shape[1])
    left, right = (
        cv2.resize(each, (WIDTH, height), interpolation=cv2.INTER_AREA)
        for each in (raw, view.render())
    )
    caption = np.full((CAPTION, 2 * WIDTH, 3), 30, np.uint8)
    for column, mode in enumerate(COLORS):
        x = 8 + 108 * column
        cv2.rectangle(caption, (x, 6), (x + 10, 16), COLORS[mode], cv2.FILLED)
        write(caption, LABELS[mode], x + 16)
    write(caption, "what the tracker sees", WIDTH + 8)
    return np.asarray(cv2.vconcat([caption, cv2.hconcat([left, right])]), np.uint8)


def draw(image: Image, box: tuple[float, float, float, float], color: tuple[int, ...]) -> None:
    """Draw a box, in raw-frame pixels."""
    x, y, w, h = (round(value) for value in box)
    cv2.rectangle(image, (x, y), (x + w, y + h), color, 3, cv2.LINE_AA)


def write(image: Image, text: str, x: int) -> None:
    """Write a line of the caption."""
    cv2.putText(image, text, (x, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (255,) * 3, 1, cv2.LINE_AA)


def encode(folder: Path, out: Path) -> None:
    """Encode numbered PNGs as a GIF with one palette."""
    palette = "split[a][b];[a]palettegen=max_colors=64[p];[b][p]paletteuse=dither=none"
    images = f"{folder}/%04d.png"
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error", "-framerate", str(FPS)]
    command += ["-start_number", "1", "-i", images, "-vf", palette, str(out)]
    subprocess.run(command, check=True)


if __name__ == "__main__":
    main()
