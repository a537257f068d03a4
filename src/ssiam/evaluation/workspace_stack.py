"""Stacks: the experiments that a workspace of the official VOT toolkit runs."""

from __future__ import annotations

import re
from pathlib import Path

from ssiam.errors import ArgumentError
from ssiam.evaluation.eao import Interval

# Ends of the EAO interval as shares of the shortest sequence: no fragment longer than the lower
# end gives nan, none as long as the upper end shortens the interval in silence.
_LOW, _HIGH = 2 / 9, 2 / 3

_OFFICIAL = re.compile(r"[a-z0-9]+(/[a-z0-9]+)?")

_SUPERVISED = """\
title: Supervised runs
experiments:
  baseline:
    type: supervised
    repetitions: 1
    skip_initialize: 5
    analyses:
      - type: supervised_average_ar
        sensitivity: 30
      - type: supervised_eao_score
        low: {low}
        high: {high}
      - type: supervised_eao_curve
"""


def is_official(stack: str) -> bool:
    """Whether `stack` names one of the toolkit's own ("vot2018/shortterm"), and is no file here."""
    return _OFFICIAL.fullmatch(stack) is not None and not Path(stack).is_file()


def read_stack(path: Path) -> str:
    """The text of a stack's file.

    Raises
    ------
    ArgumentError
        It cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise ArgumentError(
            f"stack {path} is not a file of YAML that can be read, nor a stack of the toolkit, "
            "such as vot2018/shortterm"
        ) from None


def supervised_stack(lengths: list[int]) -> str:
    """A stack of one supervised run over sequences of the given lengths, frames."""
    return _SUPERVISED.format(**interval_for(lengths)._asdict())


def interval_for(lengths: list[int]) -> Interval:
    """An EAO interval that fits sequences of the given lengths, frames."""
    shortest = min(lengths)
    return Interval(max(1, round(_LOW * shortest)), max(1, round(_HIGH * shortest)))
