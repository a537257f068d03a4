"""``shake.json``: where it is, where it is searched, and which contents are refused."""

import json
import os

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.datasets import Shake, open_dataset
from ssiam.evaluation.runs import shaken_results
from ssiam.evaluation.runs.result_files import ResultsError
from ssiam.evaluation.runs.shaken_results import (
    read_shake,
    shaken_as,
    shaken_folder,
    write_shake,
)

SHAKE = Shake(0.03, "gusts", 7, exposure=0.5, readout=0.25, border="crop")
GOOD = {"strength": 0.03, "kind": "white", "seed": 0, "exposure": 0, "readout": 0, "border": "crop"}
NOT_WRITTEN = "not as written by ssiam bench; restore it, or run the benchmark again"


def test_a_shake_has_its_own_folder_of_results(tmp_path):
    assert shaken_folder(tmp_path, None) == tmp_path
    assert shaken_folder(tmp_path, SHAKE) == tmp_path / f"shake-{SHAKE.label}"


def test_the_written_shake_is_read(tmp_path):
    assert read_shake(tmp_path) is None
    write_shake(tmp_path, SHAKE)
    assert [path.name for path in tmp_path.iterdir()] == ["shake.json"]
    assert set(json.loads((tmp_path / "shake.json").read_text())) == set(GOOD)
    assert read_shake(tmp_path) == SHAKE


@pytest.mark.parametrize("kind", ["baseline", "realtime", "unsupervised", "ope"])
def test_a_trackers_folder_has_the_shake_of_the_folder_above(tmp_path, kind, monkeypatch):
    write_shake(tmp_path, SHAKE)
    (tmp_path / "kcf-off" / kind).mkdir(parents=True)
    (tmp_path / "other").mkdir()
    assert read_shake(tmp_path / "kcf-off") == SHAKE
    assert read_shake(tmp_path / "other") is None
    monkeypatch.chdir(tmp_path / "kcf-off")
    assert read_shake(shaken_results.Path()) == SHAKE


def test_a_shake_in_the_trackers_folder_comes_first(tmp_path):
    write_shake(tmp_path, SHAKE)
    (tmp_path / "kcf-off" / "baseline").mkdir(parents=True)
    write_shake(tmp_path / "kcf-off", Shake(0.01))
    assert read_shake(tmp_path / "kcf-off") == Shake(0.01)


def test_the_dataset_is_shaken_like_the_results(tmp_path):
    data = open_dataset(write_dataset(tmp_path / "data", sequences=1, frames=3))
    assert shaken_as(tmp_path, data) is data
    write_shake(tmp_path, SHAKE)
    found = shaken_as(tmp_path, data)
    (name,) = data.sequences
    assert found.sequences[name].truth.tolist() != data.sequences[name].truth.tolist()


def written(folder, text):
    (folder / "shake.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


@pytest.mark.parametrize("name", ["strength", "exposure", "readout"])
@pytest.mark.parametrize("value", [0, 0.25, 1])
def test_whole_and_fractional_numbers_are_numbers(tmp_path, name, value):
    assert getattr(read_shake(written(tmp_path, json.dumps({**GOOD, name: value}))), name) == value


@pytest.mark.parametrize(
    "values",
    [
        *({**GOOD, name: "0.1"} for name in ("strength", "exposure", "readout", "seed")),
        *({**GOOD, name: True} for name in GOOD),
        *({**GOOD, name: None} for name in GOOD),
        *({**GOOD, name: 1} for name in ("kind", "border")),
        {**GOOD, "seed": 1.0},
        {name: value for name, value in GOOD.items() if name != "border"},
        {**GOOD, "angle": 3},
        [0.03],
        None,
        *list(GOOD),
    ],
    ids=str,
)
def test_fields_of_other_names_or_types_are_refused(tmp_path, values):
    with pytest.raises(ResultsError) as caught:
        read_shake(written(tmp_path, json.dumps(values)))
    assert str(caught.value) == f"{tmp_path / 'shake.json'}: {NOT_WRITTEN}"


@pytest.mark.parametrize("text", [b"", b"\xff\xfe", b"{", b"[" * 500, "\u00e9".encode()])
def test_damaged_files_are_refused(tmp_path, text):
    with pytest.raises(ResultsError) as caught:
        read_shake(written(tmp_path, text))
    assert str(caught.value) == f"{tmp_path / 'shake.json'}: {NOT_WRITTEN}"


def test_a_file_of_at_most_512_bytes_is_read(tmp_path):
    text = json.dumps(GOOD)
    assert read_shake(written(tmp_path, text.ljust(512))) == Shake(0.03, border="crop")
    with pytest.raises(ResultsError, match=NOT_WRITTEN):
        read_shake(written(tmp_path, text.ljust(513)))


def test_values_out_of_range_are_named(tmp_path):
    path = tmp_path / "shake.json"
    with pytest.raises(ResultsError) as caught:
        read_shake(written(tmp_path, json.dumps({**GOOD, "kind": "sway"})))
    assert str(caught.value).startswith(f"{path}: ")
    assert "'sway'" in str(caught.value)


def test_an_unreadable_file_is_named_with_the_reason(tmp_path, monkeypatch):
    write_shake(tmp_path, SHAKE)

    def broken(path, mode="r"):
        raise OSError(5, os.strerror(5))

    monkeypatch.setattr(shaken_results.Path, "open", broken)
    with pytest.raises(ResultsError) as caught:
        read_shake(tmp_path)
    expected = f"{tmp_path / 'shake.json'}: cannot be read ({os.strerror(5)})"
    assert str(caught.value) == expected
