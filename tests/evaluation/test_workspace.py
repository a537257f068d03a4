"""Workspace files, parsed as the official toolkit parses them."""

import configparser
import shlex
import sys

import pytest
import yaml

from helpers.vot_sequences import write_sequence
from ssiam.errors import ArgumentError, DatasetError, SinkError
from ssiam.evaluation.runs.entries import Entry
from ssiam.evaluation.vot.workspace import (
    _interval_for,
    _is_official,
    left_out,
    write_workspace,
)
from ssiam.stabilize import StabilizerConfig

OFF, PAPER = StabilizerConfig("off"), StabilizerConfig("paper")
ENTRIES = [Entry("csrt", OFF), Entry("kcf", PAPER)]


@pytest.fixture
def sequences(tmp_path):
    """Three sequences of 90, 100 and 110 frames, with empty images."""
    folder = tmp_path / "my data"
    for length, name in ((90, "ants"), (100, "bag"), (110, "car")):
        (folder / name).mkdir(parents=True)
        write_sequence(folder / name, length)
    (folder / "notes").mkdir()
    return folder


def registry(folder):
    config = configparser.ConfigParser()
    config.read(folder / "trackers.ini", encoding="utf-8")
    return config


def read_yaml(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def test_a_workspace_lists_external_sequences(sequences, tmp_path):
    folder = tmp_path / "ws"
    assert write_workspace(folder, ENTRIES, sequences=sequences) == 3
    assert read_yaml(folder / "config.yaml") == {
        "registry": ["./trackers.ini"],
        "stack": "./stack.yaml",
        "sequences": "sequences",
    }
    listed = (folder / "sequences" / "list.txt").read_text().splitlines()
    assert listed == [str(sequences / name) for name in ("ants", "bag", "car")]
    baseline = read_yaml(folder / "stack.yaml")["experiments"]["baseline"]
    assert baseline["type"] == "supervised"
    assert {"type": "supervised_eao_score", "low": 20, "high": 60} in baseline["analyses"]


def test_commands_use_this_interpreter_and_absolute_paths(sequences, tmp_path):
    weights = tmp_path / "100% of it" / "nano"
    entries = [*ENTRIES, Entry("nanotrack_v2", OFF, weights)]
    write_workspace(tmp_path / "ws", entries, sequences=sequences)
    trackers = registry(tmp_path / "ws")
    assert trackers.sections() == ["csrt-off", "kcf-paper", "nanotrack_v2-off"]
    for entry in entries:
        section = trackers[entry.label]
        assert section["protocol"] == "trax"
        words = shlex.split(section["command"])
        assert words[:4] == [sys.executable, "-m", "ssiam", "trax"]
        assert words[4:8] == ["--tracker", entry.tracker, "--stabilize", entry.config.stabilize]
        assert words[8:] == (["--weights", str(weights)] if entry.weights else [])


def test_an_official_stack_leaves_its_sequences_to_the_toolkit(tmp_path):
    assert write_workspace(tmp_path, ENTRIES, stack="vot2018/shortterm") == 0
    assert read_yaml(tmp_path / "config.yaml")["stack"] == "vot2018/shortterm"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["config.yaml", "trackers.ini"]


def test_a_stack_file_is_copied(sequences, tmp_path):
    (tmp_path / "own.yaml").write_text("title: Größer\n", encoding="utf-8")
    folder = tmp_path / "ws"
    write_workspace(folder, ENTRIES, stack=str(tmp_path / "own.yaml"), sequences=sequences)
    assert read_yaml(folder / "config.yaml")["stack"] == "./stack.yaml"
    assert read_yaml(folder / "stack.yaml") == {"title": "Größer"}


def test_sequences_inside_of_the_workspace(sequences, tmp_path):
    folder = tmp_path / "ws"
    folder.mkdir()
    sequences.rename(folder / "sequences")
    assert write_workspace(folder, ENTRIES) == 3
    listed = folder / "sequences" / "list.txt"
    assert listed.read_text() == "ants\nbag\ncar\n"
    listed.write_text("bag\n")
    assert write_workspace(folder, ENTRIES, force=True) == 1
    assert listed.read_text() == "bag\n"


@pytest.mark.parametrize(
    "name", ["config.yaml", "stack.yaml", "trackers.ini", "sequences/list.txt"]
)
def test_existing_files_are_replaced_only_with_force(sequences, tmp_path, name):
    path = tmp_path / "ws" / name
    path.parent.mkdir(parents=True)
    path.write_text("existing")
    with pytest.raises(SinkError, match=r"exists already: give --force"):
        write_workspace(tmp_path / "ws", ENTRIES, sequences=sequences)
    assert path.read_text() == "existing"
    assert [each for each in (tmp_path / "ws").rglob("*") if each.is_file()] == [path]
    write_workspace(tmp_path / "ws", ENTRIES, sequences=sequences, force=True)
    assert path.read_text() != "existing"


def test_missing_inputs_are_errors(sequences, tmp_path):
    folder = tmp_path / "ws"
    with pytest.raises(DatasetError, match=r"ws.sequences: is not a folder"):
        write_workspace(folder, ENTRIES)
    with pytest.raises(DatasetError, match="contains no VOT sequence"):
        write_workspace(folder, ENTRIES, sequences=sequences / "notes")
    with pytest.raises(ArgumentError, match=r"stack missing\.yaml is not a file"):
        write_workspace(folder, ENTRIES, stack="missing.yaml", sequences=sequences)
    (sequences / "list.txt").write_text("ants\nmissing\n")
    with pytest.raises(DatasetError, match=r"missing: has no groundtruth\.txt"):
        write_workspace(folder, ENTRIES, sequences=sequences)
    assert not folder.exists()


def test_a_folder_that_cannot_be_created(sequences, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SinkError, match="cannot be written"):
        write_workspace(tmp_path / "file" / "ws", ENTRIES, sequences=sequences)


@pytest.mark.parametrize(
    ("lengths", "interval"), [([90], (20, 60)), ([400, 9], (2, 6)), ([1], (1, 1))]
)
def test_the_interval_fits_the_shortest_sequence(lengths, interval):
    assert _interval_for(lengths) == interval


def test_the_stack_of_a_supervised_run(sequences, tmp_path):
    write_workspace(tmp_path / "ws", ENTRIES, sequences=sequences)
    assert read_yaml(tmp_path / "ws" / "stack.yaml") == {
        "title": "Supervised runs",
        "experiments": {
            "baseline": {
                "type": "supervised",
                "repetitions": 1,
                "skip_initialize": 5,
                "analyses": [
                    {"type": "supervised_average_ar", "sensitivity": 30},
                    {"type": "supervised_eao_score", "low": 20, "high": 60},
                    {"type": "supervised_eao_curve"},
                ],
            }
        },
    }


def test_sections_of_the_registry(sequences, tmp_path):
    write_workspace(tmp_path / "ws", ENTRIES, sequences=sequences)
    for name, section in registry(tmp_path / "ws").items():
        if name != "DEFAULT":
            assert list(section) == ["label", "protocol", "command", "timeout"]
            assert (section["label"], section["timeout"]) == (name, "60")


@pytest.mark.parametrize(
    ("stack", "official"),
    [
        ("vot2018/shortterm", True),
        ("tests", True),
        ("vot2018/a/b", False),
        ("VOT2018", False),
        ("own.yaml", False),
        ("/vot2018", False),
        ("", False),
    ],
)
def test_names_of_official_stacks(stack, official, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert _is_official(stack) is official
    (tmp_path / "tests").touch()
    assert not _is_official("tests"), "a file of this name"


def test_an_official_stack_may_run_on_ones_own_sequences(sequences, tmp_path):
    folder = tmp_path / "ws"
    assert write_workspace(folder, ENTRIES, stack="vot2018", sequences=sequences) == 3
    assert not (folder / "stack.yaml").exists()
    assert len((folder / "sequences" / "list.txt").read_text().splitlines()) == 3
    inside = tmp_path / "inside"
    inside.mkdir()
    sequences.rename(inside / "sequences")
    assert write_workspace(inside, ENTRIES, stack="vot2018") == 3


def test_folders_that_are_left_out_have_a_reason(sequences, tmp_path):
    (sequences / ".hidden").mkdir()
    (sequences / "file.txt").touch()
    (sequences / "empty").mkdir()
    (sequences / "empty" / "groundtruth.txt").touch()
    first, second = left_out(tmp_path / "ws", sequences)
    assert first.startswith("empty: left out, ")
    assert "\n" not in first
    assert second == "notes: left out, has no groundtruth.txt"
    listed = sequences / "list.txt"
    listed.write_text("bag\n\n  car \n")
    assert left_out(tmp_path / "ws", sequences) == [
        f"{name}: left out, not in {listed}" for name in ("ants", "empty", "notes")
    ]
    assert left_out(tmp_path / "ws") == []
    (tmp_path / "ws").mkdir()
    sequences.rename(tmp_path / "ws" / "sequences")
    assert [line.partition(":")[0] for line in left_out(tmp_path / "ws")] == [
        *("ants", "empty", "notes")
    ]


def test_a_list_in_the_sequences_folder_decides(sequences, tmp_path):
    (sequences / "list.txt").write_text("bag\n\n  car \n")
    assert write_workspace(tmp_path / "ws", ENTRIES, sequences=sequences) == 2
    listed = (tmp_path / "ws" / "sequences" / "list.txt").read_text().splitlines()
    assert listed == [str(sequences / "bag"), str(sequences / "car")]


@pytest.mark.parametrize("name", ["a" * 300, "a\0b", "bag/groundtruth.txt/x"])
def test_a_list_with_a_name_that_no_folder_has(sequences, tmp_path, name):
    (sequences / "list.txt").write_text(f"{name}\n")
    for read in (left_out, lambda path, given: write_workspace(path, [], sequences=given)):
        with pytest.raises(DatasetError, match=r"list\.txt: names '[^\n]{1,50}' \("):
            read(tmp_path, sequences)


def test_damaged_sequences_are_left_out_unless_all_are(sequences, tmp_path):
    (sequences / "bag" / "groundtruth.txt").write_text("x\n")
    assert write_workspace(tmp_path / "ws", ENTRIES, sequences=sequences) == 2
    (sequences / "list.txt").write_text("bag\n")
    with pytest.raises(DatasetError, match="bag"):
        write_workspace(tmp_path / "other", ENTRIES, sequences=sequences)
    (sequences / "list.txt").unlink()
    for name in ("ants", "car"):
        (sequences / name / "groundtruth.txt").write_text("x\n")
    with pytest.raises(DatasetError, match="ants"):
        write_workspace(tmp_path / "other", ENTRIES, sequences=sequences)


def test_inputs_are_not_replaced(sequences, tmp_path):
    folder = tmp_path / "ws"
    folder.mkdir()
    (folder / "stack.yaml").write_text("title: mine\n")
    stack = str(folder / "stack.yaml")
    for options in (
        {"stack": stack, "sequences": sequences},
        {"sequences": sequences, "entries": [Entry("siamfc", OFF, folder / "stack.yaml")]},
    ):
        entries = options.pop("entries", ENTRIES)
        with pytest.raises(ArgumentError):
            write_workspace(folder, entries, force=True, **options)
    assert (folder / "stack.yaml").read_text() == "title: mine\n"


@pytest.mark.parametrize("length", [2, 3, 9, 10, 100])
def test_ends_of_the_interval_are_two_ninths_and_two_thirds(length):
    expected = max(1, round(length * 2 / 9)), max(1, round(length * 2 / 3))
    assert _interval_for([length, 200]) == expected
