"""Large pieces on OpenVINO: one file of both in the cache folder, and what it is when it fails."""

import os
import shutil

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers.network_models import exported
from helpers.seeded_weights import crop
from ssiam.errors import WeightsError
from ssiam.runtime import RuntimeOptions
from ssiam.runtime import loading as pieces
from ssiam.runtime.openvino import CORE

ALEX = "siamrpn_alex_dwxcorr"


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(pieces, "_MIN_SHARED_BYTES", 1_000_000)
    return tmp_path / "cache" / "ssiam" / "openvino"


@pytest.fixture
def folder(tmp_path):
    return shutil.copytree(exported(ALEX), tmp_path / "exported")


def outputs(folder):
    loaded = pieces.load_pieces(folder, ALEX, RuntimeOptions())
    return loaded["search"](crop(2, 287), *loaded["template"](crop(1, 127)))


def files(cache):
    return sorted(path.suffix for path in cache.iterdir())


def entry(cache, suffix):
    (path,) = cache.glob(f"*{suffix}")
    return path


def test_one_file_has_the_weights_of_both_and_nothing_else_changes(folder, cache, monkeypatch):
    first, second = outputs(folder), outputs(folder)
    assert files(cache) == [".bin", ".xml"]
    size = sum(path.stat().st_size for path in folder.glob("*.onnx"))
    assert entry(cache, ".bin").stat().st_size < 0.8 * size
    found = pieces.load_pieces(folder, ALEX, RuntimeOptions())
    monkeypatch.setattr(pieces, "_MIN_SHARED_BYTES", 1 << 40)
    alone = pieces.load_pieces(folder, ALEX, RuntimeOptions())
    for piece, network in alone.items():
        assert network.input_shapes == found[piece].input_shapes
        assert network.output_shapes == found[piece].output_shapes
        assert network.convolution_count == found[piece].convolution_count
    for expected, *others in zip(outputs(folder), first, second, strict=True):
        for other in others:
            np.testing.assert_array_equal(other, expected)


def readable(cache):
    return CORE.read_model(entry(cache, ".xml"))


@pytest.mark.parametrize("suffix", [".bin", ".xml"])
@pytest.mark.parametrize("left", [0.0, 0.5])
def test_a_damaged_entry_is_written_again(folder, cache, suffix, left):
    expected = outputs(folder)
    damaged = entry(cache, suffix)
    whole = damaged.read_bytes()
    damaged.unlink()
    damaged.write_bytes(whole[: int(left * len(whole))])
    with pytest.raises(RuntimeError):
        readable(cache)
    for found, each in zip(outputs(folder), expected, strict=True):
        np.testing.assert_array_equal(found, each)
    readable(cache)


def test_a_cache_folder_that_cannot_be_written(folder, cache):
    expected = outputs(folder)
    shutil.rmtree(cache)
    cache.write_text("in the way")
    for found, each in zip(outputs(folder), expected, strict=True):
        np.testing.assert_array_equal(found, each)


def test_changed_files_are_read_anew(folder, cache):
    outputs(folder)
    search = folder / "search.onnx"
    os.utime(search, (0, 0))
    outputs(folder)
    assert files(cache) == [".bin", ".bin", ".xml", ".xml"]
    search.write_bytes(search.read_bytes()[:2_000_000])
    with pytest.raises(WeightsError, match=r"search.onnx cannot be read: the file is damaged"):
        outputs(folder)
    search.write_text("<html>" * 400_000)
    with pytest.raises(WeightsError, match=r"search.onnx are a web page"):
        outputs(folder)
    assert files(cache) == [".bin", ".bin", ".xml", ".xml"]
