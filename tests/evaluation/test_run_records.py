"""``run.json`` and the tasks of a benchmark: files, folders and one-line errors."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.datasets import Shake, open_dataset
from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.trajectory import Trajectory
from ssiam.evaluation.runs import bench, identity
from ssiam.evaluation.runs.bench import Task, TaskResult, run_all, run_task, tasks
from ssiam.evaluation.runs.entries import Entry, changed_runtime, entries
from ssiam.evaluation.runs.identity import RECORD, Identity, label_in, read_identity
from ssiam.evaluation.runs.result_files import ResultsError, read_boxes, read_vot, write_vot
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import StabilizerConfig

OFF, PAPER = (Entry("kcf", StabilizerConfig(method)) for method in ("off", "paper"))
LITE = Entry("lite", StabilizerConfig("off"))
PLAIN = Identity(None, "openvino", "cpu", "f32", 1)
WEIGHTS = Identity("ab" * 32, "openvino", "cpu", "f32", 1)
GOOD = {
    "weights_sha256": None,
    "runtime": "openvino",
    "device": "cpu",
    "precision": "f32",
    "threads": 1,
}
NOT_WRITTEN = (
    "not as written by ssiam bench; restore it, or delete the folder to run the tracker again"
)


@pytest.mark.parametrize("made", [PLAIN, WEIGHTS], ids=["plain", "weights"])
def test_a_record_is_read_as_written(tmp_path, made):
    assert read_identity(tmp_path) is None
    made.claim(tmp_path / "kcf-off")
    assert read_identity(tmp_path / "kcf-off") == made
    made.claim(tmp_path / "kcf-off")  # again
    values = json.loads((tmp_path / "kcf-off" / RECORD).read_text())
    assert values == {**GOOD, "weights_sha256": made.weights_sha256}


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("weights_sha256", "cd", "weights_sha256 None, not cd"),
        ("runtime", "torch", "runtime openvino, not torch"),
        ("device", "cuda", "device cpu, not cuda"),
        ("precision", "int8", "precision f32, not int8"),
        ("threads", 2, "threads 1, not 2"),
    ],
)
def test_results_of_another_identity_are_kept(tmp_path, name, value, shown):
    PLAIN.claim(tmp_path)
    other = Identity(**{**GOOD, name: value})
    assert not other.made(tmp_path, OFF)
    assert PLAIN.made(tmp_path, OFF)
    with pytest.raises(ResultsError) as caught:
        other.claim(tmp_path)
    assert str(caught.value) == f"{tmp_path}: holds results of {shown}; give another --out"
    assert read_identity(tmp_path) == PLAIN


def test_results_without_a_record_are_of_trackers_without_networks(tmp_path):
    assert PLAIN.made(tmp_path, OFF)
    assert not WEIGHTS.made(tmp_path, LITE)


def test_the_label_of_other_weights_has_their_digest(tmp_path):
    other = "lite-off-weights=abababababab"
    assert label_in(tmp_path, OFF, PLAIN) == "kcf-off"
    assert label_in(tmp_path, LITE, WEIGHTS) == "lite-off"
    result = tmp_path / "lite-off" / "baseline" / "s" / "s_001.txt"
    result.parent.mkdir(parents=True)
    assert label_in(tmp_path, LITE, WEIGHTS) == "lite-off"
    result.touch()
    assert label_in(tmp_path, LITE, WEIGHTS) == other
    WEIGHTS.claim(tmp_path / "lite-off")
    assert label_in(tmp_path, LITE, WEIGHTS) == "lite-off"
    (tmp_path / "lite-off" / RECORD).unlink()
    result.unlink()
    Identity(**{**GOOD, "weights_sha256": "cd" * 32}).claim(tmp_path / "lite-off")
    assert label_in(tmp_path, LITE, WEIGHTS) == other
    assert label_in(tmp_path, LITE, PLAIN) == "lite-off", "while the weights are missing"


@pytest.mark.parametrize(
    "values",
    [
        *({**GOOD, name: 3} for name in GOOD if name != "threads"),
        *({**GOOD, name: None} for name in GOOD if name != "weights_sha256"),
        {**GOOD, "threads": "1"},
        {**GOOD, "threads": True},
        {**GOOD, "more": 1},
        {name: value for name, value in GOOD.items() if name != "device"},
        list(GOOD),
        None,
    ],
    ids=str,
)
def test_records_with_other_fields_are_damaged(tmp_path, values):
    (tmp_path / RECORD).write_text(json.dumps(values))
    with pytest.raises(ResultsError) as caught:
        read_identity(tmp_path)
    assert str(caught.value) == f"{tmp_path / RECORD}: {NOT_WRITTEN}"


def test_records_of_more_than_1024_bytes_are_damaged(tmp_path):
    text = json.dumps(GOOD)
    (tmp_path / RECORD).write_text(text.ljust(1024))
    assert read_identity(tmp_path) == PLAIN
    for damaged in (text.ljust(1024) + "x", "", "[" * 600, "\xe9"):
        (tmp_path / RECORD).write_bytes(damaged.encode())
        with pytest.raises(ResultsError, match="not as written by ssiam bench"):
            read_identity(tmp_path)


def test_a_record_that_cannot_be_read_is_named(tmp_path, monkeypatch):
    PLAIN.claim(tmp_path)

    def broken(path, mode="r"):
        raise OSError(5, os.strerror(5))

    monkeypatch.setattr(identity.Path, "open", broken)
    with pytest.raises(ResultsError) as caught:
        read_identity(tmp_path)
    assert str(caught.value) == f"{tmp_path / RECORD}: cannot be read ({os.strerror(5)})"


def test_runtime_options_that_are_not_the_defaults():
    assert changed_runtime(RuntimeOptions()) == {}
    assert changed_runtime(RuntimeOptions("torch", 4, "f16", "cuda")) == {
        "runtime": "torch",
        "device": "cuda",
        "precision": "f16",
        "threads": 4,
    }


def test_every_tracker_is_run_with_every_method():
    weights = {"siamfc": Path("w")}
    found = entries(["kcf", "siamfc"], ["off", "paper"], weights, distractors=True)
    assert [(each.tracker, each.config.stabilize) for each in found] == [
        ("kcf", "off"),
        ("kcf", "paper"),
        ("siamfc", "off"),
        ("siamfc", "paper"),
    ]
    assert [each.weights for each in found] == [None, None, Path("w"), Path("w")]
    assert [each.distractors for each in found] == [None, None, True, True]
    with pytest.raises(ArgumentError, match="unknown tracker 'magic'"):
        entries(["magic"], ["off"], {})


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("data"), sequences=2, frames=4)


def test_tasks_are_ordered_by_tracker_then_shake_then_sequence(data, tmp_path):
    dataset, shake = open_dataset(data), Shake(0.02)
    names = list(dataset.sequences)
    found = tasks([OFF, PAPER], dataset, data, tmp_path, "ope", (None, shake))
    expected = [
        (entry.label, each, name)
        for entry in (OFF, PAPER)
        for each in (None, shake)
        for name in names
    ]
    assert [(task.label, task.shake, task.sequence) for task in found] == expected
    first, shaken = found[0], found[len(names)]
    name = names[0]
    assert first.results == tmp_path / "kcf-off"
    assert shaken.results == tmp_path / f"shake-{shake.label}" / "kcf-off"
    assert first.path == first.results / "unsupervised" / name / f"{name}_001.txt"
    assert first.failure == first.results / "failed" / "unsupervised" / f"{name}.log"
    assert first.identity == PLAIN
    assert (first.kind, first.protocol) == (dataset.kind, "ope")
    assert first.read().truth.tolist() != shaken.read().truth.tolist()


def test_paths_of_tasks_do_not_depend_on_the_working_folder(data, monkeypatch, tmp_path):
    monkeypatch.chdir(data.parent)
    task = tasks([OFF], open_dataset(data), Path(data.name), Path("out"))[0]
    assert task.dataset == data.resolve()
    assert task.out == data.parent.resolve() / "out"
    assert task.protocol == "vot"


def one_task(data, out, protocol="vot", shake=None):
    return tasks([OFF], open_dataset(data), data, out, protocol, (shake,))[0]


def test_a_run_writes_result_times_and_record(data, tmp_path):
    task = one_task(data, tmp_path)
    assert not task.is_finished
    task.failure.parent.mkdir(parents=True)
    task.failure.write_text("an earlier failure\n")
    result = run_task(task)
    assert task.is_finished
    assert not task.failure.exists()
    times = np.loadtxt(task.results / "times" / "baseline" / f"{task.sequence}.txt")
    assert result.seconds == pytest.approx(times.sum(), abs=1e-5)
    assert len(times) == 4
    assert (result.label, result.sequence, result.failed) == ("kcf-off", task.sequence, "")
    run = read_vot(task.path)
    assert result.frames == (run.status == 3).sum()
    assert read_identity(task.results) == PLAIN
    assert not (task.results / "ope").exists()
    assert not (tmp_path / "shake.json").exists()


def test_a_one_pass_run_writes_boxes_with_the_true_first_box(data, tmp_path):
    task = one_task(data, tmp_path, "ope")
    run_task(task)
    boxes = read_boxes(task.results / "ope" / f"{task.sequence}.txt").regions
    assert boxes[0] == pytest.approx(task.read().box(0), abs=1e-3)
    run = read_vot(task.path).regions
    assert boxes[1:] == pytest.approx(run[1:], abs=1e-3)


def test_results_under_shake_say_so(data, tmp_path):
    shake = Shake(0.02)
    task = one_task(data, tmp_path, shake=shake)
    assert run_task(task).shake == shake
    assert (tmp_path / f"shake-{shake.label}" / "shake.json").is_file()


def test_a_finished_run_is_read_with_its_overlap(data, tmp_path):
    task = one_task(data, tmp_path)
    truth = task.read().truth.copy()
    truth = truth if truth.shape[1] == 4 else truth[:, [0, 1, 4, 5]]
    shifted = truth + (0.5 * truth[:, 2:3] * (1, 0, 0, 0))
    run = Trajectory.from_regions(shifted)
    run.status[0] = 1
    run.status[3] = 2
    write_vot(task.path, run)
    (result,) = run_all([task])
    expected = TaskResult("kcf-off", task.sequence, 2, 1, result.overlap)
    assert result == expected
    assert result.overlap == pytest.approx(1 / 3, abs=1e-3)
    task.path.write_text("damaged\n")
    (result,) = run_all([task])
    assert "line 1: 'damaged' is not a line of numbers" in result.failed
    assert result.sequence == task.sequence
    assert np.isnan(result.overlap)


def test_a_failed_run_has_its_reason_in_a_file(data, tmp_path, monkeypatch):
    task = one_task(data, tmp_path)

    def broken(*arguments):
        raise RuntimeError("no\nluck \u00e9")

    monkeypatch.setattr(bench, "run", broken)
    result = run_task(task)
    assert result.failed.startswith("RuntimeError: no")
    assert "\n" not in result.failed
    text = task.failure.read_text()
    assert text == result.failed.replace("\u00e9", "\\xe9") + "\n"
    assert not task.is_finished
    assert (result.frames, result.lost, result.seconds) == (0, 0, 0)
    monkeypatch.undo()
    (again,) = run_all([task])
    assert again.failed == ""
    assert not task.failure.exists()


def test_one_job_runs_in_this_process(data, tmp_path):
    todo = tasks([OFF], open_dataset(data), data, tmp_path)
    assert all(isinstance(task, Task) for task in todo)
    assert [each.sequence for each in run_all(todo)] == [task.sequence for task in todo]
