"""benchmarks/leaderboard: the page of result files of `ssiam bench`."""

import shutil
import sys
from pathlib import Path

import pytest

from helpers.drawn_datasets import write_otb_folder
from ssiam.cli import main
from ssiam.evaluation.runs.result_files import read_boxes, read_vot

pytest.importorskip("matplotlib")
sys.path.insert(0, str(Path(__file__).parents[2]))
from benchmarks.leaderboard import page
from benchmarks.leaderboard.page import write_leaderboard


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    folder = tmp_path_factory.mktemp("board")
    dataset = folder / "drawn"
    write_otb_folder(dataset, {"Basketball": 8})
    words = ["bench", str(dataset), "--out", str(folder / "raw" / "drawn"), "--trackers", "kcf"]
    words += ["--stabilize", "off,predict", "--shake", "0,0.03"]
    for protocol in ("vot", "ope"):
        assert main([*words, "--protocol", protocol]) == 0
    return folder, write_leaderboard(folder, {"drawn sequences": dataset})


def test_each_stabilization_has_a_row_with_all_strengths(board):
    folder, _ = board
    lines = (folder / "tables.md").read_text().splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if "| kcf" in line]
    assert [row[:2] for row in rows] == [["kcf", "off"], ["kcf", "predict"]]
    assert all(cell for row in rows for cell in row)
    assert "Missing" not in (folder / "tables.md").read_text()


def test_the_page_has_its_plots_and_title(board):
    folder, written = board
    assert {path.name for path in written} == {
        "tables.md",
        "tables.html",
        "lost-drawn-sequences.png",
        "success-drawn-sequences.png",
    }
    assert (folder / "tables.html").read_text().count("Shake leaderboard") == 2


def test_rows_of_trackers_that_lose_equally_many_stay_together(board, tmp_path):
    folder, _ = board
    for other in ("kcf", "mil"):
        for method in ("off", "predict"):
            runs = folder / "raw" / "drawn" / f"kcf-{method}"
            shutil.copytree(runs, tmp_path / "raw" / "drawn" / f"{other}-{method}")
    write_leaderboard(tmp_path, {"drawn": folder / "drawn"})
    lines = (tmp_path / "tables.md").read_text().splitlines()
    found = [line.split("|")[1].strip() for line in lines if line.startswith(("| kcf", "| mil"))]
    assert found == ["kcf", "kcf", "mil", "mil"]


def test_all_points_of_a_plot_are_inside_of_its_panels(monkeypatch):
    figures = []
    monkeypatch.setattr(page, "png", lambda figure: figures.append(figure) or b"")
    found = {
        ("kcf", "off"): {0.0: page._Cell([1.0], 1000), 0.03: page._Cell([2.0], 1000)},
        ("mil", "off"): {0.0: page._Cell([1.0], 1000), 0.03: page._Cell([9.0], 1000)},
    }
    page._plot("drawn", "lost", "lost targets", found, list(found), [0.0, 0.03], page._lost_rate)
    for axes in figures[0].axes:
        assert axes.get_ylim()[0] == 0
        assert axes.get_ylim()[1] >= 9


@pytest.mark.parametrize("shake", ["", "shake-white-0.03-seed0/"])
def test_results_have_the_forms_of_vot_and_otb(board, shake):
    folder, _ = board
    runs = folder / "raw" / "drawn" / shake / "kcf-predict"
    assert len(read_vot(runs / "baseline/Basketball/Basketball_001.txt")) == 8
    assert len(read_boxes(runs / "ope/Basketball.txt")) == 8
