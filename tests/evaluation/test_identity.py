"""Results belong to the weights and the runtime that made them."""

import json
import shutil

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.datasets import open_dataset
from ssiam.errors import WeightsError
from ssiam.evaluation.paper.summary import parse_label, parse_variant, summarize
from ssiam.evaluation.runs.entries import Entry, entries
from ssiam.evaluation.runs.identity import RECORD, Identity
from ssiam.runtime import RuntimeOptions
from ssiam.runtime.files import sha256, weights_sha256
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers.lite import SHIPPED

OFF = StabilizerConfig("off")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"), sequences=1, frames=4)


@pytest.fixture
def weights(tmp_path):
    ignore = shutil.ignore_patterns("mask.pth")  # for further training, not for PyTorch
    return shutil.copytree(SHIPPED, tmp_path / "weights", ignore=ignore)


def alter(weights):
    """Replace the weights by other ones: a file with another comment is another file."""
    with (weights / "search.onnx").open("ab") as file:
        file.write(b"\x32\x01x")  # protobuf field 6, doc_string


def bench(dataset, out, *more):
    command = ["bench", dataset, "--out", out, "--stabilize", "off", *more]
    return main([str(word) for word in command])


def folders(out):
    return sorted(path.name for path in out.iterdir())


def test_other_weights_in_the_same_folder_are_run_again(dataset, weights, tmp_path, capsys):
    out, more = tmp_path / "out", ("--trackers", "lite", "--weights", f"lite={weights}")
    assert bench(dataset, out, *more) == 0
    first = weights_sha256(weights)
    assert json.loads((out / "lite-off" / RECORD).read_text())["weights_sha256"] == first
    alter(weights)
    second = weights_sha256(weights)
    assert second != first
    for _ in range(2):  # the second time nothing is left to do
        assert bench(dataset, out, *more) == 0
        assert folders(out) == ["lite-off", f"lite-off-weights={second[:12]}"]
    record = json.loads((out / folders(out)[1] / RECORD).read_text())
    assert record["weights_sha256"] == second
    assert "lite-off-weights=" in capsys.readouterr().out
    assert json.loads((out / "lite-off" / RECORD).read_text())["weights_sha256"] == first


def test_missing_weights_never_show_earlier_numbers(dataset, weights, tmp_path, capsys):
    more = ("--trackers", "lite", "--weights", f"lite={weights}")
    assert bench(dataset, tmp_path / "out", *more) == 0
    weights.rename(tmp_path / "elsewhere")
    assert bench(dataset, tmp_path / "out", *more) == 3
    assert "1 of 1 runs have no result" in capsys.readouterr().err


def test_results_of_earlier_versions_stay_readable(dataset, tmp_path, capsys):
    out = tmp_path / "out"
    assert bench(dataset, out, "--trackers", "kcf,lite") == 0
    times = {}
    for name in ("kcf-off", "lite-off"):
        (out / name / RECORD).unlink()
        (path,) = (out / name).glob("baseline/*/*_001.txt")
        times[path] = path.stat().st_mtime_ns
    capsys.readouterr()
    found = summarize(out, open_dataset(dataset))
    assert [each.tracker for each in found.entries] == ["kcf", "lite"]
    # Nobody knows which weights made lite's.
    assert bench(dataset, out, "--trackers", "kcf,lite") == 0
    digits = weights_sha256(SHIPPED)[:12]
    assert folders(out) == ["kcf-off", "lite-off", f"lite-off-weights={digits}"]
    assert {path: path.stat().st_mtime_ns for path in times} == times


def test_each_runtime_has_a_folder_and_a_row(dataset, tmp_path):
    pytest.importorskip("onnxruntime")
    out = tmp_path / "out"
    assert bench(dataset, out, "--trackers", "kcf,lite") == 0
    assert bench(dataset, out, "--trackers", "kcf,lite", "--runtime", "onnxruntime") == 0
    assert bench(dataset, out, "--trackers", "lite", "--threads", "2") == 0
    names = ["kcf-off", "lite-off", "lite-off-runtime=onnxruntime", "lite-off-threads=2"]
    assert folders(out) == names
    found = summarize(out, open_dataset(dataset))
    rows = ["kcf", "lite", "lite (runtime=onnxruntime)", "lite (threads=2)"]
    assert [each.tracker for each in found.entries] == rows
    assert all(found.find(row, OFF) is not None for row in rows)


def test_a_runtime_without_the_device_is_refused(dataset, tmp_path, capsys):
    assert bench(dataset, tmp_path / "out", "--trackers", "lite", "--device", "cuda") == 2
    assert "runtime openvino has no device 'cuda'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_altered_record_is_not_overwritten(dataset, tmp_path, capsys):
    out = tmp_path / "out"
    assert bench(dataset, out, "--trackers", "kcf") == 0
    record = out / "kcf-off" / RECORD
    whole = record.read_text()
    record.write_text(whole.replace('"threads": 1', '"threads": 8'))
    assert bench(dataset, out, "--trackers", "kcf") == 3
    assert "holds results of threads 8, not 1" in capsys.readouterr().err
    record.write_text(whole[:-5])
    assert bench(dataset, out, "--trackers", "kcf") == 2
    error = capsys.readouterr().err
    assert f"{record}: not as written by ssiam bench" in error
    assert error.count("\n") == 1


def test_labels_have_the_runtime_and_are_parsed_without_it():
    options = RuntimeOptions("torch", 4, "f16", "cuda")
    entry = Entry("siamfc", StabilizerConfig("paper").with_options(window=9), None, options)
    runtime = "runtime=torch-device=cuda-precision=f16-threads=4"
    assert entry.label == f"siamfc-paper-window=9-{runtime}"
    label = f"{entry.label}-weights=0123456789ab"
    assert parse_label(label) == ("siamfc", entry.config)
    assert parse_variant(label) == f"{runtime.replace('-', ', ')}, weights=0123456789ab"
    assert parse_variant("kcf-paper-window=9") == ""


def test_trackers_without_networks_take_only_the_threads():
    options = RuntimeOptions("torch", 4, "f16", "cuda")
    assert [each.label for each in entries(["mil"], ["off"], {}, options)] == ["mil-off-threads=4"]


def test_labels_have_the_template_memory_and_distractors():
    entry = Entry("lite", OFF, template_memory=True, distractors=False)
    assert entry.label == "lite-off-template_memory=True-distractors=False"
    assert parse_label(entry.label) == ("lite", OFF)
    assert parse_variant(entry.label) == "template_memory=True, distractors=False"
    assert Entry("siamfc", OFF, distractors=True).label == "siamfc-off-distractors=True"


def test_distractors_as_by_default_do_not_change_the_label():
    assert Entry("lite", OFF, distractors=True).label == "lite-off"
    assert Entry("siamfc", OFF, distractors=False).label == "siamfc-off"


def test_trackers_without_networks_have_neither_memory_nor_distractors():
    both = entries(["kcf", "lite"], ["off"], {}, template_memory=True, distractors=False)
    assert [each.label for each in both] == [
        "kcf-off",
        "lite-off-template_memory=True-distractors=False",
    ]


def test_labels_have_settings_that_are_on_or_off():
    config = StabilizerConfig("paper").with_options(spread=False)
    entry = Entry("kcf", config)
    assert entry.label == "kcf-paper-spread=False"
    assert parse_label(entry.label) == ("kcf", config)
    assert parse_label("kcf-paper-spread=maybe") is None


def test_the_digest_is_of_the_files_that_the_runtime_reads(weights, tmp_path):
    checkpoint = tmp_path / "model.pth"
    checkpoint.write_bytes(b"weights")
    assert weights_sha256(checkpoint) == sha256(checkpoint)
    before = weights_sha256(weights), weights_sha256(weights, "torch")
    assert before[1] == sha256(weights / "weights.pth")
    assert weights_sha256(weights / "search.onnx") == before[0]
    alter(weights)
    assert weights_sha256(weights) != before[0]
    assert weights_sha256(weights, "torch") == before[1]
    assert Identity.of(Entry("lite", OFF, tmp_path / "missing")).weights_sha256 is None
    (tmp_path / "empty").mkdir()
    with pytest.raises(WeightsError, match=r"holds no \.onnx and no \.pth file"):
        weights_sha256(tmp_path / "empty")


def test_a_search_continues_only_with_the_same_weights(dataset, weights, tmp_path, capsys):
    pytest.importorskip("optuna")
    command = ["tune", str(dataset), "--trackers", "lite", "--weights", f"lite={weights}"]
    command += ["--out", str(tmp_path / "out"), "--trials", "1", "--parameter", "margin=0:1"]
    assert main([*command, "--threads", "2"]) == 0
    assert any(line.endswith("--threads 2") for line in capsys.readouterr().out.splitlines())
    assert main(command) == 2
    assert "belongs to a search with other runtime" in capsys.readouterr().err
    alter(weights)
    assert main([*command, "--threads", "2"]) == 2
    assert "belongs to a search with other weights" in capsys.readouterr().err


def test_an_entry_loads_its_weights_and_its_runtime_options(weights, tmp_path):
    tracker = Entry("lite", OFF, weights, RuntimeOptions(threads=2)).load()
    assert tracker.config == OFF
    with pytest.raises(WeightsError, match="missing"):
        Entry("lite", OFF, tmp_path / "missing").load()
