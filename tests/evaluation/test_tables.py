"""Tables: cells against the measures, and notes on missing results."""

import re

import numpy as np
import pytest

from helpers.benched import bench, write_run, write_vot_year
from helpers.shaky_dataset import write_dataset
from ssiam.datasets import open_dataset
from ssiam.evaluation.measures.eao import INTERVALS, known_year
from ssiam.evaluation.measures.success import success
from ssiam.evaluation.paper.missing import how_to_get
from ssiam.evaluation.paper.printed import printed_tables
from ssiam.evaluation.paper.published import (
    FRAMES,
    OTHER_ROWS,
    PAPER_TRACKERS,
    RELATED_TRACKERS,
    TABLE1,
    TABLE2,
    TABLE3,
    TABLE4,
)
from ssiam.evaluation.paper.summary import summarize
from ssiam.evaluation.paper.tables import other_sources, table1, table2, table3, table4
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
from ssiam.trackers import TRACKERS

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
    run = ["off", "orb", "gftt"]
    missing = {row[1]: row[-1] for row in generators.rows}
    assert list(missing) == [*run, "harris", "brisk", "mser", "direct"]
    assert [name for name, reason in missing.items() if not reason] == run
    assert missing["brisk"] == "run of --preset table2"
    assert [(row[1][:4], row[2]) for row in thresholds.rows if not row[-1]] == [
        ("THx1", "60"),
        ("THx1", "80"),
        ("THx2", "20"),
        ("THa,", "0.3"),
    ]
    wide = row_of(thresholds, "kcf", "THx1 = 2 THy1, px", "80")
    assert wide["lost"] == f"{sum(found.find('kcf', WIDE.config).lost.values()):g}"
    for table in (generators, thresholds):
        assert "SiamMask_E on VOT2018, ours of kcf" in table.notes[0]


def test_tables_2_and_3_have_every_cell_of_the_paper_and_the_difference(found):
    names = ("A", "R", "EAO", "fps")
    for name, theirs in TABLE2.items():
        cells = row_of(table2(found), "kcf", name)
        assert [float(cells[f"paper {each}"]) for each in names] == list(theirs)
    thresholds = table3(found)
    for threshold, by_value in TABLE3.items():
        for value, theirs in by_value.items():
            rows = [
                row
                for row in thresholds.rows
                if re.match(rf"{threshold}\b", row[1]) and row[2] == f"{value:g}"
            ]
            assert len(rows) == (2 if threshold == "THa" else 1), "THa in radians and degrees"
            for row in rows:
                cells = dict(zip(thresholds.head, row, strict=True))
                assert [float(cells[f"paper {each}"]) for each in names[:3]] == list(theirs[:3])
    cells = row_of(table2(found), "kcf", "gftt")
    for name in ("A", "R", "fps"):
        ours, theirs, difference = (
            float(cells[key]) for key in (name, f"paper {name}", f"diff {name}")
        )
        assert difference == pytest.approx(ours - theirs)
        assert cells[f"diff {name}"][0] in "+-"
    assert cells["EAO"] == cells["diff EAO"] == "", "not a year of VOT"


def test_table_4_counts_lost_targets_by_sequence(benched, found):
    _, out, _ = benched
    table = table4(found)
    assert table.head == ("sequence", "Stabilization", "kcf-off", "kcf-paper")
    total = np.zeros(2, int)
    for name in found.sequences:
        lost = [len(read_vot(vot_path(out / e.label, name)).failures) for e in (OFF, PAPER)]
        total += lost
        if any(lost):
            assert tuple(row_of(table, name).values())[2:] == tuple(map(str, lost))
    assert table.rows[-1] == ("all sequences", "", *map(str, total))


def test_table_4_has_the_judges_answers_and_chosen_sequences(vot):
    data, out = vot
    found = summarize(out, open_dataset(data))
    table = table4(found, ["road"], {"girl": True, "road": False})
    girl, road = row_of(table, "girl"), row_of(table, "road")
    assert (girl["Stabilization"], girl["paper Stabilization"]) == ("Yes", "No")
    assert (road["Stabilization"], road["nanotrack_v3-off"]) == ("No", "0")
    assert row_of(table, "wiper")["Stabilization"] == ""


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
        assert [cells[name] for name in ("A", "R", "EAO", "lost")] == [
            f"{scores.accuracy:.3f}",
            f"{scores.robustness:.3f}",
            f"{scores.eao:.3f}",
            "1",
        ]
    published = row_of(table, "S-SiamMask_E")
    assert [published[f"paper {name}"] for name in ("A", "R", "EAO", "fps")] == [
        "0.637",
        "0.243",
        "0.449",
        "33",
    ]
    assert published["A"] == published["diff A"] == published["lost"] == ""
    other = other_sources(found)
    nanotrack = row_of(other, "NanoTrack V3")
    assert (nanotrack["their EAO"], nanotrack["source"]) == ("0.449", "SiamTrackers")
    assert nanotrack["EAO"] == row_of(table, "nanotrack_v3", "off")["EAO"]
    assert row_of(other, "SiamMask_E", "siammask_e")["their lost"] == "53"


def test_the_papers_tracker_is_compared_cell_by_cell(vot, tmp_path):
    data, _ = vot
    for label in ("siammask_e-off", "siammask_e-paper"):
        write_run(tmp_path / "runs", label, "girl", "i" + "." * 59 + "x----i" + "." * 64, 2.0)
        write_run(tmp_path / "runs", label, "road", "i" + "." * 119, 2.0)
    found = summarize(tmp_path / "runs", open_dataset(data))
    cells = row_of(table1(found), "siammask_e", "paper")
    assert cells["missing"] == ""
    for name, theirs in (("A", 0.637), ("R", 0.243), ("EAO", 0.449)):
        assert float(cells[f"paper {name}"]) == theirs
        assert float(cells[f"diff {name}"]) == pytest.approx(float(cells[name]) - theirs, abs=1e-9)
    orb = row_of(table2(found), "siammask_e", "orb")
    assert (orb["A"], orb["diff A"]) == (cells["A"], cells["diff A"])
    assert table2(found).notes == []
    girl = row_of(table4(found), "girl")
    assert (girl["siammask_e-off"], girl["diff Original"], girl["diff S-Siam"]) == ("1", "-3", "-3")
    assert girl["missing"] == ""


def test_variants_of_a_run_are_compared_too(vot, tmp_path):
    data, _ = vot
    variant = "-runtime=torch-device=cuda"
    for label in ("siammask_e-off", "siammask_e-paper"):
        run = "i" + "." * 59 + "x----i" + "." * 64
        write_run(tmp_path / "runs", f"{label}{variant}", "girl", run, 2.0)
    found = summarize(tmp_path / "runs", open_dataset(data))
    cells = row_of(table1(found), "siammask_e", "paper")
    assert (cells["paper EAO"], cells["missing"]) == ("0.449", "")
    assert float(cells["diff A"]) == pytest.approx(float(cells["A"]) - 0.637, abs=1e-9)
    assert not [row for row in table1(found).rows if row[0] == "S-SiamMask_E"]
    assert row_of(table2(found), "siammask_e", "orb")["A"] == cells["A"]
    girl = row_of(table4(found), "girl")
    assert (girl["diff S-Siam"], girl["missing"]) == ("-3", "")


def test_relatives_of_the_papers_trackers_are_set_beside_them(vot, tmp_path):
    data, _ = vot
    for label in ("siammask_vot-off", "siammask_vot-paper", "siamrpn_alex_dwxcorr-off"):
        write_run(tmp_path / "runs", label, "girl", "i" + "." * 129, 2.0)
    table = table1(summarize(tmp_path / "runs", open_dataset(data)))
    assert row_of(table, "siammask_vot", "paper")["paper EAO"] == "0.449"
    assert row_of(table, "siammask_vot", "off")["paper EAO"] == "0.432"
    assert row_of(table, "siamrpn_alex_dwxcorr")["paper EAO"] == "0.415"
    assert row_of(table, "S-SiamMask_E")["missing"], "not measured by a relative"
    notes = [each for each in table.notes if "is set beside" in each]
    assert [each.partition(": ")[0] for each in notes] == [
        "siammask_vot is set beside the paper's SiamMask_E",
        "siamrpn_alex_dwxcorr is set beside the paper's SiamRPN++",
    ]


def test_every_related_tracker_exists():
    assert set(RELATED_TRACKERS) <= set(TRACKERS)
    assert set(RELATED_TRACKERS.values()) <= set(PAPER_TRACKERS.values())


def test_rows_without_results_name_weights_data_or_run(vot, tmp_path, monkeypatch):
    data, out = vot
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    found = summarize(out, open_dataset(data))
    assert row_of(table1(found), "S-SiamFC")["missing"] == "weights of siamfc"
    (tmp_path / "weights" / "siamfc").mkdir(parents=True)
    (tmp_path / "weights" / "siamfc" / "network.json").touch()
    assert row_of(table1(found), "S-SiamFC")["missing"] == "run of --preset table1"
    printed = {each.title[:7]: each for each in printed_tables([table1(found)], {2018})}
    assert list(printed) == ["Table 1", "Table 2", "Table 3"]
    assert {row[0] for row in printed["Table 1"].rows} == {"VOT2016", "VOT2019"}
    missing = row_of(printed["Table 1"], "VOT2016", "SiamRPN++")["missing"]
    assert missing == "VOT2016, weights of siamrpn_r50_l234_dwxcorr"
    dataset, weights = how_to_get([missing, ""])
    assert "votchallenge.net" in dataset
    assert "github.com/STVIR/pysot" in weights
    assert "ssiam weights import model.pth --tracker siamrpn_r50_l234_dwxcorr" in weights
    assert how_to_get(["weights of siamfc"]) == ["weights of siamfc: ssiam weights get siamfc"]


def test_without_results_of_vot_all_four_tables_are_printed():
    tables = {each.title[:7]: each for each in printed_tables([], {None})}
    assert [len(each.rows) for each in tables.values()] == [18, 5, 10, 8]
    cells = [cell for row in tables["Table 1"].rows for cell in row[3:6]]
    assert len([cell for cell in cells if re.fullmatch(r"0\.\d{3}", cell)]) == 54
    assert row_of(tables["Table 2"], "orb")["paper EAO"] == "0.449"
    assert row_of(tables["Table 4"], "rabbit")["paper S-Siam"] == "3"
    assert all(
        "VOT2018" in row[-1] for name in ("2", "3", "4") for row in tables[f"Table {name}"].rows
    )


def test_table_4_of_2018_has_the_papers_counts(vot):
    data, out = vot
    table = table4(summarize(out, open_dataset(data)))
    for name, row in TABLE4.items():
        cells = row_of(table, name)
        assert cells["paper Original"] == str(row.original)
        assert cells["paper S-Siam"] == str(row.stabilized)
        assert cells["paper Stabilization"] == ("Yes" if name not in ("girl", "book") else "No")
        assert cells["nanotrack_v3-off"] == ("1" if name == "girl" else "")
    assert row_of(table, "wiper")["missing"] == "VOT2018"
    assert "road" not in [row[0] for row in table.rows]


def test_published_lost_targets_agree_with_robustness():
    both = [each for each in (*TABLE1, *OTHER_ROWS) if None not in (each.robustness, each.lost)]
    assert len(both) == 30
    for each in both:
        assert each.robustness == pytest.approx(100 * each.lost / FRAMES[each.year], abs=6e-4)


def test_the_papers_default_rows_agree_between_its_tables():
    (ours,) = [each for each in TABLE1 if (each.label, each.year) == ("siammask_e-paper", 2018)]
    assert TABLE2["orb"] == ours.measures
    for threshold, value in (("THx1 = 2 THy1", 60), ("THx2 = 2 THy2", 20), ("THa", 0.3)):
        assert TABLE3[threshold][value][:3] == ours.measures[:3]


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


def test_heads_name_every_column(found):
    measured = ["lost", "overlap", "success", "missing"]
    columns = [f"{kind}{name}" for name in ("A", "R", "EAO") for kind in ("", "paper ", "diff ")]
    speed = ["fps", "paper fps", "diff fps"]
    assert [*table2(found).head] == ["tracker", "keypoints", *columns, *speed, *measured]
    assert [*table3(found).head] == ["tracker", "threshold", "value", *columns, *measured]
