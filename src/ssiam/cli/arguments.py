"""What several commands read from their arguments in the same way."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ssiam.errors import ArgumentError


def words(text: str) -> list[str]:
    """The words between commas."""
    return [word.strip() for word in text.split(",") if word.strip()]


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
