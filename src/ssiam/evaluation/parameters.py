"""`Parameter`: a field of `StabilizerConfig` that ``ssiam tune`` searches, and its range."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Literal, TypeAlias

from ssiam.errors import ArgumentError, check_choice
from ssiam.stabilize import PaperConfig, PredictConfig, StabilizerConfig

SearchedMethod: TypeAlias = Literal["predict", "paper", "literal"]

_DEFAULTS: Final = StabilizerConfig().options()
_FIELDS: Final = tuple(_DEFAULTS)
_SWITCHES: Final = {"true": True, "false": False}
# Settings that one method alone reads; `border` is read by all.
_OF_PREDICT: Final = {each.name for each in fields(PredictConfig)}
_OF_PAPER: Final = {each.name for each in fields(PaperConfig)} - {"border"}
# Step between two values, pixels; all other fields that are not integers have _FINE_STEP.
_STEPS: Final = {"thx1": 1.0, "thy1": 1.0, "thx2": 1.0, "thy2": 1.0}
_FINE_STEP: Final = 0.01
_DECIMALS: Final = 6  # removes rounding errors of steps of .01
# Tied in Table 3 of the paper: the threshold of y is half the threshold of x.
_TIED: Final = {"thx1": "thy1", "thx2": "thy2"}

# The thresholds of Table 3, over a somewhat wider range.
TABLE_3: Final = ("thx1=20:120", "thx2=5:100", "tha=0.05:1")
# By default searched for each method.
SEARCH_SPACES: Final[dict[SearchedMethod, tuple[str, ...]]] = {
    "predict": ("memory=0:0.95", "smoothing=0:0.95", "margin=0:0.5"),
    "paper": TABLE_3,
    "literal": TABLE_3,
}


@dataclass(frozen=True)
class Parameter:
    """A setting of `StabilizerConfig` to search: a range of numbers, or a list of words.

    Attributes
    ----------
    name : str
    low, high : float
        Ends of the range, both included; `high` is a whole number of steps from `low`. 0 if there
        are `choices`.
    step : float
    choices : tuple of str
        Empty for a range; "true" and "false" for a setting that is on or off.
    """

    name: str
    low: float = 0.0
    high: float = 0.0
    step: float = 1.0
    choices: tuple[str, ...] = ()

    @classmethod
    def parse(cls, text: str) -> Parameter:
        """Parse a range or a list of words.

        Parameters
        ----------
        text : str
            ``thx1=20:120``, ``keypoints=orb,direct`` or ``turn=true,false``.

        Raises
        ------
        ArgumentError
            The text is of another form, or `StabilizerConfig` refuses a value.
        """
        name, _, values = text.partition("=")
        check_choice("parameter", name, _FIELDS)
        if isinstance(_DEFAULTS[name], (str, bool)):
            choices = tuple(word.strip() for word in values.split(","))
            for word in choices:
                if isinstance(_DEFAULTS[name], bool):
                    check_choice(name, word, tuple(_SWITCHES))
                else:
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
    """Whether a setting of `StabilizerConfig` is an integer."""
    return isinstance(_DEFAULTS[name], int)


def check_method(parameters: Iterable[Parameter], method: SearchedMethod) -> None:
    """Raise `ArgumentError` if the method does not read one of the parameters."""
    foreign = _OF_PAPER if method == "predict" else _OF_PREDICT
    for each in parameters:
        if each.name in foreign:
            other = "paper" if method == "predict" else "predict"
            raise ArgumentError(
                f"{each}: is not a setting of {method}; give --stabilize {other} to search it"
            )


def searched_config(method: SearchedMethod, values: Mapping[str, Any]) -> StabilizerConfig:
    """The configuration of a method with some values replaced.

    As in Table 3, THy1 and THy2 are half of THx1 and THx2 where only the latter are given.
    """
    settings: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(_DEFAULTS[name], bool):
            value = _SWITCHES[value]
        settings[name] = round(value, _DECIMALS) if isinstance(value, float) else value
    for x, y in _TIED.items():
        if x in settings and y not in settings:
            settings[y] = settings[x] / 2
    return StabilizerConfig(method).with_options(**settings)


def default_values(
    method: SearchedMethod, parameters: Iterable[Parameter]
) -> dict[str, Any] | None:
    """The method's default values of the parameters; None if one is outside of its range.

    Those of "paper" are the paper's.
    """
    defaults = StabilizerConfig(method).options()
    values = {
        each.name: _word(defaults[each.name]) if each.choices else defaults[each.name]
        for each in parameters
    }
    return values if all(each.holds(values[each.name]) for each in parameters) else None


def _word(value: str | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else value


def track_flags(config: StabilizerConfig) -> str:
    """A configuration as options of ``ssiam track``, without those at their defaults."""
    return " ".join(
        [
            f"--stabilize {config.stabilize}",
            *(
                _flag(name.replace("_", "-"), value)
                for name, value in config.changed_options().items()
            ),
        ]
    )


def _flag(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return f"--{name}" if value else f"--no-{name}"
    return f"--{name} {value}"


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
    for end in (low, high):
        _check(name, int(end) if is_integer else end)
    step = 1.0 if is_integer else _STEPS.get(name, _FINE_STEP)
    steps = math.floor((high - low) / step + 1e-9)
    if steps == 0:
        raise ArgumentError(
            f"{text!r}: {name} is searched in steps of {step:g}; give a wider range"
        )
    return Parameter(name, low, round(low + steps * step, _DECIMALS), step)


def _check(name: str, value: Any) -> None:
    """Raise `ArgumentError` if `StabilizerConfig` refuses the value."""
    StabilizerConfig().with_options(**{name: value})
