"""`ssiam bench --shake`: results, table, and `ssiam tables` of the results."""

import json

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.datasets import Shake
from ssiam.evaluation.measures.trajectory import Status
from ssiam.evaluation.runs.result_files import read_vot, vot_path
from ssiam.evaluation.runs.shaken_results import read_shake

FOLDERS = [f"shake-{kind}-0.02-seed{seed}" for kind in ("white", "gusts") for seed in (0, 1)]
SHAKEN = ["--shake", "0,0.02", "--shake-kind", "white,gusts", "--shake-seeds", "2"]


def bench(dataset, out, *more):
    arguments = ["bench", str(dataset), "--out", str(out), "--trackers", "kcf"]
    return main([*arguments, "--stabilize", "off", *more])


@pytest.fixture(scope="module")
def benched(dataset, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    assert bench(dataset, out, *SHAKEN) == 0
    return out


def files(out):
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in out.rglob("*_001.txt")
        if "times" not in path.parts
    }


def test_each_shake_has_its_own_results_folder(dataset, benched, tmp_path):
    assert sorted(path.name for path in benched.iterdir()) == sorted(["kcf-off", *FOLDERS])
    results = [f"kcf-off/baseline/clip{n}/clip{n}_001.txt" for n in (0, 1)]
    wanted = [f"{folder}/{path}" for folder in FOLDERS for path in results]
    found = files(benched)
    assert sorted(found) == sorted([*results, *wanted])
    assert len({found[path] for path in found if "clip0" in path}) == 5
    saved = json.loads((benched / FOLDERS[3] / "shake.json").read_text())
    assert saved == {
        "strength": 0.02,
        "kind": "gusts",
        "seed": 1,
        "exposure": 0.0,
        "readout": 0.0,
        "border": "reflect",
    }
    assert bench(dataset, tmp_path) == 0
    assert files(tmp_path) == {path: found[path] for path in results}, "same as without --shake"


def test_table_sums_over_kinds_and_seeds(dataset, benched, capsys):
    before = {path: path.stat().st_mtime_ns for path in benched.rglob("*")}
    assert bench(dataset, benched, *SHAKEN) == 0
    assert {path: path.stat().st_mtime_ns for path in benched.rglob("*")} == before, (
        "finished runs are not repeated"
    )
    output = capsys.readouterr().out
    for word in ("shake", "frames", "lost", "ms per frame", "2 of 2", "8 of 8", "0 %", "2 %"):
        assert word in output


def test_interrupted_run_continues_to_the_same_results(dataset, benched, tmp_path):
    assert bench(dataset, tmp_path, "--shake", "0.02") == 0
    again = vot_path(tmp_path / FOLDERS[0] / "kcf-off", "clip1")
    again.unlink()
    assert bench(dataset, tmp_path, *SHAKEN) == 0
    assert again.is_file()
    assert files(tmp_path) == files(benched)


def test_parallel_jobs_give_the_same_results(dataset, benched, tmp_path):
    assert bench(dataset, tmp_path, *SHAKEN, "--jobs", "2") == 0
    assert files(tmp_path) == files(benched)


def test_folder_name_contains_all_shake_options(dataset, tmp_path):
    more = ["--shake-exposure", "0.5", "--shake-readout", "0.25", "--shake-border", "crop"]
    assert bench(dataset, tmp_path, "--shake", "0.02", *more) == 0
    name = "shake-white-0.02-seed0-exposure=0.5-readout=0.25-border=crop"
    assert [path.name for path in tmp_path.iterdir()] == [name]
    wanted = Shake(0.02, exposure=0.5, readout=0.25, border="crop")
    assert read_shake(tmp_path / name) == wanted
    assert read_shake(tmp_path / name / "kcf-off") == wanted


def test_tables_of_a_shake_folder(dataset, benched, tmp_path, capsys):
    arguments = ["--dataset", str(dataset), "--no-figures", "--out", str(tmp_path)]
    pages = []
    for folder in (benched, benched / FOLDERS[0]):
        assert main(["tables", str(folder), *arguments]) == 0
        pages.append(capsys.readouterr().out)
    assert "kcf" in pages[1]
    assert pages[0] != pages[1]


WRONG = {
    "no number": (["--shake", "3%"], "--shake '3%': give shares"),
    "percent": (["--shake", "3"], "strength of shake is 3.0: give a share"),
    "nothing": (["--shake", ","], "--shake ','"),
    "unknown kind": (["--shake", "0.03", "--shake-kind", "sway"], "unknown kind of shake 'sway'"),
    "no strength": (["--shake-kind", "gusts"], "give --shake too"),
    "no seeds": (["--shake", "0.03", "--shake-seeds", "0"], "--shake-seeds 0"),
    "long exposure": (["--shake", "0.03", "--shake-exposure", "2"], "exposure of shake is 2"),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_give_one_line_error(arguments, message, dataset, tmp_path, capsys):
    assert bench(dataset, tmp_path, *arguments) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_target_shaken_out_of_the_image_does_not_stop_the_run(tmp_path):
    """Every tracker refuses to start on a box outside the image."""
    folder = write_dataset(tmp_path / "data", sequences=1, frames=12)
    (folder / "clip0" / "groundtruth_rect.txt").write_text("1,1,4,4\n" * 12)
    for protocol in ("vot", "ope"):
        out = tmp_path / protocol
        more = ["--shake", "0.05", "--shake-seeds", "4", "--protocol", protocol]
        assert bench(folder, out, *more) == 0
    status = [read_vot(path).status[0] for path in (tmp_path / "vot").rglob("*_001.txt")]
    assert Status.SKIPPED in status
