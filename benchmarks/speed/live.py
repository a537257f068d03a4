"""`ssiam live` over minutes: latency from frame to box, memory, and the effect of a slow client.

    python benchmarks/speed/live.py [--minutes 5] [--tracker NAME] [--slow]

Serves a 640x360 clip at 30 frames per second from a separate process, adds a target, and receives
steps as a browser does. With --slow a second client reads one step every two seconds. Needs the
folder of test data (see benchmarks/common/data.py).
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
from benchmarks.common.data import VIDEOS, nanotrack_weights

SIZE = (640, 360)
RATE = 30
CLIP, BOX = "shaky-5.avi", (290, 95, 175, 165)  # the red sculpture, pixels of the clip
LATENCY_GOALS = {50: 25, 99: 60}  # percentile -> ms from frame to box
TIMED = 300.0  # seconds from the start in which latency counts
MEMORY_INTERVAL = 5.0  # seconds
SETTLED = 0.1  # share of the time after which memory has to be constant


def write_clip(path: Path, count: int) -> tuple[float, ...]:
    """Write `count` frames, forward and backward so that there is no cut; returns the first box."""
    with open_source(VIDEOS / CLIP) as frames:
        width, height = frames.size_wh
        images = [
            np.asarray(cv2.resize(frame.image, SIZE), np.uint8) for frame in islice(frames, 60)
        ]
    with VideoSink(path, Fraction(RATE)) as sink:
        for image in islice(cycle(images + images[-2:0:-1]), count):
            sink.write(image)
    return tuple(v * s for v, s in zip(BOX, (SIZE[0] / width, SIZE[1] / height) * 2, strict=True))


@contextmanager
def served(clip: Path, tracker: str | None) -> Iterator[tuple[str, psutil.Process]]:
    """Run `ssiam live`; yields the address of its socket, and its process."""
    command = [sys.executable, "-m", "ssiam", "live", str(clip), "--port", "0"]
    if tracker is not None:
        command += ["--tracker", tracker]
        if tracker.startswith("nano"):
            command += ["--weights", str(nanotrack_weights(tracker))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        address = next(word for word in line.split() if word.startswith("http://"))
        try:
            socket = address.replace("http://", "ws://").replace("#", "session?")
            yield socket, psutil.Process(process.pid)
        finally:
            process.terminate()


def steps(socket: ClientConnection, wait: float = 0.0) -> Iterator[dict[str, Any]]:
    """Headers of the steps, each acknowledged after `wait` seconds."""
    for message in socket:
        if isinstance(message, bytes):
            length = int.from_bytes(message[:4], "big")
            header = json.loads(message[4 : 4 + length])
            time.sleep(wait)
            socket.send(json.dumps({"type": "shown", "number": header["number"]}))
            yield header


def read_slowly(address: str) -> None:
    """Read a step every two seconds, until the server ends."""
    with connect(address, max_size=None) as socket:
        for _ in steps(socket, wait=2.0):
            pass


def watch(
    address: str, process: psutil.Process, box: tuple[float, ...], seconds: float
) -> tuple[list[dict[str, Any]], list[float], list[float]]:
    """Headers, their arrival times (seconds), and memory (MB) every few seconds."""
    headers: list[dict[str, Any]] = []
    arrivals: list[float] = []
    memory: list[float] = []
    with connect(address, max_size=None) as socket:
        received = steps(socket)
        first = next(received)
        command = {"type": "add", "box": box, "number": first["number"]}
        socket.send(json.dumps(command))
        start = time.monotonic()
        for header in received:
            now = time.monotonic() - start
            if now > seconds:
                break
            headers.append(header)
            arrivals.append(now)
            if now >= MEMORY_INTERVAL * len(memory):
                memory.append(process.memory_info().rss / 2**20)
    return headers, arrivals, memory


def report(headers: list[dict[str, Any]], arrivals: list[float], memory: list[float]) -> None:
    """Print latency, throughput and memory."""
    timed = [header for header, at in zip(headers, arrivals, strict=True) if at <= TIMED]
    with_target = [header for header in timed if header["targets"]]
    latency = 1e3 * np.array([header["latency"] for header in with_target])
    cells = [
        f"p{p} {np.percentile(latency, p):.1f} (goal {goal})" for p, goal in LATENCY_GOALS.items()
    ]
    print(f"frame to box, ms: {', '.join(cells)}, maximum {latency.max():.1f}")
    lost = sum(header["targets"][0]["lost"] for header in with_target)
    print(
        f"{len(headers)} steps in {arrivals[-1]:.0f} s "
        f"({len(headers) / arrivals[-1]:.1f} per second), "
        f"{headers[-1]['dropped']} frames dropped, {headers[-1]['skipped']} steps not sent, "
        f"target lost in {lost}"
    )
    gaps = 1e3 * np.diff(arrivals)
    print(
        f"between steps, ms: p50 {np.percentile(gaps, 50):.1f}, p99 {np.percentile(gaps, 99):.1f}"
    )
    settled = np.array(memory[int(SETTLED * len(memory)) :])
    middle = (settled.max() + settled.min()) / 2
    print(
        f"memory {settled.min():.1f} to {settled.max():.1f} MB, "
        f"+-{100 * (settled.max() - middle) / middle:.1f} % (goal 5)"
    )


def main() -> None:
    """Serve, receive, and print the report."""
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
                threading.Thread(target=read_slowly, args=(address,), daemon=True).start()
            report(*watch(address, process, box, seconds))


if __name__ == "__main__":
    main()
