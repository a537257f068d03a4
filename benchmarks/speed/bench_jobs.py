"""What a second process buys: `ssiam bench` with one job, two, and a Dask cluster of two workers.

    python benchmarks/speed/bench_jobs.py [--tracker csrt]

The same runs (a tracker, off and paper, over the first frames of the real sequences) three times,
on one thread each; wall time, start of the processes included, and its ratio to one job. Also the
peak memory of the largest process with three sequences, and with the same ones five times. Needs
the folder of test data (see shared_data.py).
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
from benchmarks.common.data import WEIGHTS, sequences

LONGEST = 100  # frames of a sequence


def shortened(folder: Path, count: int | None = None, copies: int = 1) -> Path:
    """The first sequences in OTB's layout, at most `LONGEST` frames of each."""
    chosen = islice(sequences().items(), count)
    for (name, sequence), copy in product(chosen, range(copies)):
        name = f"{name}_{copy}"
        images = folder / name / "img"
        images.mkdir(parents=True)
        lines = []
        for index, path in enumerate(sequence.frames[:LONGEST]):
            shutil.copyfile(path, images / f"{index + 1:04d}{path.suffix}")
            x, y, w, h = sequence.box(index)
            lines.append(f"{x + 1},{y + 1},{w},{h}\n")
        (folder / name / "groundtruth_rect.txt").write_text("".join(lines))
    return folder


def measured(dataset: Path, tracker: str, *options: str) -> tuple[float, float]:
    """Seconds of a benchmark, and the peak of its largest process, MiB."""
    command = [sys.executable, "-m", "ssiam", "bench", str(dataset), "--trackers", tracker]
    command += ["--stabilize", "off,paper", *options]
    if tracker.startswith("nanotrack"):
        command += ["--weights", f"{tracker}={WEIGHTS / tracker.replace('_', '')}"]
    with tempfile.TemporaryDirectory() as out:
        start = time.perf_counter()
        process = subprocess.Popen([*command, "--out", out], stdout=subprocess.DEVNULL)
        peak = watch(process)
        seconds = time.perf_counter() - start
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return seconds, peak


def watch(process: subprocess.Popen[bytes]) -> float:
    """Peak resident memory of a process's largest child or itself, MiB, until it ends."""
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
    """Address of a scheduler with two workers, each a process of one thread."""
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
        all_of_them = shortened(folder / "all")
        few, many = (shortened(folder / f"{n}", 3, copies=n) for n in (1, 5))
        address = cluster(stack)
        one, _ = measured(all_of_them, tracker, "--jobs", "1")
        two, _ = measured(all_of_them, tracker, "--jobs", "2")
        clustered, _ = measured(all_of_them, tracker, "--cluster", address)
        peaks = [measured(each, "kcf", "--jobs", "1")[1] for each in (few, many)]
    print("| run | seconds | times one job |\n|---|---|---|")
    for name, seconds in (("1 job", one), ("2 jobs", two), ("Dask, 2 workers", clustered)):
        print(f"| {name} | {seconds:.1f} | {one / seconds:.2f} |")
    print(f"\npeak memory: {peaks[0]:.0f} MiB with 3 sequences, {peaks[1]:.0f} MiB with 15")


if __name__ == "__main__":
    main()
