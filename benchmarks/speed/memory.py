"""Memory of the whole `ssiam track` process over a long 1280x720 video.

    python benchmarks/speed/memory.py [--frames 5000] [--clip VIDEO] [--tracker nanotrack_v3]

Loops a clip into a 1280x720 video, tracks through it with every output on, and samples the
process's resident memory against the number of frames in its result file.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from fractions import Fraction
from itertools import cycle, islice
from pathlib import Path

import cv2
import numpy as np
import psutil

from ssiam.video import VideoSink, open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import VIDEOS, WEIGHTS

SIZE = (1280, 720)
LIMIT_MB = 450
SETTLED = 500  # frame from which memory has to be flat


def loop(clip: str, path: Path, count: int) -> None:
    """Write `count` frames of the clip, there and back again, so that no cut is in it."""
    with open_source(clip) as frames:
        images = [cv2.resize(frame.image, SIZE) for frame in islice(frames, 60)]
    with VideoSink(path, Fraction(30)) as sink:
        for image in islice(cycle(images + images[-2:0:-1]), count):
            sink.write(image)


def sample(process: psutil.Popen, results: Path) -> list[tuple[int, float]]:
    """(frame, resident MB) until the process ends."""
    samples = []
    while process.poll() is None:
        lines = results.read_bytes().count(b"\n") if results.exists() else 0
        samples.append((lines, process.memory_info().rss / 2**20))
        time.sleep(0.25)
    return samples


def main() -> None:
    """Print the samples and the verdict."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=5000)
    parser.add_argument("--clip", default=str(VIDEOS / "shaky-5.avi"))
    parser.add_argument("--tracker", default="nanotrack_v3")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        loop(arguments.clip, folder / "long.mp4", arguments.frames)
        command = [sys.executable, "-m", "ssiam", "track", str(folder / "long.mp4")]
        command += ["--box", "580,190,350,330", "--tracker", arguments.tracker]
        command += ["--results", str(folder / "r.csv"), "--out", str(folder / "o.mp4")]
        if arguments.tracker.startswith("nano"):
            command += ["--weights", str(WEIGHTS / arguments.tracker.replace("_", ""))]
        process = psutil.Popen(command, stdout=subprocess.DEVNULL)
        frames, memory = np.array(sample(process, folder / "r.csv")).T
    if process.returncode != 0:
        raise SystemExit(f"ssiam track ended with exit code {process.returncode}")
    settled = memory[(frames >= SETTLED) & (frames < arguments.frames)]  # not the way out
    for at in range(0, arguments.frames, max(arguments.frames // 10, 1)):
        print(f"frame {at:6d}: {memory[np.searchsorted(frames, at)]:7.1f} MB")
    middle = (settled.max() + settled.min()) / 2
    print(f"peak {memory.max():.1f} MB (limit {LIMIT_MB})")
    print(
        f"from frame {SETTLED}: {settled.min():.1f} to {settled.max():.1f} MB, "
        f"+-{100 * (settled.max() - middle) / middle:.1f} % (limit 3)"
    )


if __name__ == "__main__":
    main()
