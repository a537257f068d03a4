"""The tables that are only printed in the paper, and what would fill them."""

import pytest

from ssiam.evaluation.paper.cells import Table
from ssiam.evaluation.paper.missing import how_to_get, missing_result
from ssiam.evaluation.paper.printed import printed_tables
from ssiam.evaluation.paper.published import TABLE1, TABLE2, TABLE3, TABLE4
from ssiam.runtime import MODEL_ZOO

MEASURES = ("paper A", "paper R", "paper EAO", "paper fps")


@pytest.fixture(autouse=True)
def weights(tmp_path, monkeypatch):
    """A folder for weights of the paper's tracker, which are missing at first."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "weights" / MODEL_ZOO["siammask_e"].folder


def imported(folder):
    folder.mkdir(parents=True)
    (folder / "network.json").touch()


def rows(number):
    return Table(f"Table {number}: title", ("a",), [("x",)])


def test_titles_and_heads():
    found = printed_tables([], [])
    assert {each.title: each.head for each in found} == {
        "Table 1 as printed in the paper, other datasets": (
            *("dataset", "tracker", "stabilized", *MEASURES, "missing"),
        ),
        "Table 2 as printed in the paper, SiamMask_E on VOT2018": (
            *("keypoints", *MEASURES, "missing"),
        ),
        "Table 3 as printed in the paper, SiamMask_E on VOT2018": (
            *("threshold", "value", *MEASURES[:3], "missing"),
        ),
        "Table 4 as printed in the paper, SiamMask_E on VOT2018": (
            *("sequence", "paper Stabilization", "paper Original", "paper S-Siam", "missing"),
        ),
    }
    for table in found:
        assert {len(row) for row in table.rows} == {len(table.head)}


def test_rows_are_the_papers():
    first, second, third, fourth = printed_tables([], [])
    assert [row[:3] for row in first.rows] == [
        (f"VOT{e.year}", e.tracker, "paper" if e.tracker.startswith("S-") else "off")
        for e in TABLE1
    ]
    assert [float(cell) for cell in first.rows[0][3:6]] == list(TABLE1[0].measures[:3])
    assert [row[0] for row in second.rows] == list(TABLE2)
    assert [tuple(map(float, row[1:5])) for row in second.rows] == list(TABLE2.values())
    expected = [
        (name, f"{value:g}", *each[:3])
        for name, by_value in TABLE3.items()
        for value, each in by_value.items()
    ]
    assert [(*row[:2], *map(float, row[2:5])) for row in third.rows] == expected
    yes = {True: "Yes", False: "No"}
    assert [row[:4] for row in fourth.rows] == [
        (name, yes[each.stabilizes], str(each.original), str(each.stabilized))
        for name, each in TABLE4.items()
    ]


def test_data_and_weights_are_missing():
    first, *others = printed_tables([], [None, 2019])
    assert {row[0] for row in first.rows} == {"VOT2016", "VOT2018"}
    for row, theirs in zip(first.rows, [each for each in TABLE1 if each.year != 2019], strict=True):
        assert row[-1] == f"VOT{theirs.year}, weights of {theirs.label.rpartition('-')[0]}"
    for table in others:
        assert {row[-1] for row in table.rows} == {"VOT2018, weights of siammask_e"}


def test_with_data_and_weights_the_run_is_missing(weights):
    imported(weights)
    found = {each.title[6]: each for each in printed_tables([], [2018])}
    assert list(found) == ["1", "2", "3"]
    for number in ("2", "3"):
        assert {row[-1] for row in found[number].rows} == {f"run of --preset table{number}"}
    found = {each.title[6]: each for each in printed_tables([], [])}
    assert {row[-1] for row in found["4"].rows} == {"VOT2018, run of --preset table4"}
    missing = {row[1]: row[-1] for row in found["1"].rows if row[0] == "VOT2016"}
    assert missing["S-SiamMask_E"] == "VOT2016, run of --preset table1"


def test_tables_of_the_results_are_not_printed_again():
    def numbers(shown, years):
        return [each.title[6] for each in printed_tables(shown, years)]

    assert numbers([], [2016, 2018, 2019]) == ["2", "3"]
    assert numbers([rows(2)], [2016, 2018, 2019]) == ["3"]
    assert numbers([rows(3), rows(2)], [2016, 2018, 2019]) == []
    assert numbers([rows(3)], [2018]) == ["1", "2"]
    # A table without rows shows nothing.
    assert numbers([Table("Table 2: title", ("a",), [])], [2018]) == ["1", "2", "3"]


def test_what_a_label_needs(weights):
    assert missing_result("siammask_e-paper", "table2") == "weights of siammask_e"
    assert missing_result("kcf-off", "table1") == "run of --preset table1"
    imported(weights)
    assert missing_result("siammask_e-paper", "table2") == "run of --preset table2"


def test_each_missing_part_has_one_line_with_its_source():
    cells = ["VOT2018, weights of siamfc", "", "VOT2018, run of --preset table4"]
    data, siamfc, run = how_to_get(cells)
    assert data == (
        "VOT2018: download it from votchallenge.net, and run ssiam bench and ssiam tables on it, "
        "with an --out of its own: the years of VOT have sequences of the same names"
    )
    assert siamfc == "weights of siamfc: ssiam weights get siamfc"
    assert run == "run of --preset table4: ssiam bench DATASET --out RESULTS --preset table4"
