"""Rate of `ssiam track` with a view at 1080p, against a plain decode and encode of the same clip.

    python benchmarks/speed/video.py [--view locked] [--overlay none] [--runs 3] [--size 1920x1080]

The clip is examples/shaky-walker.mp4, enlarged and played three times. Both are processes of their
own and run in turn; the time of a clip of one frame is subtracted from each, so that imports and
the loading of the network do not count. The medians are printed with the CPU, and the ratio of each
run; then the processor time of each per frame, which other work on the machine changes less. The
exit code is 1 if the ratio is below .5.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ssiam.video import VideoSink, open_source

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
CLIP = EXAMPLES / "shaky-walker.mp4"
REPEATS = 3  # forward, backward, forward: the target's path has no jump
LEAST_RATIO = 0.5
COPY = """
import sys
from ssiam.video import VideoSink, open_source
with open_source(sys.argv[1]) as source, VideoSink(sys.argv[2], source.fps) as sink:
    for frame in source:
        sink.write(frame.image, frame.time)
"""


def main() -> None:
    """Print both rates and their ratio; exit with 1 if it is too small."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--view", default="locked", choices=("raw", "stabilized", "locked"))
    parser.add_argument("--overlay", default="none")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--size", default="1920x1080")
    arguments = parser.parse_args()
    width, height = (int(side) for side in arguments.size.split("x"))
    options = ["--view", arguments.view, "--overlay", arguments.overlay]
    with tempfile.TemporaryDirectory() as folder:
        long, short = Path(folder, "long.mp4"), Path(folder, "short.mp4")
        count, box = write_clips(long, short, (width, height))
        times: dict[str, list[tuple[float, float]]] = {"track": [], "copy": []}
        for _ in range(arguments.runs):
            for name in times:
                (wall, busy), (least_wall, least_busy) = (
                    seconds(command(name, clip, Path(folder, "out.mp4"), box, options))
                    for clip in (long, short)
                )
                times[name].append((wall - least_wall, busy - least_busy))
    walls = {name: [wall for wall, _ in each] for name, each in times.items()}
    rates = {name: (count - 1) / statistics.median(each) for name, each in walls.items()}
    ratio = rates["track"] / rates["copy"]
    ratios = [copy / track for track, copy in zip(walls["track"], walls["copy"], strict=True)]
    print(
        f"{cpu_name()}: {arguments.size}, {' '.join(options)}: {rates['track']:.1f} fps; "
        f"decode and encode {rates['copy']:.1f} fps: {ratio:.2f} "
        f"(runs: {', '.join(f'{each:.2f}' for each in ratios)})"
    )
    busy_ms = {
        name: 1e3 * statistics.median(busy for _, busy in each) / (count - 1)
        for name, each in times.items()
    }
    print(f"processor time per frame: {busy_ms['track']:.1f} ms and {busy_ms['copy']:.1f} ms")
    sys.exit(ratio < LEAST_RATIO)


def write_clips(long: Path, short: Path, size_wh: tuple[int, int]) -> tuple[int, str]:
    """Write the enlarged clip and its first frame; number of frames and box of the target."""
    with open_source(CLIP) as source:
        fps, raw_wh = source.fps, source.size_wh
        images = [
            cv2.resize(frame.image, size_wh, interpolation=cv2.INTER_CUBIC) for frame in source
        ]
    there = [*images, *images[-2:0:-1]]
    played = (there * REPEATS)[: REPEATS * len(images)]
    for path, frames in ((long, played), (short, images[:1])):
        with VideoSink(path, fps) as sink:
            for image in frames:
                sink.write(np.asarray(image, dtype=np.uint8))
    truth = np.loadtxt(CLIP.with_suffix(".txt"), delimiter=",")[0]
    box = truth * np.tile(np.divide(size_wh, raw_wh), 2)
    return len(played), ",".join(f"{value:.1f}" for value in box)


def command(name: str, clip: Path, out: Path, box: str, options: Sequence[str]) -> list[str]:
    """The arguments of a Python process that writes `out`."""
    if name == "copy":
        return ["-c", COPY, str(clip), str(out)]
    words = ["-m", "ssiam", "track", str(clip), "--box", box, "--out", str(out)]
    return [*words, *options, "--overwrite", "--quiet"]


def seconds(arguments: Sequence[str]) -> tuple[float, float]:
    """Wall time and processor time of a Python process."""
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def cpu_name() -> str:
    """The model of the CPU."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), "CPU")


if __name__ == "__main__":
    main()
