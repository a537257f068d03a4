"""`ssiam eval` of VOT results: tables, JSON and warnings."""

import json

import pytest

from helpers.eval_runs import dataset, results, run

KEYS = {"accuracy", "robustness", "eao", "lost", "frames"}


@pytest.fixture
def vot2018(tmp_path):
    return dataset(tmp_path)


def test_json_of_one_tracker(vot2018, tmp_path, capsys):
    folder = results(tmp_path / "good", lost=("bag",))
    assert run(folder, "--dataset", vot2018, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert {key: set(value) for key, value in found.items()} == {"pysot": KEYS, "vot_toolkit": KEYS}
    assert found["pysot"]["lost"] == found["vot_toolkit"]["lost"] == 1
    assert found["pysot"]["frames"] == found["vot_toolkit"]["frames"] == 520
    assert found["pysot"]["robustness"] == pytest.approx(100 / 520)
    assert found["vot_toolkit"]["robustness"] == pytest.approx(120 / 520)
    assert found["pysot"]["accuracy"] == found["vot_toolkit"]["accuracy"] == 1


def test_json_of_several_trackers_and_their_comparison(vot2018, tmp_path, capsys):
    results(tmp_path / "all" / "a", lost=("bag",))
    results(tmp_path / "all" / "b", shift=3)
    (tmp_path / "all" / "notes").mkdir()
    assert run(tmp_path / "all", "--dataset", vot2018, "--json", "--compare") == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["trackers"]) == ["a", "b"]
    assert set(found["trackers"]["b"]["pysot"]) == KEYS
    difference = found["comparison"]["b"]
    assert difference["reference"] == "a"
    assert difference["lost"]["value"] == -1
    assert difference["accuracy"]["value"] < 0
    assert difference["accuracy"]["share_below_zero"] == 1


def test_measures_that_no_sequence_has_are_not_compared(tmp_path, capsys):
    """Accuracy leaves out the ten frames after a start, all of this sequence."""
    data = dataset(tmp_path, lengths={"bag": 10})
    for name in ("kcf-off", "kcf-paper"):
        results(tmp_path / "all" / name, lengths={"bag": 10})
    results(tmp_path / "all" / "z", lengths={"bag": 10})
    assert run(tmp_path / "all", "--dataset", data, "--compare") == 0
    captured = capsys.readouterr()
    assert "kcf-paper minus kcf-off: no sequence has accuracy in both results" in captured.err
    assert "+0.0" in captured.out
    assert run(tmp_path / "all", "--dataset", data, "--compare", "--json") == 0
    found = json.loads(capsys.readouterr().out)["comparison"]["kcf-paper"]
    assert found["accuracy"] is None
    assert found["lost"]["value"] == 0


def test_results_of_different_sequences_are_not_compared(vot2018, tmp_path, capsys):
    results(tmp_path / "all" / "a", lengths={"bag": 120})
    results(tmp_path / "all" / "b", lengths={"crossing": 400})
    assert run(tmp_path / "all", "--dataset", vot2018, "--compare") == 0
    captured = capsys.readouterr()
    assert "b minus a: no sequence has lost targets in both results" in captured.err
    assert captured.out.count("│ b ") == 4


def test_stabilized_runs_are_compared_with_the_tracker_alone(vot2018, tmp_path, capsys):
    both = "kcf-off", "kcf-paper-threads=2", "kcf-off-threads=2", "lite-off", "lite-predict"
    for name in (*both, "lite-paper-window=9", "theirs"):
        results(tmp_path / "all" / name, lost=("bag",) if "-off" in name else ())
    assert run(tmp_path / "all", "--dataset", vot2018, "--json", "--compare") == 0
    found = json.loads(capsys.readouterr().out)["comparison"]
    assert {name: each["reference"] for name, each in found.items()} == {
        "kcf-paper-threads=2": "kcf-off-threads=2",
        "lite-predict": "lite-off",
        "lite-paper-window=9": "lite-off",
        "theirs": "kcf-off",
    }
    assert all(each["lost"]["value"] == -1 for each in found.values())


def test_tables(vot2018, tmp_path, capsys):
    results(tmp_path / "all" / "a", lost=("bag",))
    results(tmp_path / "all" / "b[red]", shift=3)
    assert run(tmp_path / "all", "--dataset", vot2018, "--compare") == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert captured.out.index("camera_motion") < captured.out.index("occlusion")
    for words in ("pysot", "vot-toolkit", "b[red]", "0.192", "0.231", "minus"):
        assert words in captured.out
    assert max(map(len, captured.out.splitlines())) <= 120


def test_missing_results_are_reported_and_the_rest_is_measured(vot2018, tmp_path, capsys):
    folder = results(tmp_path / "short", lengths={"bag": 110})
    assert run(folder, "--dataset", vot2018, "--json") == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["pysot"]["frames"] == 110
    missing = [line for line in captured.err.splitlines() if "crossing" in line]
    short = [line for line in captured.err.splitlines() if "bag_001.txt" in line]
    assert [line.endswith("it is left out") for line in missing] == [True]
    assert ["110 lines for 120 frames; the first 110" in line for line in short] == [True]
    assert any("no sequence has more than 110 frames" in line for line in captured.err.splitlines())


def test_results_longer_than_the_sequence_are_cut(vot2018, tmp_path, capsys):
    folder = results(tmp_path / "long", lengths={"bag": 130, "crossing": 400})
    assert run(folder, "--dataset", vot2018, "--json") == 0
    captured = capsys.readouterr()
    assert "130 lines for 120 frames" in captured.err
    assert json.loads(captured.out)["vot_toolkit"]["frames"] == 520


def test_undefined_measures_are_null(tmp_path, capsys):
    path = dataset(tmp_path, "VOT2016")
    folder = results(tmp_path / "short", lengths={"bag": 90, "crossing": 80})
    assert run(folder, "--dataset", path, "--json") == 0
    assert json.loads(capsys.readouterr().out)["vot_toolkit"]["eao"] is None


def test_year_option(tmp_path, capsys):
    path, folder = dataset(tmp_path, "copy"), results(tmp_path / "good", lost=("bag",))
    found = []
    for year in (2018, 2019):
        assert run(folder, "--dataset", path, "--json", "--year", year) == 0
        found.append(json.loads(capsys.readouterr().out)["pysot"]["eao"])
    assert found[0] != found[1]


def test_realtime_experiment(vot2018, tmp_path, capsys):
    results(tmp_path / "t", lost=("bag",))
    (tmp_path / "t" / "baseline").rename(tmp_path / "t" / "realtime")
    assert run(tmp_path / "t", "--dataset", vot2018, "--experiment", "realtime", "--json") == 0
    assert json.loads(capsys.readouterr().out)["pysot"]["lost"] == 1


def test_help_describes_the_options(capsys):
    run("--help")
    text = " ".join(capsys.readouterr().out.split())
    for word in ("--dataset", "--year", "--json", "--compare", "pysot", "vot-toolkit"):
        assert word in text


def test_raw_results_of_the_authors(shared, capsys):
    folder = shared("data/vot/results/VOT2018/model_SiamMask_E_ref")
    assert run(folder, "--dataset", shared("data/vot/VOT2018.json"), "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["pysot"]["lost"] == found["vot_toolkit"]["lost"] == 54
    assert found["pysot"]["eao"] == pytest.approx(0.4457, abs=1e-3)
    assert found["vot_toolkit"]["robustness"] == pytest.approx(1.156, abs=1e-3)


def test_damaged_tracker_is_omitted_and_others_are_measured(vot2018, tmp_path, capsys):
    for name in ("a", "b", "c"):
        results(tmp_path / "all" / name, lost=("bag",))
    (tmp_path / "all" / "a" / "baseline" / "bag" / "bag_001.txt").write_text("1\nnonsense\n")
    assert run(tmp_path / "all", "--dataset", vot2018, "--json", "--compare") == 3
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    assert (list(found["trackers"]), list(found["comparison"])) == (["b", "c"], ["c"])
    first, last = captured.err.splitlines()
    assert "bag_001.txt, line 2" in first
    assert "the tracker is omitted" in first
    assert "1 of 3 trackers could not be measured" in last
    for name in ("b", "c"):
        (tmp_path / "all" / name / "baseline" / "bag" / "bag_001.txt").write_text("nonsense\n")
    assert run(tmp_path / "all", "--dataset", vot2018) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_sequence_under_another_spelling_is_named(vot2018, tmp_path, capsys):
    folder = results(tmp_path / "t", lost=("bag",))
    (folder / "baseline" / "bag").rename(folder / "baseline" / "Bag_")
    assert run(folder, "--dataset", vot2018, "--json") == 0
    assert "sequence bag; it is left out (is Bag_ meant?" in capsys.readouterr().err
