"""Damages valid inputs of every reader and socket for some minutes, and reports what breaks.

    python scripts/fuzz.py [MINUTES] [SEED]

Prints the number of inputs by reader; each exception that is not a `SsiamError` once, with a file
that holds the input (build/fuzz/); inputs over two seconds of process time; and the growth of the
memory after the first pass over all readers. The exit code is 1 if there was any of these. An input
that takes minutes ends the process; it is in build/fuzz/current, and the stack in build/fuzz/stack.
"""

from __future__ import annotations

import collections
import faulthandler
import logging
import os
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from random import Random
from typing import TextIO

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "src")]

from fuzz.mutations import mutated  # noqa: E402
from fuzz.target import Target, failure  # noqa: E402
from fuzz.targets import all_targets  # noqa: E402

_MAX_SECONDS = 2.0  # of process time for one input
_MAX_GROWTH = 300.0  # MB
_WARM_UP = 2000  # inputs, after which the memory is compared
_CHECK_EVERY = 500  # inputs
_HANG = 300.0  # s of `_CHECK_EVERY` inputs; they take a few seconds


def main(minutes: float = 10.0, seed: int = 0) -> int:
    """Fuzz; return the exit code."""
    warnings.simplefilter("ignore")
    logging.disable()
    # The libraries that decode images warn of every damage.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    found = ROOT / "build" / "fuzz"
    found.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        targets = all_targets(Path(name))
        try:
            with (found / "stack").open("w") as stack:
                return _run(targets, minutes, seed, found, stack)
        finally:
            faulthandler.cancel_dump_traceback_later()
            for target in targets:
                target.close()


def _run(targets: list[Target], minutes: float, seed: int, found: Path, stack: TextIO) -> int:
    random, counts = Random(seed), collections.Counter[str]()
    faults: set[tuple[str, str]] = set()
    shares = [target.share for target in targets]
    start, base, peak, total = time.monotonic(), 0.0, 0.0, 0
    while time.monotonic() - start < 60 * minutes:
        if total % _CHECK_EVERY == 0:
            faulthandler.dump_traceback_later(_HANG, file=stack, exit=True)
        (target,) = random.choices(targets, shares)
        data = mutated(random, random.choice(target.seeds))
        (found / "current").write_bytes(data)  # survives a crash of the process
        before = time.process_time()
        error = failure(target, data)
        seconds = time.process_time() - before
        counts[target.name] += 1
        total += 1
        if error is not None:
            _report(target, f"{type(error).__name__}", _place(error), data, faults, found, error)
        if seconds > _MAX_SECONDS:
            _report(target, f"{seconds:.1f} s", "slow", data, faults, found)
        if total % _CHECK_EVERY == 0:
            memory = _memory()
            base = memory if total <= _WARM_UP else base
            if memory - base > max(peak, _MAX_GROWTH):
                _report(target, f"{memory - base:.0f} MB more", "memory", data, faults, found)
            peak = max(peak, memory - base)
    for each, count in sorted(counts.items()):
        print(f"{count:8d}  {each}")
    print(f"{total} inputs, {len(faults)} faults, memory grew by {peak:.0f} MB")
    return bool(faults)


def _report(
    target: Target,
    what: str,
    place: str,
    data: bytes,
    faults: set[tuple[str, str]],
    found: Path,
    error: Exception | None = None,
) -> None:
    key = (target.name, f"{type(error).__name__} {place}")
    if key in faults:
        return
    faults.add(key)
    file = found / f"{target.name}--{len(faults)}"
    file.write_bytes(data)
    print(f"{target.name}: {what} at {place}: {str(error)[:150]!r}; {file}", flush=True)


def _place(error: Exception) -> str:
    frames = [
        each for each in traceback.extract_tb(error.__traceback__) if "ssiam" in each.filename
    ]
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"


def _memory() -> float:
    """Resident memory, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    sys.exit(main(*[kind(word) for kind, word in zip((float, int), sys.argv[1:], strict=False)]))
