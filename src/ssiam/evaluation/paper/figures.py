"""`figures`: those of the paper (1, 3, 4, 5, 6), and the boxes, ranking and EAO of the results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from ssiam.errors import MissingExtraError, one_line
from ssiam.evaluation.paper.camera_figures import (
    draw_correction,
    draw_path,
    draw_transformed,
    most_moved,
    record_camera,
)
from ssiam.evaluation.paper.canvas import NothingToDrawError
from ssiam.evaluation.paper.qualitative import draw_boxes, largest_difference
from ssiam.evaluation.paper.rankings import draw_eao_curve, draw_ranking
from ssiam.evaluation.paper.strips import draw_strips, examples, failures, results
from ssiam.evaluation.paper.summary import Summaries
from ssiam.stabilize import StabilizerConfig

_RUN_NOTES: Final = {  # by `Example.one_pass`
    True: "One pass, no restarts.",
    False: "Restarted five frames after each loss; no box in between.",
}
_CAMERA: Final = StabilizerConfig("paper")


@dataclass(frozen=True)
class Figure:
    """A figure of the page that `write_page` makes.

    Attributes
    ----------
    name : str
        File name without suffix.
    title, caption : str
    png : bytes
    """

    name: str
    title: str
    caption: str
    png: bytes


def figures(found: Summaries, names: Sequence[str] = ()) -> tuple[list[Figure], list[str]]:
    """Draw Fig. 1 and 3 to 6 of the paper, the boxes, the ranking and the curve of EAO.

    Parameters
    ----------
    found : Summaries
    names : sequence of str
        Sequences of Fig. 1 and 6, the first of which is that of Fig. 3 to 5. By default the
        paper's, or those that stabilization changes most.

    Returns
    -------
    figures : list of Figure
    notes : list of str
        A line for each figure that cannot be drawn.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    drawn: list[Figure] = []
    notes: list[str] = []
    for what, draw in _DRAWN.items():
        try:
            drawn.extend(draw(found, names))
        except MissingExtraError:
            raise
        except Exception as error:
            notes.append(f"{found.dataset}: no {what}: {one_line(error)}")
    return drawn, notes


def _figure1(found: Summaries, names: Sequence[str]) -> Iterator[Figure]:
    strips = failures(examples(found, names), limit=not names)
    example = strips[0].example
    yield Figure(
        f"fig1-{found.dataset}",
        f"Fig. 1: where {example.tracker} alone loses its target",
        "Yellow: the tracker alone. Green: the truth; the dashed line is at the same height in "
        "each frame, so that the background shows the shake. The paper's masks are not in result "
        f"files. {_RUN_NOTES[example.one_pass]}",
        draw_strips(strips, stabilized=False),
    )


def _camera_figures(found: Summaries, names: Sequence[str]) -> Iterator[Figure]:
    """Fig. 3, 4 and 5, of one sequence."""
    try:
        sequence = examples(found, names)[0].sequence
    except NothingToDrawError:
        known = [each for each in names or found.sequences if each in found.sequences]
        if not known:
            raise
        sequence = found.sequences[known[0]]
    record = record_camera(sequence, _CAMERA)
    window, border = _CAMERA.paper.window, _CAMERA.border
    yield Figure(
        f"fig3-{found.dataset}",
        f"Fig. 3: the camera's path in {sequence.name}",
        f"Motion at the image center, summed over the frames, and its mean over the last {window} "
        "frames. Gray: frames with unreliable motion.",
        draw_path(record),
    )
    yield Figure(
        f"fig4-{found.dataset}",
        f"Fig. 4: the correction of each frame of {sequence.name}",
        "dx, dy and da of new_trans (eq. 5), before the limits of eq. 6: from the camera's path to "
        "the smoothed one.",
        draw_correction(record),
    )
    height, width = next(sequence.images()).shape[:2]
    index = most_moved(record, (width, height))
    yield Figure(
        f"fig5-{found.dataset}",
        f"Fig. 5: frame {index} of {sequence.name}, original and transformed",
        f"The frame that is moved farthest. {border} pixels are added on each side (N of eq. 6).",
        draw_transformed(sequence, record, index, border),
    )


def _figure6(found: Summaries, names: Sequence[str]) -> Iterator[Figure]:
    strips = results(examples(found, names), limit=not names)
    example = strips[0].example
    yield Figure(
        f"fig6-{found.dataset}",
        f"Fig. 6: {example.tracker} alone and stabilized",
        "Yellow: the tracker alone. Blue: stabilized. Green: the truth. The first frame, then "
        f"those in which the stabilized box is better by the most. {_RUN_NOTES[example.one_pass]}",
        draw_strips(strips, stabilized=True),
    )


def _boxes(found: Summaries, names: Sequence[str]) -> Iterator[Figure]:
    example = largest_difference(found)
    if example is None or not example.frames:
        raise NothingToDrawError("no sequence has both off and paper results with different boxes")
    yield Figure(
        f"boxes-{found.dataset}",
        f"Boxes: {example.tracker} on {example.sequence.name}, alone and stabilized",
        "The frames with the largest difference of overlap, for better or worse, on the sequence "
        f"with the largest difference. {_RUN_NOTES[example.one_pass]}",
        draw_boxes(example),
    )


def _ranking(found: Summaries, names: Sequence[str]) -> Iterator[Figure]:
    plot = "success" if found.year is None else "accuracy and robustness"
    yield Figure(
        f"ranking-{found.dataset}",
        f"Ranking: {plot} on {found.dataset}",
        "Dashed or hollow: the tracker alone. Solid or filled: stabilized.",
        draw_ranking(found),
    )


def _eao(found: Summaries, names: Sequence[str]) -> Iterator[Figure]:
    of_year = (
        "no interval is defined for this dataset, so that it has no EAO"
        if found.year is None
        else f"the mean over the gray interval of VOT{found.year} is EAO (in the legend)"
    )
    yield Figure(
        f"eao-{found.dataset}",
        f"Expected average overlap on {found.dataset}",
        "Mean overlap that is expected in a video of so many frames, with 0 after a loss; "
        f"{of_year}. Dashed: the tracker alone.",
        draw_eao_curve(found),
    )


_DRAWN: Final[dict[str, Callable[[Summaries, Sequence[str]], Iterator[Figure]]]] = {
    "figure 1": _figure1,
    "figures 3 to 5": _camera_figures,
    "figure 6": _figure6,
    "figure of boxes": _boxes,
    "ranking": _ranking,
    "curve of EAO": _eao,
}
