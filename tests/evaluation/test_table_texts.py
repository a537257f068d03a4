"""Titles, heads, notes and missing rows of the tables, from given summaries."""

import pytest

from ssiam.evaluation.measures.eao import Scores
from ssiam.evaluation.paper.cells import TABLE3_COLUMNS, compared_head
from ssiam.evaluation.paper.presets import GENERATORS, THRESHOLDS
from ssiam.evaluation.paper.published import OTHER_ROWS, TABLE1, TABLE2, TABLE4
from ssiam.evaluation.paper.summary import Summaries, Summary, parse_label, parse_variant
from ssiam.evaluation.paper.tables import (
    other_sources,
    table1,
    table2,
    table3,
    table4,
    table4_sequences,
)

NAN = float("nan")


class Given(Summary):
    """A summary with given lost targets and overlaps."""

    def __init__(self, label, lost=None, scores=None, fps=50.0):
        tracker, config = parse_label(label) or (label, None)
        variant = parse_variant(label)
        tracker = f"{tracker} ({variant})" if variant else tracker
        supervised = dict.fromkeys(lost or {})
        super().__init__(label, tracker, config, supervised, {}, fps, scores, None)
        self.__dict__["lost"] = dict(lost or {})
        self.__dict__["overlaps"] = dict.fromkeys(lost or {}, 0.5)


def summaries(*entries, dataset="VOT2018", year=2018, names=("girl", "road", "bag")):
    return Summaries(dataset, year, dict.fromkeys(names), list(entries), [])


def scores(accuracy=0.5, lost=2):
    return Scores(accuracy, 0.25, 0.375, lost, 300)


@pytest.fixture(autouse=True)
def nothing_imported(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


def test_titles_name_the_table_and_the_dataset():
    found = summaries(Given("kcf-off", {"girl": 1.0}), dataset="VOT-2018 mine")
    titles = [each.title for each in (table1(found), table2(found), table3(found), table4(found))]
    assert titles == [
        "Table 1: trackers alone and stabilized, VOT-2018 mine",
        "Table 2: keypoint generators, VOT-2018 mine",
        "Table 3: thresholds, VOT-2018 mine",
        "Table 4: lost targets, VOT-2018 mine",
    ]
    assert other_sources(found).title == "Other published results, VOT-2018 mine"


def test_table_1_without_a_year_of_vot_has_no_numbers_of_the_paper():
    entry = Given("kcf-paper", {"girl": 1.0, "road": 2.0}, scores())
    mine = Given("mine", {"girl": 0.0}, scores(0.25), NAN)
    table = table1(summaries(entry, mine, dataset="clips", year=None))
    head = ("tracker", "stabilized", "A", "R", "EAO", "fps", "lost", "overlap", "success")
    assert table.head == head
    assert table.rows == [
        ("kcf", "paper", "0.500", "0.250", "0.375", "50", "3", "0.500", ""),
        ("mine", "", "0.250", "0.250", "0.375", "", "0", "0.500", ""),
    ]
    assert table.notes == []


def test_table_1_of_a_year_has_the_paper_beside_the_same_tracker():
    found = summaries(
        Given("siamfc-off", {"girl": 1.0}, scores()),
        Given("siamfc-paper-window=9", {"girl": 1.0}, scores()),
        Given("kcf-off", {"girl": 1.0}, scores()),
    )
    table = table1(found)
    assert table.head == (
        *("tracker", "stabilized", *compared_head(), "lost", "overlap", "success", "missing"),
    )
    first, kcf, *others = table.rows
    paper = {each.label: each for each in TABLE1 if each.year == 2018}
    theirs = paper["siamfc-off"].measures
    assert first[:5] == ("siamfc", "off", "0.500", f"{theirs[0]:.3f}", f"{0.5 - theirs[0]:+.3f}")
    assert first[-4:] == ("1", "0.500", "", "")
    assert kcf[:5] == ("kcf", "off", "0.500", "", "")
    assert [row[0] for row in others] == [
        each.tracker for label, each in paper.items() if label != "siamfc-off"
    ]
    for row, each in zip(
        others, [e for e in paper.values() if e.label != "siamfc-off"], strict=True
    ):
        assert row[1] == ("paper" if each.tracker.startswith("S-") else "off")
        assert row[-4:] == ("", "", "", f"weights of {each.label.rpartition('-')[0]}")
        assert row[2] == row[4] == ""
        assert row[3] == f"{each.measures[0]:.3f}"


def test_differences_of_lost_targets_are_noted():
    off = Given("kcf-off", {"girl": 3.0, "road": 1.0, "bag": 9.0})
    found = summaries(
        off,
        Given("kcf-paper", {"girl": 1.0, "road": 1.0}),
        Given("kcf-predict", {}),
        Given("csrt-paper", {"girl": 1.0}),
    )
    (note,) = table1(found).notes
    assert note == (
        "kcf-paper against off, lost targets over 2 sequences: -2 "
        "(95 % of the resampled sequences: -4 .. +0)"
    )


def test_relatives_of_the_papers_trackers_are_noted():
    found = summaries(
        Given("siammask_vot-off", {"girl": 1.0}, scores()),
        Given("siammask_e-off-threads=2", {"girl": 1.0}, scores()),
        Given("kcf-off", {"girl": 1.0}, scores()),
    )
    notes = table1(found).notes
    assert notes == [
        "siammask_vot is set beside the paper's SiamMask_E: the differences contain those of "
        "weights, backbone or boxes."
    ]


def test_other_sources_are_those_of_the_year():
    table = other_sources(summaries(Given("siammask_e-off", {"girl": 1.0}, scores())))
    assert table.head == (*("tracker", "source"), *compared_head("their"), "their lost")
    rows = [each for each in OTHER_ROWS if each.year == 2018]
    assert [row[:2] for row in table.rows] == [(each.tracker, each.source) for each in rows]
    for row, each in zip(table.rows, rows, strict=True):
        assert row[2] == ("0.500" if each.label == "siammask_e-off" else "")
        assert row[-1] == ("" if each.lost is None else f"{each.lost:g}")
    assert other_sources(summaries(year=None)).rows == []


def labels(configs):
    return [f"kcf-{each.stabilize}" for each in configs]


def test_table_2_has_a_row_for_each_generator():
    found = summaries(
        Given("kcf-off", {"girl": 1.0}, scores()),
        Given("kcf-paper-keypoints=gftt", {"girl": 2.0}, scores()),
        Given("csrt-paper", {"girl": 2.0}, scores()),
    )
    table = table2(found)
    assert table.head == (
        *("tracker", "keypoints", *compared_head(), "lost", "overlap", "success", "missing"),
    )
    assert [row[:2] for row in table.rows] == [("kcf", "off"), *(("kcf", n) for n in GENERATORS)]
    measured = {row[1]: row for row in table.rows}
    assert measured["off"][2:5] == ("0.500", "", "")
    assert measured["gftt"][3] == f"{TABLE2['gftt'][0]:.3f}"
    assert measured["gftt"][-4:] == ("2", "0.500", "", "")
    assert measured["orb"][-4:] == ("", "", "", "run of --preset table2")
    (note,) = table.notes
    assert note == (
        "The paper's numbers are of SiamMask_E on VOT2018, ours of kcf on VOT2018: the "
        "differences contain those of tracker and dataset."
    )


def test_several_trackers_are_listed_in_the_note():
    found = summaries(
        *(Given(f"{name}-paper-keypoints=gftt", {"girl": 2.0}) for name in ("csrt", "kcf", "mil"))
    )
    (note,) = table2(found).notes
    assert "ours of csrt, kcf, mil on VOT2018" in note


def test_table_3_has_a_row_for_each_value():
    found = summaries(Given("kcf-paper-tha=0.5", {"girl": 2.0}, scores()))
    table = table3(found)
    measures = compared_head(columns=TABLE3_COLUMNS)
    assert table.head == (
        *("tracker", "threshold", "value", *measures, "lost", "overlap", "success", "missing"),
    )
    assert [row[1:3] for row in table.rows] == [
        (name, f"{value:g}") for name, row in THRESHOLDS.items() for value in row
    ]
    measured = [row for row in table.rows if not row[-1]]
    assert [row[:4] for row in measured] == [("kcf", "THa, rad", "0.5", "0.500")]
    assert {row[-1] for row in table.rows} == {"", "run of --preset table3"}
    assert len(table.notes) == 1


def test_the_papers_tracker_has_tables_2_and_3_of_its_defaults():
    found = summaries(Given("siammask_e-paper", {"girl": 2.0}, scores()))
    for table in (table2(found), table3(found)):
        assert {row[0] for row in table.rows} == {"siammask_e"}
        assert table.notes == []
        missing = {row[-1] for row in table.rows}
        assert missing == {"", "weights of siammask_e"}
    kcf = summaries(Given("kcf-paper", {"girl": 2.0}, scores()))
    assert table2(kcf).rows == table3(kcf).rows == []
    elsewhere = summaries(
        Given("siammask_e-paper", {"girl": 2.0}, scores()), dataset="VOT2019", year=2019
    )
    (note,) = table2(elsewhere).notes
    assert note.endswith(
        "ours of siammask_e on VOT2019: the differences contain those of tracker and dataset."
    )


def test_table_4_lists_sequences_with_losses_or_names():
    found = summaries(
        Given("kcf-off", {"girl": 1.0, "road": 0.0, "bag": 0.0}),
        Given("kcf-paper", {"girl": 0.0, "road": 0.0}),
        Given("kcf-paper-window=9", {"girl": 0.0, "road": 7.0}),
        year=None,
    )
    assert table4_sequences(found) == ["girl"]
    assert table4_sequences(found, ["bag", "none"]) == ["girl", "bag"]
    table = table4(found, ["bag"], {"girl": True, "bag": False})
    assert table.head == ("sequence", "Stabilization", "kcf-off", "kcf-paper")
    assert table.rows == [
        ("girl", "Yes", "1", "0"),
        ("bag", "No", "0", ""),
        ("all sequences", "", "1", "0"),
    ]
    assert table.notes == [
        "Left out because no run lost its target there: 1 of 3 sequences.",
        "Stabilization: whether the threshold judge finds shake in more than half of the frames.",
    ]
    assert [row[1] for row in table4(found).rows] == ["", ""]


def test_table_4_without_supervised_runs_is_empty():
    found = summaries(Given("kcf-off"), year=None)
    assert table4_sequences(found, ["girl"]) == []
    table = table4(found, ["girl"])
    assert (table.rows, table.head) == ([], ("sequence", "Stabilization"))


def test_table_4_of_2018_has_the_papers_sequences():
    found = summaries(Given("siammask_e-off", {"girl": 1.0, "road": 2.0}))
    table = table4(found)
    listed = ["girl", "road", *(name for name in TABLE4 if name != "girl")]
    assert [row[0] for row in table.rows] == [*listed, "all sequences"]
    girl, road, *others, total = table.rows
    lost = TABLE4["girl"]
    assert girl[2:] == (
        *("1", "Yes" if lost.stabilizes else "No", str(lost.original), str(lost.stabilized)),
        *(f"{1 - lost.original:+g}", "", "weights of siammask_e"),
    )
    assert road[2:] == ("2", *[""] * 6)
    assert {row[-1] for row in others} == {"VOT2018"}
    assert total == ("all sequences", "", "3", *[""] * 6)
    assert table.notes[0].endswith("1 of 3 sequences.")
    assert table.notes[2:] == ["The paper's columns and the differences are of SiamMask_E."]


def test_results_of_both_methods_complete_a_row_of_table_4():
    found = summaries(
        Given("siammask_e-off", {"girl": 1.0}), Given("siammask_e-paper", {"girl": 2.0})
    )
    girl = table4(found).rows[0]
    assert girl[-1] == ""
    assert girl[-2] == f"{2 - TABLE4['girl'].stabilized:+g}"
