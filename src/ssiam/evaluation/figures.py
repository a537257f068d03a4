"""Figures 3, 4 and 6 of the paper, as far as the results and frames for them are there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ssiam.errors import MissingExtraError, one_line
from ssiam.evaluation.canvas import NothingToDrawError
from ssiam.evaluation.differing import most_differing
from ssiam.evaluation.frames_figure import figure4
from ssiam.evaluation.path_figure import figure3
from ssiam.evaluation.ranking_figure import figure6
from ssiam.evaluation.summaries import Summaries
from ssiam.stabilize import StabilizerConfig

_RUNS: Final = {  # by whether they are one-pass ones
    True: "One pass, no restarts.",
    False: "Restarted five frames after each loss; until then there is no box.",
}


@dataclass(frozen=True)
class Figure:
    """A picture for the page of tables.

    Attributes
    ----------
    name : str
        Of its file, without suffix.
    title, caption : str
    png : bytes
    """

    name: str
    title: str
    caption: str
    png: bytes


def figures(found: Summaries) -> tuple[list[Figure], list[str]]:
    """Figures 3, 4 and 6, and a line for each that cannot be drawn.

    Figures 3 and 4 show the sequence on which steadying changes most.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    drawn: list[Figure] = []
    notes: list[str] = []
    for number, draw in ((3, _figure3), (4, _figure4), (6, _figure6)):
        try:
            drawn.append(draw(found))
        except MissingExtraError:
            raise
        except Exception as error:
            notes.append(f"{found.dataset}: no figure {number}: {one_line(error)}")
    return drawn, notes


def _figure3(found: Summaries) -> Figure:
    differing = most_differing(found)
    sequence = next(iter(found.sequences.values())) if differing is None else differing.sequence
    return Figure(
        f"fig3-{found.dataset}",
        f"Fig. 3: the camera's path in {sequence.name}",
        "Summed from frame to frame at the image centre, and the mean of the last 30 frames. "
        "Grey: frames whose motion could not be told.",
        figure3(sequence, StabilizerConfig("paper")),
    )


def _figure4(found: Summaries) -> Figure:
    differing = most_differing(found)
    if differing is None or not differing.frames:
        raise NothingToDrawError("no sequence is tracked both off and paper, with different boxes")
    return Figure(
        f"fig4-{found.dataset}",
        f"Fig. 4: {differing.tracker} on {differing.sequence.name}, alone and steadied",
        "The frames in which the overlaps with the truth differ most, on the sequence where they "
        f"differ most. {_RUNS[differing.one_pass]}",
        figure4(differing),
    )


def _figure6(found: Summaries) -> Figure:
    plot = "success" if found.year is None else "accuracy and robustness"
    return Figure(
        f"fig6-{found.dataset}",
        f"Fig. 6: {plot} on {found.dataset}",
        "Dashed or hollow: the tracker alone. Solid or full: steadied.",
        figure6(found),
    )
