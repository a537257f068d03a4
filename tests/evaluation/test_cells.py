"""Cells of the tables: formats, differences, and empty cells for missing numbers."""

from types import SimpleNamespace

import pytest

from ssiam.evaluation.measures.eao import Scores
from ssiam.evaluation.paper.cells import (
    TABLE3_COLUMNS,
    Table,
    compared,
    compared_head,
    count,
    measures_of,
    other_cells,
    paper_head,
    plain_cells,
    published_method,
    table4_cells,
    table4_head,
)
from ssiam.evaluation.paper.published import TABLE1, LostTargets, Measures

NAN = float("nan")
OURS, THEIRS = Measures(0.6124, 0.25, NAN, 61.4), Measures(0.6, 0.3006, 0.42, 58.0)


def summary(**values):
    return SimpleNamespace(**values)


def test_measures_are_those_of_the_scores():
    assert measures_of(None) is None
    scores = Scores(0.5, 0.25, 0.125, 3, 1000)
    assert measures_of(summary(scores=scores, fps=60.0)) == (0.5, 0.25, 0.125, 60.0)
    assert measures_of(summary(scores=None, fps=60.0)) == (None, None, None, 60.0)


def test_each_column_is_followed_by_the_published_one_and_the_difference():
    assert compared_head("their", ("A",)) == ("A", "their A", "diff A")
    assert compared_head() == (
        *("A", "paper A", "diff A", "R", "paper R", "diff R"),
        *("EAO", "paper EAO", "diff EAO", "fps", "paper fps", "diff fps"),
    )
    assert paper_head() == ("paper A", "paper R", "paper EAO", "paper fps")
    assert paper_head(TABLE3_COLUMNS) == ("paper A", "paper R", "paper EAO")


def test_differences_are_those_of_the_printed_numbers():
    assert compared(OURS, THEIRS) == (
        *("0.612", "0.600", "+0.012", "0.250", "0.301", "-0.051"),
        *("", "0.420", "", "61", "58", "+3"),
    )
    assert compared(Measures(0.5004), Measures(0.5), ("A",)) == ("0.500", "0.500", "+0.000")
    assert compared(OURS, None, ("A", "fps")) == ("0.612", "", "", "61", "", "")
    assert compared(None, THEIRS, ("fps",)) == ("", "58", "")


def test_plain_cells():
    assert plain_cells(OURS) == ("0.612", "0.250", "", "61")
    assert plain_cells(None) == ("",) * 4
    assert plain_cells(THEIRS, TABLE3_COLUMNS) == ("0.600", "0.301", "0.420")


PAPER = {"girl": LostTargets(False, 1, 2), "bag": LostTargets(True, 5, 3)}


def test_table_4_compares_the_papers_tracker():
    assert table4_head({}) == ()
    assert table4_head(PAPER) == (
        *("paper Stabilization", "paper Original", "paper S-Siam"),
        *("diff Original", "diff S-Siam", "missing"),
    )
    lost = {"siammask_e-off": {"bag": 4.0, "girl": 1.0}, "siammask_e-paper": {"bag": 4.5}}
    assert table4_cells("bag", PAPER, lost, "") == ("Yes", "5", "3", "-1", "+1.5", "")
    assert table4_cells("girl", PAPER, lost, "run") == ("No", "1", "2", "+0", "", "run")
    assert table4_cells("bag", PAPER, {}, "") == ("Yes", "5", "3", "", "", "")
    assert table4_cells("road", PAPER, lost, "run") == ("",) * 6
    assert table4_cells("bag", {}, lost, "run") == ()


def test_other_cells_are_lost_targets_overlap_and_success():
    assert other_cells(None) == ("", "", "")
    both = summary(
        supervised={"a": 1},
        one_pass={"a": 1},
        lost={"a": 2.0, "b": 1.5},
        overlaps={"a": 0.5, "b": NAN, "c": 0.25},
        success=SimpleNamespace(auc=0.4567),
    )
    assert other_cells(both) == ("3.5", "0.375", "0.457")
    assert other_cells(summary(**{**vars(both), "one_pass": {}})) == ("3.5", "0.375", "")
    alone = summary(**{**vars(both), "supervised": {}, "lost": {}, "overlaps": {"a": NAN}})
    assert other_cells(alone) == ("", "", "0.457")


@pytest.mark.parametrize(("value", "text"), [(None, ""), (3.0, "3"), (2.5, "2.5"), (0, "0")])
def test_counts(value, text):
    assert count(value) == text


def test_stabilized_rows_of_the_paper_begin_with_an_s():
    methods = {each.tracker: published_method(each) for each in TABLE1}
    assert methods["SiamFC"] == methods["SiamRPN++"] == "off"
    assert methods["S-SiamFC"] == methods["S-SiamRPN++"] == "paper"


def test_a_table_has_no_notes_by_default():
    first, second = (Table("title", ("a",), []) for _ in range(2))
    first.notes.append("note")
    assert second.notes == []
