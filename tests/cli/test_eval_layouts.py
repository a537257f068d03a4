"""`ssiam eval` on each layout: frame sizes from the images, EAO where the dataset has one."""

import json

import pytest

from helpers.benched import write_run, write_vot_year
from helpers.eval_runs import dataset, results, run
from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.evaluation.runs.result_files import vot_path

SCORES = ("pysot", "vot_toolkit")


def scores(capsys):
    captured = capsys.readouterr()
    return json.loads(captured.out), captured.err


def test_sizes_of_a_classic_vot_folder_are_read_from_its_images(tmp_path, capsys):
    folder = write_vot_year(tmp_path / "VOT2018", {"bag": 120, "crossing": 130})
    write_run(tmp_path, "kcf-off", "bag", "i" + "t" * 119)
    # Of a sequence without results not even the image is needed.
    (folder / "crossing" / "00000001.jpg").write_bytes(b"")
    assert run(tmp_path / "kcf-off", "--dataset", folder, "--json") == 0
    found, errors = scores(capsys)
    assert found["pysot"]["accuracy"] == pytest.approx(1)
    assert all(found[name]["eao"] == pytest.approx(1) for name in SCORES)
    assert "crossing" in errors


def test_an_image_that_cannot_be_read_is_named(tmp_path, capsys):
    folder = write_vot_year(tmp_path / "VOT2018", {"bag": 20})
    (folder / "bag" / "00000001.jpg").write_bytes(b"")
    write_run(tmp_path, "kcf-off", "bag", "i" + "t" * 19)
    assert run(tmp_path / "kcf-off", "--dataset", folder) == 2
    error = capsys.readouterr().err
    assert "sequence bag" in error
    assert "00000001.jpg" in error
    assert error.count("\n") == 1


def test_an_otb_folder_has_no_eao(tmp_path, capsys):
    folder = write_dataset(tmp_path / "OTB", sequences=1, frames=50)
    bench = ["bench", str(folder), "--out", str(tmp_path / "runs"), "--trackers", "kcf"]
    assert main([*bench, "--stabilize", "off"]) == 0
    capsys.readouterr()
    assert run(tmp_path / "runs", "--dataset", folder, "--json") == 0
    found, errors = scores(capsys)
    for name in SCORES:
        each = found[name]
        assert each["eao"] is None
        assert 0 < each["accuracy"] < 1
        assert each["lost"] == 1
    assert errors.splitlines() == [line for line in errors.splitlines() if "OTB: no EAO" in line]
    assert run(tmp_path / "runs", "--dataset", folder) == 0
    assert "kcf-off" in capsys.readouterr().out
    assert run(tmp_path / "runs", "--dataset", folder, "--json", "--year", "2019") == 0
    found, errors = scores(capsys)
    assert found["pysot"]["eao"] > 0
    assert "no EAO" not in errors


@pytest.mark.parametrize("size", [{"width": 320}, {"width": None}])
def test_pysots_json_needs_images_only_without_sizes(size, tmp_path, capsys):
    path, folder = dataset(tmp_path, **size), results(tmp_path / "good")
    assert vot_path(folder, "bag").is_file()
    assert run(folder, "--dataset", path) == (0 if size["width"] else 2)
    assert ("sequence bag" in capsys.readouterr().err) == (size["width"] is None)
