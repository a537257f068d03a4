"""`ssiam bench`: output, failed runs, resuming, and wrong arguments."""

import json

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.trackers.opencv import OpenCvTracker


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"), sequences=2, frames=8)


def test_table_lists_every_tracker(dataset, tmp_path, capsys):
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--trackers", "kcf"]
    assert main(arguments) == 0
    output = capsys.readouterr().out
    for word in ("kcf-off", "kcf-paper", "2 of 2", str(tmp_path)):
        assert word in output
    assert (tmp_path / "kcf-off" / "baseline" / "clip0" / "clip0_001.txt").is_file()


def test_runs_with_a_template_memory_are_other_runs(dataset, tmp_path, capsys):
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--trackers", "kcf,lite"]
    arguments += ["--stabilize", "off"]
    assert main(arguments) == 0
    assert main([*arguments, "--template-memory", "--no-distractors"]) == 0
    output = capsys.readouterr().out
    label = "lite-off-template_memory=True-distractors=False"
    assert label in output
    assert {path.name for path in tmp_path.iterdir()} == {"kcf-off", "lite-off", label}
    assert main(["eval", str(tmp_path), "--dataset", str(dataset)]) == 0
    assert "template_memory=True" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--template-memory", "--distractors", "--no-distractors"])
def test_presets_have_neither_memory_nor_distractors(dataset, tmp_path, capsys, option):
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--preset", "table2", option]
    assert main(arguments) == 2
    assert "--preset table2: the paper's tables have neither" in capsys.readouterr().err


@pytest.mark.parametrize("shake", ["0", "0.01"])
def test_one_pass_runs_have_no_lost_targets(dataset, tmp_path, capsys, shake):
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--trackers", "kcf"]
    arguments += ["--stabilize", "off", "--shake", shake]
    assert main([*arguments, "--protocol", "ope"]) == 0
    assert "lost" not in capsys.readouterr().out
    assert main(arguments) == 0
    assert "lost" in capsys.readouterr().out


def test_preset_lists_missing_entries_and_runs_the_others(dataset, tmp_path, capsys):
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--preset", "table2"]
    assert main([*arguments, "--trackers", "kcf"]) == 0
    output = capsys.readouterr().out
    assert output.splitlines()[0].startswith("missing: ")
    assert (tmp_path / "kcf-paper-keypoints=gftt" / "baseline").is_dir()


def test_failed_run_is_reported_and_others_are_kept(tmp_path, capsys):
    folder = write_dataset(tmp_path / "data", sequences=2, frames=5)
    (folder / "clip1" / "img" / "0002.jpg").write_bytes(b"")
    out = tmp_path / "out"
    arguments = ["--trackers", "kcf", "--stabilize", "off,paper"]
    assert main(["bench", str(folder), "--out", str(out), *arguments]) == 3
    captured = capsys.readouterr()
    error = captured.err.strip()
    assert "2 of 4 runs have no result" in error
    assert "clip1" in error
    assert len(error.splitlines()) == 1
    assert captured.out.count("no result: kcf-") == 2
    assert len(list(out.rglob("clip0_001.txt"))) == 2


def test_motchallenge_objects_are_separate_sequences(tmp_path, capsys):
    clip = write_dataset(tmp_path / "data", sequences=1, frames=6) / "clip0"
    boxes = (clip / "groundtruth_rect.txt").read_text().splitlines()
    lines = [f"{t},{i},{box},1,1,1" for t, box in enumerate(boxes, 1) for i in (3, 7) if t + i > 5]
    (clip / "groundtruth_rect.txt").unlink()
    (clip / "img").rename(clip / "img1")
    (clip / "gt").mkdir()
    (clip / "gt" / "gt.txt").write_text("\n".join(lines))
    out, arguments = tmp_path / "out", ["--trackers", "kcf", "--stabilize", "off"]
    command = ["bench", str(clip), "--out", str(out), *arguments, "--protocol", "ope"]
    assert main(command) == 0
    results = {path.stem: path for path in (out / "kcf-off" / "ope").iterdir()}
    assert set(results) == {"clip0-3", "clip0-7"}
    counts = [len(results[name].read_text().splitlines()) for name in sorted(results)]
    assert counts == [4, 6]
    capsys.readouterr()
    assert main(["eval", str(out), "--dataset", str(clip), "--experiment", "ope", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)["trackers"]["kcf-off"]
    assert figures["sequences"] == 2
    assert figures["success"] > 0.3


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_failed_start_does_not_stop_other_sequences(tmp_path, capsys, jobs):
    folder = write_dataset(tmp_path / "data", sequences=3, frames=6)
    truth = folder / "clip0" / "groundtruth_rect.txt"
    whole = truth.read_text()
    truth.write_text("\n".join(["54,15,1,1", *whole.splitlines()[1:]]) + "\n")
    out = tmp_path / "out"
    arguments = ["bench", str(folder), "--out", str(out), "--jobs", jobs]
    arguments += ["--trackers", "csrt", "--stabilize", "off"]
    assert main(arguments) == 3
    captured = capsys.readouterr()
    assert "1 of 3 runs have no result" in captured.err
    assert "csrt cannot track a box of 1x1 pixels" in captured.out
    assert "2 of 3" in captured.out
    reason = out / "csrt-off" / "failed" / "baseline" / "clip0.log"
    assert "csrt cannot track a box of 1x1 pixels" in reason.read_text()
    assert {path.name for path in out.rglob("*_001.txt")} == {"clip1_001.txt", "clip2_001.txt"}
    # Only the failed run is repeated.
    truth.write_text(whole)
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*_001.txt")}
    assert main(arguments) == 0
    assert "3 of 3" in capsys.readouterr().out
    assert not reason.exists()
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_exception_in_a_tracker_does_not_stop_other_runs(tmp_path, capsys, monkeypatch):
    folder = write_dataset(tmp_path / "data", sequences=3, frames=6)
    update, calls = OpenCvTracker.update, []

    def fail_on_second_call(tracker, view):
        calls.append(view)
        if len(calls) == 2:
            raise RuntimeError("a network of\ntwo lines")
        return update(tracker, view)

    monkeypatch.setattr(OpenCvTracker, "update", fail_on_second_call)
    arguments = ["bench", str(folder), "--out", str(tmp_path / "out"), "--trackers", "kcf"]
    assert main([*arguments, "--stabilize", "off"]) == 3
    captured = capsys.readouterr()
    assert "kcf-off on clip0: RuntimeError: a network of two lines" in captured.err
    assert captured.err.count("\n") == 1
    assert "2 of 3" in captured.out
    assert main([*arguments, "--stabilize", "off"]) == 0


def test_damaged_earlier_result_does_not_stop_other_runs(tmp_path, capsys):
    folder = write_dataset(tmp_path / "data", sequences=2, frames=6)
    arguments = ["bench", str(folder), "--out", str(tmp_path / "out"), "--trackers", "kcf"]
    arguments += ["--stabilize", "off"]
    assert main(arguments) == 0
    (damaged,) = (tmp_path / "out").rglob("clip0_001.txt")
    content = damaged.read_bytes()
    damaged.write_bytes(b"\x00\xffnothing")
    (tmp_path / "out" / "kcf-off" / "baseline" / "clip1" / "clip1_001.txt").unlink()
    assert main(arguments) == 3
    assert str(damaged) in capsys.readouterr().err
    assert len(list((tmp_path / "out").rglob("clip1_001.txt"))) == 1
    damaged.write_bytes(content)
    assert main(arguments) == 0


WRONG = {
    "no dataset": (["--out", "x"], "no dataset"),
    "no such folder": (["missing", "--out", "x"], "missing"),
    "weights without a name": (["DATA", "--out", "x", "--weights", "here"], "--weights 'here'"),
    "weights of no tracker": (
        ["DATA", "--out", "x", "--weights", "SiamFC=here"],
        "did you mean siamfc?",
    ),
    "unknown tracker": (["DATA", "--out", "x", "--trackers", "magic"], "unknown tracker 'magic'"),
    "another spelling": (
        ["DATA", "--out", "x", "--trackers", "NanoTrack-V3"],
        "did you mean nanotrack_v3?",
    ),
    "unknown method": (["DATA", "--out", "x", "--stabilize", "on"], "unknown stabilize 'on'"),
    "unknown preset": (["DATA", "--out", "x", "--preset", "table9"], "unknown preset 'table9'"),
    "no jobs": (["DATA", "--out", "x", "--jobs", "0"], "--jobs 0"),
    "no cluster": (
        ["DATA", "--out", "x", "--trackers", "kcf", "--cluster", "tcp://127.0.0.1:1"],
        "tcp://127.0.0.1:1",
    ),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_give_one_line_error(
    arguments, message, dataset, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    arguments = [str(dataset) if word == "DATA" else word for word in arguments]
    assert main(["bench", *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    assert not any(tmp_path.rglob("*_001.txt"))


def test_datasets_with_sequences_of_one_name_are_refused(dataset, tmp_path, capsys):
    other = write_dataset(tmp_path / "other", sequences=1, frames=3)
    arguments = [str(dataset), str(other), "--out", str(tmp_path / "runs"), "--trackers", "kcf"]
    assert main(["bench", *arguments]) == 2
    error = capsys.readouterr().err
    assert "both have a sequence 'clip0'" in error
    assert str(other) in error
    assert error.count("\n") == 1
    assert not (tmp_path / "runs").exists()
