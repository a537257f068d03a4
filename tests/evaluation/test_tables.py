"""Tables: cells against the measures, and notes on missing results."""

import re

import numpy as np
import pytest

from helpers.benched import bench, write_run, write_vot_year
from helpers.shaky_dataset import write_dataset
from ssiam.datasets import open_dataset
from ssiam.evaluation.measures.eao import INTERVALS, known_year
from ssiam.evaluation.measures.success import success
from ssiam.evaluation.paper.published import ORIGINAL_LOST, ROWS
from ssiam.evaluation.paper.summary import summarize
from ssiam.evaluation.paper.tables import published_table, table1, table2, table3, table4
from ssiam.evaluation.reports import report
from ssiam.evaluation.runs.entries import Entry
from ssiam.evaluation.runs.result_files import (
    ResultsError,
    otb_path,
    read_boxes,
    read_results,
    read_vot,
    vot_path,
)
from ssiam.stabilize import StabilizerConfig

OFF, PAPER = (Entry("kcf", StabilizerConfig(method)) for method in ("off", "paper"))
WIDE = Entry("kcf", StabilizerConfig("paper").with_options(thx1=80.0, thy1=40.0))
GFTT = Entry("kcf", StabilizerConfig("paper", keypoints="gftt"))


@pytest.fixture(scope="module")
def benched(tmp_path_factory):
    """A dataset, its results folder, and the `TaskResult` of each supervised run."""
    data = write_dataset(tmp_path_factory.mktemp("tiny"))
    out = tmp_path_factory.mktemp("out")
    entries = [OFF, PAPER, WIDE, GFTT]
    bench(data, out, entries)
    bench(data, out, [OFF, PAPER], "ope")
    return data, out, bench(data, out, entries)


@pytest.fixture(scope="module")
def found(benched):
    data, out, _ = benched
    return summarize(out, open_dataset(data))


def row_of(table, *start):
    (row,) = [row for row in table.rows if row[: len(start)] == start]
    return dict(zip(table.head, row, strict=True))


@pytest.mark.parametrize("entry", [OFF, PAPER], ids=["off", "paper"])
def test_cells_are_the_measures(benched, found, entry):
    data, out, results = benched
    cells = row_of(table1(found), "kcf", entry.config.stabilize)
    runs = [each for each in results if each.label == entry.label]
    assert cells["lost"] == str(sum(each.lost for each in runs))
    assert cells["overlap"] == f"{np.mean([each.overlap for each in runs]):.3f}"
    curves = [
        success(read_boxes(otb_path(out / entry.label / "ope", name)).regions, sequence.truth).auc
        for name, sequence in open_dataset(data).sequences.items()
    ]
    assert cells["success"] == f"{np.mean(curves):.3f}"
    times = (out / entry.label / "times" / "baseline").glob("*.txt")
    seconds = np.concatenate([np.loadtxt(path) for path in times])
    assert cells["fps"] == f"{(seconds > 0).sum() / seconds.sum():.0f}"


def test_tables_2_and_3_list_runs_and_note_missing_ones(found):
    generators, thresholds = table2(found), table3(found)
    assert [row[1] for row in generators.rows] == ["off", "orb", "gftt"]
    assert "harris, brisk, mser, direct" in generators.notes[-1]
    assert [(row[1][:4], row[2]) for row in thresholds.rows] == [
        ("THx1", "60"),
        ("THx1", "80"),
        ("THx2", "20"),
        ("THa,", "0.3"),
    ]
    wide = row_of(thresholds, "kcf", "THx1 = 2 THy1, px", "80")
    assert wide["lost"] == f"{sum(found.find('kcf', WIDE.config).lost.values()):g}"
    assert wide["paper"] == ""


def test_table_4_counts_lost_targets_by_sequence(benched, found):
    _, out, _ = benched
    table = table4(found)
    assert table.head == ("sequence", "kcf-off", "kcf-paper")
    total = np.zeros(2, int)
    for name in found.sequences:
        lost = [len(read_vot(vot_path(out / e.label, name)).failures) for e in (OFF, PAPER)]
        total += lost
        if any(lost):
            assert tuple(row_of(table, name).values())[1:] == tuple(map(str, lost))
    assert table.rows[-1] == ("all sequences", *map(str, total))


def test_missing_protocols_are_noted(benched, found, tmp_path):
    data, _, _ = benched
    assert f"{data.name}: no one-pass runs of {GFTT.label}, {WIDE.label}" in found.notes[0]
    bench(data, tmp_path, [OFF], "ope")
    alone = summarize(tmp_path, open_dataset(data))
    assert [note.partition(" (")[0] for note in alone.notes] == [
        f"{data.name}: no supervised runs of kcf-off"
    ]
    cells = row_of(table1(alone), "kcf", "off")
    assert (cells["lost"], cells["overlap"]) == ("", "")
    assert cells["success"] == row_of(table1(found), "kcf", "off")["success"]
    assert table4(alone).rows == []


@pytest.fixture
def vot(tmp_path):
    """A VOT dataset, with results of a tracker of this package and of another program."""
    data = write_vot_year(tmp_path / "VOT2018", {"girl": 130, "road": 120})
    out = tmp_path / "results"
    for label, shift in (("nanotrack_v3-off", 6.0), ("nanotrack_v3-paper", 2.0), ("other", 0.0)):
        write_run(out, label, "girl", "i" + "." * 59 + "x----i" + "." * 64, shift)
        write_run(out, label, "road", "i" + "." * 119, shift)
    return data, out


def test_table_1_of_a_vot_year_has_measured_and_published_scores(vot):
    data, out = vot
    dataset = open_dataset(data)
    found = summarize(out, dataset)
    table = table1(found)
    for label, start in (("nanotrack_v3-paper", ("nanotrack_v3", "paper")), ("other", ("other",))):
        cells = row_of(table, *start)
        sized = [each.sequence for each in found.entries[0].supervised.values()]
        scores = report(read_results(out / label, sized), INTERVALS[2018]).pysot
        assert [cells[name] for name in ("A", "R /100", "EAO", "lost")] == [
            f"{scores.accuracy:.3f}",
            f"{scores.robustness:.3f}",
            f"{scores.eao:.3f}",
            "1",
        ]
    assert row_of(table, "nanotrack_v3", "off")["their EAO"] == "0.449"
    assert row_of(table, "nanotrack_v3", "paper")["source"] == ""
    published = row_of(table, "S-SiamMask_E")
    assert (published["their EAO"], published["their lost"], published["their fps"]) == (
        "0.449",
        "52",
        "33",
    )
    assert published["their A"] == published["A"] == published["lost"] == ""


def test_table_4_of_2018_has_the_papers_counts(vot):
    data, out = vot
    table = table4(summarize(out, open_dataset(data)))
    assert row_of(table, "girl")["paper: Original"] == str(ORIGINAL_LOST["girl"])
    assert "road" not in [row[0] for row in table.rows]


def test_published_lost_targets_agree_with_robustness():
    frames = {2016: 21455, 2018: 21356, 2019: 19935}
    both = [each for each in ROWS if None not in (each.robustness, each.lost)]
    assert len(both) > 10
    for each in both:
        assert each.robustness == pytest.approx(100 * each.lost / frames[each.year], abs=6e-4)


def test_the_published_table_has_the_given_years():
    assert {row[0] for row in published_table({2016, 2019}).rows} == {"VOT2016", "VOT2019"}
    assert published_table(set()).rows == []


@pytest.mark.parametrize(
    ("name", "year"),
    [("VOT2018", 2018), ("vot-2019", 2019), ("OTB100", None), ("VOT2020", None)],
)
def test_years(name, year):
    assert known_year(name) == year


def test_missing_and_damaged_results_are_noted_and_left_out(vot):
    data, out = vot
    vot_path(out / "nanotrack_v3-off", "road").unlink()
    vot_path(out / "nanotrack_v3-paper", "girl").write_text("1\n1,2,three\n")
    (out / "empty" / "baseline").mkdir(parents=True)
    (out / "unrelated").mkdir()
    found = summarize(out, open_dataset(data))
    notes = "\n".join(found.notes)
    assert "nanotrack_v3-off: no baseline results of 1 of 2 sequences: road" in notes
    assert re.search(r"girl_001.txt, line 2.*left out", notes)
    assert "no times of" in notes
    lost = {each.label: dict(each.lost) for each in found.entries}
    assert lost["nanotrack_v3-off"] == {"girl": 1}
    assert lost["nanotrack_v3-paper"] == {"road": 0}
    assert "empty" not in lost


def test_without_frame_size_only_lost_targets_are_counted(vot):
    data, out = vot
    (data / "road" / "00000001.jpg").write_bytes(b"")
    found = summarize(out, open_dataset(data))
    cells = row_of(table1(found), "nanotrack_v3", "off")
    assert (cells["A"], cells["EAO"], cells["lost"]) == ("", "", "1")
    assert any("00000001.jpg" in note for note in found.notes)


@pytest.mark.parametrize("made", [False, True], ids=["no folder", "empty folder"])
def test_a_folder_without_results(tmp_path, vot, made):
    folder = tmp_path / "nothing"
    if made:
        folder.mkdir()
    with pytest.raises(ResultsError, match="nothing"):
        summarize(folder, open_dataset(vot[0]))
