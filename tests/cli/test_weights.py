"""`ssiam weights`: list, import, export, and errors for other files."""

import json

import pytest

from ssiam.cli import main
from ssiam.runtime import MODEL_ZOO

ALEX = "siamrpn_alex_dwxcorr"


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "cache" / "ssiam" / "weights"


@pytest.fixture
def models():
    pytest.importorskip("torch")
    pytest.importorskip("onnx")
    from helpers import network_models as models

    return models


def test_list_shows_where_weights_are_published(capsys):
    assert main(["weights", "list"]) == 0
    out = capsys.readouterr().out
    for tracker, publication in MODEL_ZOO.items():
        assert f"{tracker}: not available" in out
        assert f"{publication.file} at {publication.source}" in out
    assert "size about 9.4 MB, license MIT" in out
    assert "size unknown, license CC BY-SA 3.0" in out


def test_imported_weights_are_listed_and_can_be_imported_again(models, cache, tmp_path, capsys):
    assert main(["weights", "import", str(models.checkpoint(ALEX))]) == 0
    out = capsys.readouterr().out
    assert f": {ALEX}\n" in out
    assert f"stored in {cache / ALEX}" in out
    assert main(["weights", "list"]) == 0
    assert f"{ALEX}: {cache / ALEX} ({ALEX}.pth, ONNX f32)" in capsys.readouterr().out
    other = tmp_path / "other"
    assert main(["weights", "import", str(cache / ALEX), "--folder", str(other)]) == 0
    capsys.readouterr()
    assert main(["weights", "list", "--folder", str(other)]) == 0
    assert f"{ALEX}: {other / ALEX} (ONNX f32)" in capsys.readouterr().out


def test_export_is_named_after_the_tracker(models, tmp_path, capsys):
    file = str(models.checkpoint("siamfc"))
    assert main(["weights", "export", "siamfc", file]) == 0
    assert capsys.readouterr().out == f"{file}: siamfc, f32, written to weights/siamfc\n"
    names = {path.name for path in (tmp_path / "weights" / "siamfc").iterdir()}
    assert names == {"template.onnx", "search.onnx", "network.json"}
    record = json.loads((tmp_path / "weights" / "siamfc" / "network.json").read_text())
    assert (record["name"], record["network"], record["precision"]) == ("siamfc", "siamfc", "f32")
    assert main(["weights", "list"]) == 0
    assert "siamfc: weights/siamfc (ONNX f32)" in capsys.readouterr().out


def test_int8_with_a_folder_of_images(models, tmp_path, monkeypatch):
    import cv2

    from helpers.synthetic import golden_video

    pytest.importorskip("onnxruntime")
    monkeypatch.setattr("ssiam.runtime.quantization._CROPS", 2)
    for number, frame in enumerate(golden_video("A", 3)[0]):
        cv2.imwrite(str(tmp_path / f"{number:03d}.png"), frame)
    arguments = ["weights", "export", "siamfc", str(models.checkpoint("siamfc")), "--out", "eight"]
    more = ["--precision", "int8", "--pictures", str(tmp_path)]
    assert main([*arguments, *more]) == 0
    record = json.loads((tmp_path / "eight" / "siamfc" / "network.json").read_text())
    assert record["precision"] == "int8"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param(["export", "csrt", "FILE"], "unknown tracker to export", id="no network"),
        pytest.param(["export", ALEX, "FILE"], f"those of siamfc, not of {ALEX}", id="another"),
        pytest.param(["export", "siamfc"], "siamfc: give the authors' .pth file", id="no file"),
        pytest.param(["export", "siamfc", "missing.pth"], "missing.pth do not exist", id="absent"),
        pytest.param(
            ["export", "siamfc", "FILE", "--precision", "int8"], "needs images", id="no pictures"
        ),
        pytest.param(
            ["import", "FILE", "--tracker", ALEX], f"siamfc, but {ALEX} has", id="wrong tracker"
        ),
        pytest.param(["import", "page.pth"], "are a web page", id="html"),
        pytest.param(["import", "x.onnx"], "ONNX without a network.json", id="onnx"),
    ],
)
def test_wrong_arguments_give_one_line_error(models, tmp_path, capsys, arguments, message):
    (tmp_path / "page.pth").write_text("<html>")
    (tmp_path / "x.onnx").write_bytes(b"\x08")
    words = [str(models.checkpoint("siamfc")) if each == "FILE" else each for each in arguments]
    assert main(["weights", *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_network_without_a_tracker_is_refused(models, tmp_path, capsys):
    from helpers.network_files import constant_state, save_checkpoint

    file = save_checkpoint(tmp_path / "base.pth", constant_state("SiamMask_foolwood_base"))
    assert main(["weights", "import", str(file)]) == 2
    assert "siammask_base, which no tracker uses" in capsys.readouterr().err
