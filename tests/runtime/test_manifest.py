"""`atomic_export`: a folder holds the older network or the newer one, whole."""

import json

import pytest

from ssiam.errors import SinkError, WeightsError
from ssiam.runtime.manifest import Manifest, atomic_export, leftover_exports

FILES = ("search.onnx", "template.onnx", "weights.pth")


def _export(folder, text, error=None):
    with atomic_export(folder, beside=("weights.pth",)) as temporary:
        assert list(temporary.iterdir()) == []
        assert leftover_exports(folder) == [temporary]
        for name in FILES:
            (temporary / name).write_text(text)
        (temporary / "search-f32.onnx").write_text("an intermediate file")
        if error is not None:
            raise error
        Manifest("lite", text, "0" * 64, ("template", "search")).write(temporary)


def _content(folder):
    names = {path.name for path in folder.iterdir()}
    assert names == {*FILES, "network.json"}
    return {Manifest.read(folder).network, *((folder / name).read_text() for name in FILES)}


def test_an_export_replaces_the_older_one(tmp_path):
    folder = tmp_path / "new" / "folder"
    _export(folder, "first")
    assert _content(folder) == {"first"}
    _export(folder, "second")
    assert _content(folder) == {"second"}


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (OSError(28, "No space left on device"), SinkError),
        (WeightsError("differs"), WeightsError),
        (KeyboardInterrupt(), KeyboardInterrupt),
    ],
    ids=["full disk", "check", "Ctrl-C"],
)
def test_an_error_keeps_the_older_export(tmp_path, error, raised):
    _export(tmp_path, "first")
    with pytest.raises(raised):
        _export(tmp_path, "second", error)
    assert _content(tmp_path) == {"first"}


def test_a_missing_piece_keeps_the_older_export(tmp_path):
    def export_without_pieces():
        with atomic_export(tmp_path) as temporary:
            Manifest("lite", "second", "0" * 64, ("template", "search")).write(temporary)

    _export(tmp_path, "first")
    with pytest.raises(SinkError):
        export_without_pieces()
    assert _content(tmp_path) == {"first"}


VALID = {"name": "siamfc", "network": "siamfc", "sha256": "0" * 64, "pieces": ["template"]}


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(json.dumps(VALID | {"network": ["siamfc"]}), id="list"),
        pytest.param(json.dumps(VALID | {"pieces": ["a\0b"]}), id="NUL"),
        pytest.param(json.dumps(VALID | {"pieces": ["../../secret"]}), id="other folder"),
        pytest.param(json.dumps(VALID | {"pieces": "template"}), id="letters"),
        pytest.param(json.dumps(VALID | {"pieces": [["a"]]}), id="list of lists"),
        pytest.param(json.dumps(VALID | {"opset": True}), id="flag"),
        pytest.param(json.dumps(VALID | {"precision": "f8"}), id="unknown precision"),
        pytest.param(json.dumps(VALID | {"extra": 1}), id="other field"),
        pytest.param(json.dumps({"pieces": []}), id="missing fields"),
        pytest.param("[" * 200_000, id="deep"),
        pytest.param('{"opset": ' + "9" * 5000 + "}", id="digits"),
        pytest.param(b"\xff\xff", id="no text"),
        pytest.param("null", id="null"),
    ],
)
def test_a_damaged_manifest_is_one_line(tmp_path, text):
    (tmp_path / "network.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(WeightsError, match=r"network\.json is damaged \([^\n]+\): export"):
        Manifest.read(tmp_path)
    (tmp_path / "network.json").write_text(json.dumps(VALID))
    assert Manifest.read(tmp_path).pieces == ("template",)
