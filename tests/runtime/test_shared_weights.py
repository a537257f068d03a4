"""Large pieces on OpenVINO: one cached file for both, and the fallback without a cache."""

import os
import shutil

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers.network_models import exported
from helpers.seeded_weights import noise_crop
from ssiam.errors import WeightsError
from ssiam.runtime import RuntimeOptions, loading
from ssiam.runtime.openvino import CORE

ALEX = "siamrpn_alex_dwxcorr"


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(loading, "_MIN_SHARED_BYTES", 1_000_000)
    return tmp_path / "cache" / "ssiam" / "openvino"


@pytest.fixture
def folder(tmp_path):
    return shutil.copytree(exported(ALEX), tmp_path / "exported")


def outputs(folder):
    loaded = loading.load_pieces(folder, ALEX, RuntimeOptions())
    return loaded["search"](noise_crop(2, 287), *loaded["template"](noise_crop(1, 127)))


def files(cache):
    return sorted(path.suffix for path in cache.iterdir())


def entry(cache, suffix):
    (path,) = cache.glob(f"*{suffix}")
    return path


def test_one_file_holds_the_weights_of_both_and_outputs_stay_the_same(folder, cache, monkeypatch):
    first, second = outputs(folder), outputs(folder)
    assert files(cache) == [".bin", ".xml"]
    size = sum(path.stat().st_size for path in folder.glob("*.onnx"))
    assert entry(cache, ".bin").stat().st_size < 0.8 * size
    shared = loading.load_pieces(folder, ALEX, RuntimeOptions())
    monkeypatch.setattr(loading, "_MIN_SHARED_BYTES", 1 << 40)
    separate = loading.load_pieces(folder, ALEX, RuntimeOptions())
    for piece, network in separate.items():
        assert network.input_shapes == shared[piece].input_shapes
        assert network.output_shapes == shared[piece].output_shapes
        assert network.convolution_count == shared[piece].convolution_count
    for expected, *others in zip(outputs(folder), first, second, strict=True):
        for other in others:
            np.testing.assert_array_equal(other, expected)


def readable(cache):
    return CORE.read_model(entry(cache, ".xml"))


@pytest.mark.parametrize("suffix", [".bin", ".xml"])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_damaged_entry_is_replaced(folder, cache, suffix, share):
    expected = outputs(folder)
    damaged = entry(cache, suffix)
    whole = damaged.read_bytes()
    damaged.unlink()
    damaged.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(RuntimeError):
        readable(cache)
    for actual, reference in zip(outputs(folder), expected, strict=True):
        np.testing.assert_array_equal(actual, reference)
    readable(cache)


def test_a_cache_folder_that_cannot_be_written(folder, cache):
    expected = outputs(folder)
    shutil.rmtree(cache)
    cache.write_text("in the way")
    for actual, reference in zip(outputs(folder), expected, strict=True):
        np.testing.assert_array_equal(actual, reference)


def test_changed_files_get_a_new_entry(folder, cache):
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
