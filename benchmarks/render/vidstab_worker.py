"""Runs vidstab's live stabilizer over a clip, in its own environment; used by stabilized.py.

    python benchmarks/render/vidstab_worker.py FRAMES.npy OUT.npy WINDOW

Both files are (N, H, W, 3) uint8 BGR. The output has the frames in their order, without the black
ones that vidstab returns while it waits, and without the last WINDOW frames, which it never
returns.
"""

from __future__ import annotations

import sys

import numpy as np


def main(frames: str, out: str, window: int) -> None:
    """Stabilize every frame of `frames` as a live program would."""
    from vidstab import VidStab

    stabilizer = VidStab()
    shown = [
        stabilizer.stabilize_frame(input_frame=frame, smoothing_window=window, border_size=0)
        for frame in np.load(frames, mmap_mode="r")
    ]
    np.save(out, np.array(shown[window:], np.uint8))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
