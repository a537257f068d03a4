"""Input that `ssiam eval` refuses, with a one-line error that names it."""

import pytest

from helpers.eval_runs import dataset, results, run
from ssiam.evaluation.runs.result_files import vot_path


@pytest.fixture
def inputs(tmp_path):
    """Valid and invalid result folders and datasets."""
    dataset(tmp_path)
    dataset(tmp_path, "copy")
    dataset(tmp_path, "VOT2017", width=None)
    results(tmp_path / "good")
    results(tmp_path / "others", lengths={"another": 20})
    (tmp_path / "empty").mkdir()
    (tmp_path / "nothing" / "baseline").mkdir(parents=True)
    (tmp_path / "once" / "ope").mkdir(parents=True)
    (tmp_path / "timed" / "realtime").mkdir(parents=True)
    for name, text in [("damaged", "1\n1,2,3\n"), ("blank", ""), ("no_start", "2\n1\n2\n")]:
        results(tmp_path / name)
        vot_path(tmp_path / name, "bag").write_text(text)
    return tmp_path


REFUSED = [
    # name, arguments, words of the message
    ("no results", ("missing", "--dataset", "VOT2018.json"), "missing: there is no such folder"),
    ("an empty folder", ("empty", "--dataset", "VOT2018.json"), "empty: neither it nor a folder"),
    ("one pass", ("once", "--dataset", "VOT2018.json"), "give --experiment ope"),
    ("realtime", ("timed", "--dataset", "VOT2018.json"), "give --experiment realtime"),
    ("no files", ("nothing", "--dataset", "VOT2018.json"), "nothing: no results"),
    (
        "other experiment",
        ("good", "--dataset", "VOT2018.json", "--experiment", "realtime"),
        "SEQUENCE_001.txt; it has other runs: give --experiment baseline",
    ),
    ("other sequences", ("others", "--dataset", "VOT2018.json"), "others: no results"),
    ("damaged", ("damaged", "--dataset", "VOT2018.json"), "bag_001.txt, line 2"),
    ("blank", ("blank", "--dataset", "VOT2018.json"), "bag_001.txt: is empty"),
    ("no start", ("no_start", "--dataset", "VOT2018.json"), "more failures (2) than starts"),
    ("no dataset", ("good",), "--dataset"),
    ("missing dataset", ("good", "--dataset", "missing.json"), "missing.json"),
    ("unknown year", ("good", "--dataset", "copy.json", "--year", "2030"), "VOT2030"),
    ("no size", ("good", "--dataset", "VOT2017.json"), "sequence bag"),
    ("compare one", ("good", "--dataset", "VOT2018.json", "--compare"), "--compare needs"),
]


@pytest.mark.parametrize(
    ("arguments", "named"), [pytest.param(*case[1:], id=case[0]) for case in REFUSED]
)
def test_invalid_input_gives_one_line_error(inputs, arguments, named, capsys, monkeypatch):
    monkeypatch.chdir(inputs)
    assert run(*arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("ssiam: ")
    assert named in captured.err
    assert captured.err.count("\n") == 1
