"""What a training run is told of its validation."""

from __future__ import annotations

from dataclasses import dataclass

from ssiam.errors import ArgumentError

__all__ = ["HeldOut", "ValidationSettings", "require"]


@dataclass(frozen=True)
class HeldOut:
    """A dataset to be tracked for validation.

    Attributes
    ----------
    path : str
        As `ssiam.datasets.open_dataset` takes it.
    kind, split : str, optional
        Likewise.
    only : tuple of str
        Patterns of sequences that are taken; empty: all.
    name : str
        In the metrics; datasets that share it are measured together.
    """

    path: str
    kind: str | None = None
    split: str | None = None
    only: tuple[str, ...] = ()
    name: str = ""


@dataclass(frozen=True)
class ValidationSettings:
    """Tracking held-out sequences now and then.

    Attributes
    ----------
    held_out : tuple of HeldOut
    every : int
        Steps between two validations; there is one at the end too.
    frames : int
        Of each sequence, at most.
    """

    held_out: tuple[HeldOut, ...] = ()
    every: int = 5000
    frames: int = 150

    def __post_init__(self) -> None:
        require(self.every >= 1, "every", self.every, "1 or more")


def require(holds: bool, name: str, value: float, wanted: str) -> None:
    """Refuse a setting that does not hold, with an `ArgumentError` that says what to give."""
    if not holds:
        raise ArgumentError(f"{name} {value} of a training run: give {wanted}")
