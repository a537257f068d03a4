"""`ssiam tables`: the paper's tables and figures from the results of `ssiam bench`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter

from ssiam.cli.options import check_results_folder, split_words
from ssiam.datasets import Dataset, open_dataset
from ssiam.errors import ArgumentError
from ssiam.evaluation.paper.canvas import check_matplotlib
from ssiam.evaluation.paper.cells import Table
from ssiam.evaluation.paper.figures import Figure
from ssiam.evaluation.paper.figures import figures as drawn_figures
from ssiam.evaluation.paper.judged import judge_sequences
from ssiam.evaluation.paper.missing import how_to_get
from ssiam.evaluation.paper.page import PAGE, Section, markdown_table, write_page
from ssiam.evaluation.paper.printed import printed_tables
from ssiam.evaluation.paper.summary import Summaries, summarize
from ssiam.evaluation.paper.tables import (
    other_sources,
    table1,
    table2,
    table3,
    table4,
    table4_sequences,
)
from ssiam.evaluation.runs.result_files import ResultsError
from ssiam.evaluation.runs.shaken_results import shaken_as
from ssiam.video.images import image_paths

_EXPLANATION: Final = (
    "A: mean overlap while tracked, without ten frames after each start. R: lost targets per "
    "100 frames. EAO: expected average overlap, on a year of VOT only. All three as computed by "
    "pysot-toolkit. fps: frames per second without reading the images; the published ones are of "
    "other machines. paper, their: the published number; diff: ours minus it. lost: lost targets, "
    "with a restart five frames after each. overlap: mean intersection over union of the tracked "
    "frames, averaged over sequences. success: area under the success curve of one-pass runs. "
    "stabilized: off is the tracker alone. missing: what the row needs. Another empty cell means "
    "that the number is not available."
)


def tables(
    results: Path,
    /,
    *,
    dataset: Annotated[list[Path], Parameter(negative=())],
    out: Path | None = None,
    figures: bool = True,
    judge: bool = True,
    sequences: str | None = None,
) -> None:
    """Make tables 1 to 4 and the figures of the paper from results of ssiam bench.

    Prints the tables, and writes tables.md, tables.html (a self-contained page) and the figures.
    Tables are made from the results that exist; missing ones are listed.

    Parameters
    ----------
    results
        Folder of the results: --out of ssiam bench, or one of the shake-... folders in it.
    dataset
        The dataset of the results, a folder or pysot's .json file. Repeat for further datasets.
        A, R and EAO are reported for VOT's datasets, lost targets and overlaps for others.
    out
        Folder to write to; by default RESULTS/tables.
    figures
        Draw the figures. This needs matplotlib, and most figures need the dataset's images.
    judge
        Decide for each sequence in Table 4 whether its camera shakes (the column Stabilization).
        This reads all images of these sequences.
    sequences
        Comma-separated sequences of figures 1 and 6; figures 3 to 5 are of the first one. By
        default the paper's soccer2, wiper, helicopter and blanket, or those that stabilization
        changes most. Table 4 lists them too, also those in which no target was lost.
    """
    folder = out or results / "tables"
    check_results_folder(folder, dataset)
    if figures:
        check_matplotlib()
    opened = [shaken_as(results, open_dataset(path)) for path in dataset]
    _check_not_frames(folder, dataset)
    names = _known_names(opened, split_words(sequences or ""))
    found = [summarize(results, each) for each in opened]
    if not any(each.entries for each in found):
        searched = ", ".join(each.dataset for each in found)
        raise ResultsError(
            f"{results}: holds no results of {searched}; give the dataset of the results"
        )
    sections = [_section(each, names, figures, judge) for each in found]
    shown = [table for each in sections for table in each.tables]
    paper = printed_tables(shown, {each.year for each in found if each.entries})
    if paper:
        sections.append(Section("Other results of the paper", paper))
    if lines := how_to_get(_missing_cells([*shown, *paper])):
        sections.append(Section("What the empty rows need", [], notes=lines))
    _print(sections, write_page(folder, sections, _EXPLANATION))


def _check_not_frames(folder: Path, datasets: Sequence[Path]) -> None:
    """Refuse a folder of dataset frames, where the figures would be read as frames."""
    inside = any(folder.resolve().is_relative_to(path.resolve()) for path in datasets)
    if inside and folder.is_dir() and not (folder / PAGE).exists() and image_paths(folder):
        raise ArgumentError(f"--out {folder} holds frames of the dataset; give another folder")


def _known_names(opened: Sequence[Dataset], names: Sequence[str]) -> list[str]:
    """The names as the datasets spell them; `UnknownSequenceError` for one that none has."""
    holders = [
        next((each for each in opened if name in each.sequences), opened[0]) for name in names
    ]
    return [holder.sequences[name].name for holder, name in zip(holders, names, strict=True)]


def _section(found: Summaries, names: Sequence[str], figures: bool, judge: bool) -> Section:
    title = f"Dataset {found.dataset}"
    if not found.entries:
        return Section(title, [], notes=[f"{found.dataset}: no results", *found.notes])
    drawn: list[Figure] = []
    notes = list(found.notes)
    if figures:
        drawn, undrawn = drawn_figures(found, names)
        notes += undrawn
    judged: dict[str, bool] = {}
    if judge:
        listed = table4_sequences(found, names)
        judged, unjudged = judge_sequences(found.sequences[name] for name in listed)
        notes += unjudged
    made = [table(found) for table in (table1, other_sources, table2, table3)]
    made.append(table4(found, names, judged))
    notes += [
        f"{each.title}: no results" for each in made if not each.rows and "Table" in each.title
    ]
    return Section(title, [each for each in made if each.rows], drawn, notes)


def _missing_cells(shown: Sequence[Table]) -> list[str]:
    return [row[-1] for table in shown if table.head[-1] == "missing" for row in table.rows]


def _print(sections: list[Section], paths: list[Path]) -> None:
    for section in sections:
        for table in section.tables:
            print(markdown_table(table), end="\n\n")
        for note in section.notes:
            print(f"ssiam: {note}", file=sys.stderr)
    for path in paths:
        print(path)
