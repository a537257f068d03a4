"""Time of the camera motion: the compiled kernel, its twin in NumPy, and another checkout.

    python benchmarks/speed/motion.py [--source VIDEO] [--sizes 640x360,1280x720,3840x2160]
        [--against CHECKOUT] [--frames N] [--rounds N]

One thread, process time. Each estimator runs in a process of its own and processes blocks of
frames in turn with the others, so that all of them see the same load of the machine. Figures are
medians over the blocks of ratios to the first estimator, and milliseconds of the median frame.
`--against` names a folder with another version of the project (`git worktree add ../before
COMMIT`). The last column is the time of a size relative to that of 1280x720. Needs the folder of
test data (see benchmarks/common/data.py) unless --source is given.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WARM_UP = 5  # frames of each block that do not count
REFERENCE = "1280x720"


def serve(source: str, size: str, count: int) -> None:
    """Process the frames once for each line of standard input, and print milliseconds a frame."""
    import cv2
    import numpy as np

    from ssiam import CameraMotion
    from ssiam.video import open_source

    cv2.setNumThreads(1)
    width, height = map(int, size.split("x"))
    with open_source(source) as opened:
        raw = [frame.image for frame in islice(opened, count)]
    frames = [np.asarray(cv2.resize(image, (width, height)), np.uint8) for image in raw]
    box = (0.45 * width, 0.27 * height, 0.27 * width, 0.46 * height)
    print("ready", flush=True)
    for _ in sys.stdin:
        camera, times = CameraMotion(), []
        for frame in frames:
            start = time.process_time()
            camera.update(frame, box)
            times.append(time.process_time() - start)
        print(1e3 * float(np.median(times[WARM_UP:])), flush=True)


class Estimator:
    """A process that serves one version."""

    def __init__(self, package: Path, kernel: str, source: str, size: str, count: int) -> None:
        environment = os.environ | {
            "PYTHONPATH": str(package),
            "SSIAM_KERNEL": kernel,
            "OPENBLAS_NUM_THREADS": "1",
        }
        command = [sys.executable, __file__, "--serve", source, size, str(count)]
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._line()

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def milliseconds(self) -> float:
        """Process the block once."""
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return float(self._line())

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    shared = Path(os.environ.get("SSIAM_SHARED", ROOT.parent / "shared"))
    parser.add_argument("--source", default=str(shared / "data" / "videos" / "shaky-5.avi"))
    parser.add_argument("--sizes", default="640x360,1280x720,3840x2160", help="WxH, with commas")
    parser.add_argument("--against", type=Path, help="a checkout of another version")
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--serve", nargs=3, help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = parsed_arguments()
    if chosen.serve:
        source, size, count = chosen.serve
        serve(source, size, int(count))
        return
    from statistics import median

    kinds = {"NumPy": (ROOT / "src", "numpy"), "compiled": (ROOT / "src", "")}
    if chosen.against:
        kinds = {"before": (chosen.against / "src", "")} | kinds
    print(
        f"| size | estimator | ms | of {next(iter(kinds))} | of {REFERENCE} |\n" + "|---" * 5 + "|"
    )
    reference: dict[str, float] = {}
    for size in sorted(chosen.sizes.split(","), key=lambda size: size != REFERENCE):
        servers = {
            name: Estimator(package, kernel, chosen.source, size, chosen.frames)
            for name, (package, kernel) in kinds.items()
        }
        for server in servers.values():
            server.milliseconds()
        rounds = [
            {name: server.milliseconds() for name, server in servers.items()}
            for _ in range(chosen.rounds)
        ]
        first = next(iter(kinds))
        for name, server in servers.items():
            server.close()
            time_ms = median(each[name] for each in rounds)
            ratio = median(each[name] / each[first] for each in rounds)
            reference.setdefault(name, time_ms)
            print(
                f"| {size} | {name} | {time_ms:.2f} | {ratio:.2f} "
                f"| {time_ms / reference[name]:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
