"""Wall time of `make demo` without installing, against a plain decode and encode of its clips.

    python benchmarks/speed/demo.py [--runs 3]

Both run in turn, each as a process of its own, and the ratio of the medians is printed: it must not
exceed 20.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
MAX_RATIO = 20.0
COPY = """
import sys
from ssiam.video import VideoSink, open_source
for number, clip in enumerate(sys.argv[2:]):
    with open_source(clip) as source, VideoSink(f"{sys.argv[1]}/{number}.mp4", source.fps) as sink:
        for frame in source:
            sink.write(frame.image, frame.time)
"""


def main() -> None:
    """Print both times and their ratio; exit with 1 if it is too large."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=3)
    runs = parser.parse_args().runs
    clips = [str(path) for path in sorted((EXAMPLES / "demo").glob("*.mp4"))]
    demo_seconds, copy_seconds = [], []
    for _ in range(runs):
        with tempfile.TemporaryDirectory() as folder:
            demo_seconds.append(seconds([str(EXAMPLES / "demo.py"), "--out", folder]))
            copy_seconds.append(seconds(["-c", COPY, folder, *clips]))
    demo, copy = statistics.median(demo_seconds), statistics.median(copy_seconds)
    print(f"demo {demo:.1f} s, decode and encode {copy:.1f} s: {demo / copy:.1f} times")
    sys.exit(demo / copy > MAX_RATIO)


def seconds(arguments: Sequence[str]) -> float:
    """Wall time of a Python process."""
    start = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
