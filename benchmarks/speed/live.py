"""`ssiam live` over minutes: time from frame to box, memory, and what a slow client does to others.

    python benchmarks/speed/live.py [--minutes 5] [--tracker NAME] [--slow]

Serves a 640x360 clip at 30 frames a second from a process of its own, draws a target into it, and
watches as a browser would. With --slow a second client reads one step every two seconds. Needs
the folder of test data (see shared_data.py).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import psutil
from websockets.sync.client import ClientConnection, connect

from ssiam.video import VideoSink, open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import VIDEOS, WEIGHTS

SIZE = (640, 360)
RATE = 30
CLIP, BOX = "shaky-5.avi", (290, 95, 175, 165)  # the red sculpture, in its own pixels
LIMITS_MS = {50: 25, 99: 60}  # percentile of the time from frame to box
TIMED = 300.0  # seconds from the beginning in which the time to the box counts
MEMORY_EVERY = 5.0  # seconds
SETTLED = 0.1  # of the time, from which memory has to be flat


def write_clip(path: Path, count: int) -> tuple[float, ...]:
    """Write `count` frames, there and back again so that no cut is in them; the first box."""
    with open_source(VIDEOS / CLIP) as frames:
        width, height = frames.size_wh
        images = [cv2.resize(frame.image, SIZE) for frame in islice(frames, 60)]
    with VideoSink(path, Fraction(RATE)) as sink:
        for image in islice(cycle(images + images[-2:0:-1]), count):
            sink.write(image)
    return tuple(v * s for v, s in zip(BOX, (SIZE[0] / width, SIZE[1] / height) * 2, strict=True))


@contextmanager
def served(clip: Path, tracker: str | None) -> Iterator[tuple[str, psutil.Process]]:
    """The socket's address and the process of `ssiam live`."""
    command = [sys.executable, "-m", "ssiam", "live", str(clip), "--port", "0"]
    if tracker is not None:
        command += ["--tracker", tracker]
        if tracker.startswith("nano"):
            command += ["--weights", str(WEIGHTS / tracker.replace("_", ""))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        address = next(word for word in line.split() if word.startswith("http://"))
        try:
            yield address.replace("http://", "ws://") + "session", psutil.Process(process.pid)
        finally:
            process.terminate()


def steps(socket: ClientConnection, wait: float = 0.0) -> Iterator[dict[str, Any]]:
    """Headers of the steps, each told as shown after `wait` seconds."""
    for message in socket:
        if isinstance(message, bytes):
            length = int.from_bytes(message[:4], "big")
            header = json.loads(message[4 : 4 + length])
            time.sleep(wait)
            socket.send(json.dumps({"type": "shown", "number": header["number"]}))
            yield header


def dawdle(address: str) -> None:
    """Watch slowly, until the server ends."""
    with connect(address, max_size=None) as socket:
        for _ in steps(socket, wait=2.0):
            pass


def watch(
    address: str, process: psutil.Process, box: tuple[float, ...], seconds: float
) -> tuple[list[dict[str, Any]], list[float], list[float]]:
    """Headers, when they came (seconds), and memory (MB) every few seconds."""
    headers, came, memory = [], [], []
    with connect(address, max_size=None) as socket:
        follow = steps(socket)
        first = next(follow)
        drawn = {"type": "add", "box": box, "number": first["number"]}
        socket.send(json.dumps(drawn))
        begun = time.monotonic()
        for header in follow:
            now = time.monotonic() - begun
            if now > seconds:
                break
            headers.append(header)
            came.append(now)
            if now >= MEMORY_EVERY * len(memory):
                memory.append(process.memory_info().rss / 2**20)
    return headers, came, memory


def report(headers: list[dict[str, Any]], came: list[float], memory: list[float]) -> None:
    """Print what came of it."""
    timed = [header for header, at in zip(headers, came, strict=True) if at <= TIMED]
    followed = [header for header in timed if header["targets"]]
    latency = 1e3 * np.array([header["latency"] for header in followed])
    told = [f"p{p} {np.percentile(latency, p):.1f} (limit {most})" for p, most in LIMITS_MS.items()]
    print(f"frame to box, ms: {', '.join(told)}, greatest {latency.max():.1f}")
    lost = sum(header["targets"][0]["lost"] for header in followed)
    print(
        f"{len(headers)} steps in {came[-1]:.0f} s ({len(headers) / came[-1]:.1f} a second), "
        f"{headers[-1]['dropped']} frames dropped, {headers[-1]['skipped']} steps not sent, "
        f"target lost in {lost}"
    )
    gaps = 1e3 * np.diff(came)
    print(
        f"between steps, ms: p50 {np.percentile(gaps, 50):.1f}, p99 {np.percentile(gaps, 99):.1f}"
    )
    settled = np.array(memory[int(SETTLED * len(memory)) :])
    middle = (settled.max() + settled.min()) / 2
    print(
        f"memory {settled.min():.1f} to {settled.max():.1f} MB, "
        f"+-{100 * (settled.max() - middle) / middle:.1f} % (limit 5)"
    )


def main() -> None:
    """Serve, watch, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--tracker")
    parser.add_argument("--slow", action="store_true", help="with a second, slow client")
    arguments = parser.parse_args()
    seconds = 60 * arguments.minutes
    with tempfile.TemporaryDirectory() as folder:
        clip = Path(folder) / "clip.mp4"
        box = write_clip(clip, round(RATE * (seconds + 5)))
        with served(clip, arguments.tracker) as (address, process):
            if arguments.slow:
                threading.Thread(target=dawdle, args=(address,), daemon=True).start()
            report(*watch(address, process, box, seconds))


if __name__ == "__main__":
    main()
