"""`ssiam trax`: a tracker as a TraX server, for the official VOT toolkit."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from ssiam.cli.choice import STEADYING, TrackerChoice
from ssiam.evaluation.vot.trax import check_trax, reserve_stdout, serve
from ssiam.stabilize import StabilizerConfig

_CHOICE = TrackerChoice()
_STEADY = StabilizerConfig()


def trax(
    *,
    choice: TrackerChoice = _CHOICE,
    config: Annotated[StabilizerConfig, Parameter(name="*", group=STEADYING)] = _STEADY,
) -> None:
    """Serve a tracker to a TraX client, such as the official VOT toolkit.

    It talks over standard input and output, and is started by the client, not by hand:
    `ssiam vot-workspace` writes what the toolkit needs for that.
    """
    check_trax()
    with reserve_stdout():
        serve(choice.load(config))
