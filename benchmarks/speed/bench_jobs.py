"""Speedup of `ssiam bench` with one job, two jobs, and a Dask cluster of two workers.

    python benchmarks/speed/bench_jobs.py [--tracker csrt]

The same runs (one tracker, off and paper, over the first frames of the real sequences) in three
ways, on one thread each: wall time with the start of the processes, and its ratio to one job. Also
the peak memory of the largest process with three sequences, and with five copies of them. Needs the
folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from itertools import islice, product
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import nanotrack_weights, sequences

MAX_FRAMES = 100  # of a sequence


def write_dataset(folder: Path, count: int | None = None, copies: int = 1) -> Path:
    """Copy the first `count` sequences into a dataset in OTB's layout, cut to `MAX_FRAMES`."""
    chosen = islice(sequences().items(), count)
    for (name, sequence), copy in product(chosen, range(copies)):
        name = f"{name}_{copy}"
        images = folder / name / "img"
        images.mkdir(parents=True)
        lines = []
        assert isinstance(sequence.frames, tuple)
        for index, path in enumerate(sequence.frames[:MAX_FRAMES]):
            shutil.copyfile(path, images / f"{index + 1:04d}{path.suffix}")
            x, y, w, h = sequence.box(index)
            lines.append(f"{x + 1},{y + 1},{w},{h}\n")
        (folder / name / "groundtruth_rect.txt").write_text("".join(lines))
    return folder


def measured(dataset: Path, tracker: str, *options: str) -> tuple[float, float]:
    """Wall time of a benchmark in seconds, and peak memory of its largest process in MiB."""
    command = [sys.executable, "-m", "ssiam", "bench", str(dataset), "--trackers", tracker]
    command += ["--stabilize", "off,paper", *options]
    if tracker.startswith("nanotrack"):
        command += ["--weights", f"{tracker}={nanotrack_weights(tracker)}"]
    with tempfile.TemporaryDirectory() as out:
        start = time.perf_counter()
        process = subprocess.Popen([*command, "--out", out], stdout=subprocess.DEVNULL)
        peak = peak_memory(process)
        seconds = time.perf_counter() - start
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return seconds, peak


def peak_memory(process: subprocess.Popen[bytes]) -> float:
    """Peak resident memory in MiB of the largest among a process and its children."""
    peak, root = 0, psutil.Process(process.pid)
    while process.poll() is None:
        for each in (root, *root.children(recursive=True)):
            try:
                peak = max(peak, each.memory_info().rss)
            except psutil.NoSuchProcess:
                continue
        time.sleep(0.1)
    return peak / 2**20


def cluster(stack: ExitStack) -> str:
    """Start a Dask scheduler with two workers of one thread each; returns its address."""
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    scheduler = subprocess.Popen(
        [*command, "--port", "0", "--no-dashboard"], stderr=subprocess.PIPE, text=True
    )
    stack.callback(scheduler.kill)
    assert scheduler.stderr is not None
    address = next(line.split()[-1] for line in scheduler.stderr if "Scheduler at" in line)
    threading.Thread(target=scheduler.stderr.read, daemon=True).start()
    for _ in range(2):
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", address]
        worker += ["--nthreads", "1", "--no-dashboard", "--no-nanny"]
        process = subprocess.Popen(worker, stderr=subprocess.DEVNULL)
        stack.callback(process.kill)
    return address


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracker", default="csrt")
    tracker = parser.parse_args().tracker
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        dataset = write_dataset(folder / "all")
        few, many = (write_dataset(folder / f"{n}", 3, copies=n) for n in (1, 5))
        address = cluster(stack)
        one, _ = measured(dataset, tracker, "--jobs", "1")
        two, _ = measured(dataset, tracker, "--jobs", "2")
        clustered, _ = measured(dataset, tracker, "--cluster", address)
        peaks = [measured(each, "kcf", "--jobs", "1")[1] for each in (few, many)]
    print("| run | seconds | times one job |\n|---|---|---|")
    for name, seconds in (("1 job", one), ("2 jobs", two), ("Dask, 2 workers", clustered)):
        print(f"| {name} | {seconds:.1f} | {one / seconds:.2f} |")
    print(f"\npeak memory: {peaks[0]:.0f} MiB with 3 sequences, {peaks[1]:.0f} MiB with 15")


if __name__ == "__main__":
    main()
