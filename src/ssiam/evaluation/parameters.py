"""`Parameter`: a field of `StabilizerConfig` that ``ssiam tune`` searches, and its range."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from ssiam.errors import ArgumentError, check_choice
from ssiam.stabilize import StabilizerConfig

_PAPER: Final = StabilizerConfig("paper")
_DEFAULTS: Final = _PAPER.options()
_FIELDS: Final = tuple(name for name, value in _DEFAULTS.items() if not isinstance(value, bool))
# Step between two values, pixels; all other fields that are not integers have _FINE_STEP.
_STEPS: Final = {"thx1": 1.0, "thy1": 1.0, "thx2": 1.0, "thy2": 1.0}
_FINE_STEP: Final = 0.01
_DECIMALS: Final = 6  # removes rounding errors of steps of .01
# Tied in Table 3 of the paper: the threshold of y is half the threshold of x.
_TIED: Final = {"thx1": "thy1", "thx2": "thy2"}

# The thresholds of Table 3, over a somewhat wider range.
TABLE_3: Final = ("thx1=20:120", "thx2=5:100", "tha=0.05:1")


@dataclass(frozen=True)
class Parameter:
    """A field of `StabilizerConfig` to search: a range of numbers, or a list of words.

    Attributes
    ----------
    name : str
    low, high : float
        Ends of the range, both included; `high` is a whole number of steps from `low`. 0 if there
        are `choices`.
    step : float
    choices : tuple of str
        Empty for a range.
    """

    name: str
    low: float = 0.0
    high: float = 0.0
    step: float = 1.0
    choices: tuple[str, ...] = ()

    @classmethod
    def parse(cls, text: str) -> Parameter:
        """Parse ``thx1=20:120`` or ``keypoints=orb,direct``; `ArgumentError` for anything else."""
        name, _, values = text.partition("=")
        check_choice("parameter", name, _FIELDS)
        if isinstance(_DEFAULTS[name], str):
            choices = tuple(word.strip() for word in values.split(","))
            for word in choices:
                _check(name, word)
            return cls(name, choices=choices)
        return _range(name, values, text)

    def holds(self, value: Any) -> bool:
        """Whether a value is one of the choices, or within the range."""
        return value in self.choices if self.choices else self.low <= value <= self.high

    def __str__(self) -> str:
        values = ",".join(self.choices) or f"{self.low:g}:{self.high:g}"
        return f"{self.name}={values}"


def is_whole(name: str) -> bool:
    """Whether a field of `StabilizerConfig` is an integer."""
    return isinstance(_DEFAULTS[name], int)


def paper_config(values: Mapping[str, Any]) -> StabilizerConfig:
    """The paper's configuration with some values replaced.

    As in Table 3, THy1 and THy2 are half of THx1 and THx2 where only the latter are given.
    """
    numbers: dict[str, Any] = {
        name: round(value, _DECIMALS) if isinstance(value, float) else value
        for name, value in values.items()
    }
    for x, y in _TIED.items():
        if x in numbers and y not in numbers:
            numbers[y] = numbers[x] / 2
    return StabilizerConfig("paper").with_options(**numbers)


def paper_values(parameters: Iterable[Parameter]) -> dict[str, Any] | None:
    """The paper's values of the parameters; None if one of them is outside of its range."""
    values = {each.name: _DEFAULTS[each.name] for each in parameters}
    return values if all(each.holds(values[each.name]) for each in parameters) else None


def track_flags(config: StabilizerConfig) -> str:
    """A configuration as options of ``ssiam track``, without those at their defaults."""
    changed = config.changed_options().items()
    flags = (f"--{name.replace('_', '-')} {value}" for name, value in changed if name in _FIELDS)
    return " ".join([f"--stabilize {config.stabilize}", *flags])


def _range(name: str, values: str, text: str) -> Parameter:
    is_integer = is_whole(name)
    try:
        low, high = (float(word) for word in values.split(":"))
    except ValueError:
        raise ArgumentError(
            f"not a parameter range: {text!r}; give low:high, such as thx1=20:120"
        ) from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ArgumentError(f"{text!r}: the first number must be below the second")
    if is_integer and not (low.is_integer() and high.is_integer()):
        raise ArgumentError(f"{text!r}: {name} must be a whole number")
    _check(name, int(low) if is_integer else low)
    step = 1.0 if is_integer else _STEPS.get(name, _FINE_STEP)
    steps = math.floor((high - low) / step + 1e-9)
    if steps == 0:
        raise ArgumentError(
            f"{text!r}: {name} is searched in steps of {step:g}; give a wider range"
        )
    return Parameter(name, low, round(low + steps * step, _DECIMALS), step)


def _check(name: str, value: Any) -> None:
    """Raise `ArgumentError` if `StabilizerConfig` refuses the value."""
    StabilizerConfig("paper").with_options(**{name: value})
