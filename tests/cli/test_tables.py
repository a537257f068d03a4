"""`ssiam tables`: page, figures and errors."""

import re

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main


@pytest.fixture(scope="module")
def benched(tmp_path_factory):
    data = write_dataset(tmp_path_factory.mktemp("tiny"), sequences=2, frames=16)
    out = tmp_path_factory.mktemp("out")
    assert main(["bench", str(data), "--out", str(out), "--trackers", "kcf"]) == 0
    return data, out


def test_page_with_tables_and_figures(benched, tmp_path, capsys):
    data, results = benched
    out = tmp_path / "new" / "page"
    assert main(["tables", str(results), "--dataset", str(data), "--out", str(out)]) == 0
    output, errors = capsys.readouterr()
    for word in ("Table 1", "Table 2", "Table 3", "Table 4", "kcf", "S-SiamMask_E"):
        assert word in output
    assert "no one-pass runs of kcf-off, kcf-paper" in errors
    page = (out / "tables.html").read_text()
    assert page.count("data:image/png;base64,") == 8
    assert not re.search(r"(src|href)=.?http", page)
    text = (out / "tables.md").read_text()
    images = re.findall(r"\(<(.*?\.png)>\)", text)
    assert len(images) == 8
    assert all((out / name).is_file() for name in images)
    assert all(str(path) in output for path in out.iterdir())


def test_chosen_sequences_are_in_the_strips(benched, tmp_path, capsys):
    data, results = benched
    arguments = ["tables", str(results), "--dataset", str(data), "--out", str(tmp_path / "page")]
    assert main([*arguments, "--sequences", "clip1"]) == 0
    text = (tmp_path / "page" / "tables.md").read_text()
    assert "Fig. 3: the camera's path in clip1" in text
    assert main([*arguments, "--sequences", "clip1,clip9"]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert "no sequence 'clip9'" in error
    assert "clip1" in error


def test_table_4_is_judged_unless_it_is_switched_off(benched, tmp_path, capsys):
    data, results = benched
    arguments = ["tables", str(results), "--dataset", str(data), "--no-figures"]
    for options, answer in (([], "Yes"), (["--no-judge"], "   ")):
        out = tmp_path / "-".join(["page", *options])
        words = ["--out", str(out), "--sequences", "clip0,clip1", *options]
        assert main([*arguments, *words]) == 0
        text = (out / "tables.md").read_text()
        for name in ("clip0", "clip1"):
            assert re.search(rf"^\| {name} +\| {answer} +\|", text, re.MULTILINE)


def test_default_folder_without_figures(benched, capsys):
    data, results = benched
    arguments = ["tables", str(results), "--dataset", str(data), "--no-figures"]
    assert main(arguments) == 0
    names = {path.name for path in (results / "tables").iterdir()}
    assert names == {"tables.md", "tables.html"}
    assert main(arguments) == 0, "its own output is not taken as a tracker"


def test_dataset_without_results_is_named(benched, tmp_path, capsys):
    data, results = benched
    other = write_dataset(tmp_path / "other" / "folder", sequences=1, frames=2)
    (other / "clip0").rename(other / "unseen")
    arguments = ["tables", str(results), "--dataset", str(data), "--dataset", str(other)]
    assert main([*arguments, "--no-figures", "--out", str(tmp_path / "page")]) == 0
    output, errors = capsys.readouterr()
    assert "kcf" in output
    assert "folder: no results" in errors
    arguments = ["tables", str(results), "--dataset", str(other), "--no-figures"]
    assert main(arguments) == 2
    assert "folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(["missing", "--dataset", "DATA"], "missing", id="no results"),
        pytest.param(["DATA", "--dataset", "DATA"], "baseline", id="no folder of results"),
        pytest.param(["RESULTS", "--dataset", "missing"], "missing", id="missing dataset"),
        pytest.param(["RESULTS"], "--dataset", id="no dataset given"),
        pytest.param(["RESULTS", "--dataset", "DATA", "--out", "/proc/x"], "/proc/x", id="out"),
    ],
)
def test_wrong_arguments_give_one_line_error(benched, arguments, named, capsys):
    paths = dict(zip(("DATA", "RESULTS"), map(str, benched), strict=True))
    command = ["tables", *(paths.get(word, word) for word in arguments), "--no-figures"]
    assert main(command) == 2
    errors = capsys.readouterr().err
    assert named in errors.splitlines()[-1]
    assert errors.splitlines()[-1].startswith("ssiam: ")
    assert "Traceback" not in errors
