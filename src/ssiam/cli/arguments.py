"""What several commands read from their arguments in the same way."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from ssiam.datasets import SHAKE_KINDS, Shake, ShakeBorder
from ssiam.errors import ArgumentError, check_choice
from ssiam.outputs import check_distinct


def words(text: str) -> list[str]:
    """The words between commas."""
    return [word.strip() for word in text.split(",") if word.strip()]


def check_results_folder(out: Path, datasets: Iterable[Path], weights: Iterable[Path] = ()) -> None:
    """Refuse a folder of results that is a dataset or weights; `ArgumentError` names it."""
    inputs = [("the dataset", path) for path in datasets]
    check_distinct([("--out", out)], [*inputs, *(("the weights", path) for path in weights)])


def report_left_parts(parts: Iterable[Path]) -> None:
    """Print the parts of outputs that unfinished runs left, on standard error."""
    for part in parts:
        print(
            f"ssiam: {part} was left by a run that was killed or is still running; it is kept",
            file=sys.stderr,
        )


def levels(text: str | None) -> tuple[float, float] | None:
    """The two values of ``--levels LOW,HIGH``; `ArgumentError` if they are none."""
    if text is None:
        return None
    try:
        low, high = (float(number) for number in text.split(","))
    except ValueError:
        raise ArgumentError(
            f"--levels {text!r}: give the values to be shown as black and white, such as 7000,8500"
        ) from None
    return low, high


def weights_by_tracker(pairs: Iterable[str]) -> dict[str, Path]:
    """Paths by the tracker's name, of ``NAME=PATH``; `ArgumentError` if one is not of that form."""
    paths = {}
    for pair in pairs:
        name, _, path = pair.partition("=")
        if not (name and path):
            raise ArgumentError(
                f"--weights {pair!r}: give the tracker and its path, such as "
                "nanotrack_v3=weights/nanotrackv3"
            )
        paths[name] = Path(path)
    return paths


def shakes(
    strengths: str, kinds: str, seeds: int, exposure: float, readout: float, border: ShakeBorder
) -> list[Shake | None]:
    """Every strength with every kind and seed, each once; None for a strength of 0.

    Raises
    ------
    ArgumentError
        A strength is no number, or nothing is given, or a value is out of its range, or it is
        told how to shake and not how much.
    """
    if seeds < 1:
        raise ArgumentError(f"--shake-seeds {seeds}: must be at least 1")
    chosen = [check_choice("kind of shake", word, SHAKE_KINDS) for word in words(kinds)]
    found = [
        Shake(strength, kind, seed, exposure, readout, border)
        for strength in _strengths(strengths)
        for kind in chosen
        for seed in range(seeds)
    ]
    if not found:
        raise ArgumentError(f"--shake {strengths!r} --shake-kind {kinds!r}: give one at least")
    if found[0] != Shake(0.0) and not any(shake.strength for shake in found):
        raise ArgumentError(
            "--shake-kind and the like tell how to shake, not how much: give --shake too, "
            "such as --shake 0,0.03"
        )
    return list(dict.fromkeys(shake if shake.strength else None for shake in found))


def _strengths(text: str) -> list[float]:
    try:
        return [float(word) for word in words(text)]
    except ValueError:
        raise ArgumentError(
            f"--shake {text!r}: give shares of the width between commas, such as 0,0.01,0.03"
        ) from None
