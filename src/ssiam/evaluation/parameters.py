"""`Parameter`: a number of `StabilizerConfig` that is searched, and the values tried."""

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
# Between two values that are tried: pixels; of everything else that is no whole number, _FINE.
_STEPS: Final = {"thx1": 1.0, "thy1": 1.0, "thx2": 1.0, "thy2": 1.0}
_FINE: Final = 0.01
_DECIMALS: Final = 6  # hide what steps of .01 leave behind
# Table 3 ties these: the threshold of y is half of that of x.
_TIED: Final = {"thx1": "thy1", "thx2": "thy2"}

# The thresholds of Table 3, somewhat further than it goes.
TABLE_3: Final = ("thx1=20:120", "thx2=5:100", "tha=0.05:1")


@dataclass(frozen=True)
class Parameter:
    """A field of `StabilizerConfig`: a range of numbers, or words to choose from.

    Attributes
    ----------
    name : str
    low, high : float
        Both are tried; `high` is a whole number of steps from `low`. 0 if there are `choices`.
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
        """``thx1=20:120``, or ``keypoints=orb,direct``; `ArgumentError` if it is neither."""
        name, _, values = text.partition("=")
        check_choice("parameter", name, _FIELDS)
        if isinstance(_DEFAULTS[name], str):
            choices = tuple(word.strip() for word in values.split(","))
            for word in choices:
                _checked(name, word)
            return cls(name, choices=choices)
        return _range(name, values, text)

    def holds(self, value: Any) -> bool:
        """Whether a value is among those tried, or between them."""
        return value in self.choices if self.choices else self.low <= value <= self.high

    def __str__(self) -> str:
        values = ",".join(self.choices) or f"{self.low:g}:{self.high:g}"
        return f"{self.name}={values}"


def is_whole(name: str) -> bool:
    """Whether a field of `StabilizerConfig` holds whole numbers."""
    return isinstance(_DEFAULTS[name], int)


def configured(values: Mapping[str, Any]) -> StabilizerConfig:
    """The paper's numbers with some replaced.

    As in Table 3, THy1 and THy2 are half of THx1 and THx2, where only the latter are among them.
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
    """What the paper has for the parameters; None if it is outside of what is tried."""
    values = {each.name: _DEFAULTS[each.name] for each in parameters}
    return values if all(each.holds(values[each.name]) for each in parameters) else None


def track_flags(config: StabilizerConfig) -> str:
    """A config as options of ``ssiam track``; the paper's numbers are left out."""
    changed = config.changed_options().items()
    flags = (f"--{name.replace('_', '-')} {value}" for name, value in changed if name in _FIELDS)
    return " ".join([f"--stabilize {config.stabilize}", *flags])


def _range(name: str, values: str, text: str) -> Parameter:
    whole = is_whole(name)
    try:
        low, high = (float(word) for word in values.split(":"))
    except ValueError:
        raise ArgumentError(
            f"{text!r} is no parameter: give low:high, such as thx1=20:120"
        ) from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ArgumentError(f"{text!r}: the first number must be below the second")
    if whole and not (low.is_integer() and high.is_integer()):
        raise ArgumentError(f"{text!r}: {name} is a whole number")
    _checked(name, int(low) if whole else low)
    step = 1.0 if whole else _STEPS.get(name, _FINE)
    steps = math.floor((high - low) / step + 1e-9)
    if steps == 0:
        raise ArgumentError(f"{text!r}: {name} is tried in steps of {step:g}; give a wider range")
    return Parameter(name, low, round(low + steps * step, _DECIMALS), step)


def _checked(name: str, value: Any) -> None:
    """`ArgumentError` if a config refuses the value."""
    StabilizerConfig("paper").with_options(**{name: value})
