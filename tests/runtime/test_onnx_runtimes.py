"""OpenVINO and ONNX Runtime on NanoTrack's ONNX files: agreement, errors and caching."""

import logging
import shutil
from pathlib import Path

import numpy as np
import pytest

from ssiam.errors import ArgumentError, WeightsError
from ssiam.runtime import load_network
from ssiam.runtime import openvino as openvino_runtime

RUNTIMES = ["openvino", "onnxruntime"]


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "ssiam" / "openvino"


@pytest.fixture
def backbone(shared, tmp_path):
    """A copy, which other tests have not loaded before."""
    path = shared("data/weights/nanotrackv2/nanotrack_backbone_sim.onnx")
    return Path(shutil.copy(path, tmp_path / path.name))


@pytest.mark.parametrize("side", [None, 127])
def test_the_runtimes_agree(backbone, side):
    pytest.importorskip("onnxruntime")
    shape = None if side is None else (1, 3, side, side)
    openvino, onnxruntime = (load_network(backbone, shape, runtime=each) for each in RUNTIMES)
    assert openvino.input_shapes == onnxruntime.input_shapes == [(1, 3, side or 255, side or 255)]
    assert openvino.output_shapes == onnxruntime.output_shapes
    assert openvino.convolution_count == onnxruntime.convolution_count
    crop = np.random.default_rng(0).integers(0, 256, openvino.input_shapes[0]).astype(np.float32)
    (a,), (b,) = openvino(crop), onnxruntime(crop)
    assert a.dtype == b.dtype == np.float32
    assert abs(a - b).max() < 1e-4 * abs(b).max()


def test_inputs_of_any_layout_are_taken(backbone):
    network = load_network(backbone, (1, 3, 127, 127))
    crop = np.random.default_rng(0).uniform(0, 255, (1, 3, 127, 127)).astype(np.float32)
    (expected,) = network(crop)
    reversed_twice = np.ascontiguousarray(crop[..., ::-1])[..., ::-1]
    read_only = crop.copy()
    read_only.flags.writeable = False
    for given in (reversed_twice, read_only, crop.astype(np.float64)):
        (result,) = network(given)
        np.testing.assert_array_equal(result, expected)
    (other,) = network(crop[..., ::-1])
    assert (other != result).any()  # results are not overwritten by the next call
    np.testing.assert_array_equal(result, expected)
    with pytest.raises(WeightsError):
        network(crop, crop)


@pytest.mark.parametrize("runtime", RUNTIMES)
def test_damaged_files_and_wrong_shapes_are_refused(backbone, tmp_path, runtime):
    pytest.importorskip(runtime)
    (tmp_path / "cut.onnx").write_bytes(backbone.read_bytes()[:90_000])
    with pytest.raises(WeightsError, match="damaged or cut short"):
        load_network(tmp_path / "cut.onnx", runtime=runtime)
    with pytest.raises(WeightsError, match=r"does not take an input of shape \(1, 5, 127, 127\)"):
        load_network(backbone, (1, 5, 127, 127), runtime=runtime)
    with pytest.raises(WeightsError, match="do not exist"):
        load_network(tmp_path / "none.onnx", runtime=runtime)


@pytest.mark.parametrize("device", ["cuda", "tensorrt", "coreml"])
def test_a_device_that_the_build_lacks_is_refused(backbone, device):
    ort = pytest.importorskip("onnxruntime")
    if any(device in each.lower() for each in ort.get_available_providers()):
        pytest.skip(f"this ONNX Runtime has {device}")
    with pytest.raises(ArgumentError, match=f"device {device} is not in the installed") as caught:
        load_network(backbone, runtime="onnxruntime", device=device)
    assert "\n" not in str(caught.value)


def test_large_compiled_networks_are_cached(backbone, cache, monkeypatch):
    crop = np.full((1, 3, 255, 255), 90, np.float32)
    expected = load_network(backbone)(crop)
    assert not cache.exists()
    monkeypatch.setattr(openvino_runtime, "_MIN_CACHED_BYTES", 0)
    for _ in range(2):
        np.testing.assert_array_equal(load_network(backbone)(crop), expected)
        assert len(list(cache.iterdir())) == 1


@pytest.mark.parametrize("damage", ["a file instead of the folder", "a damaged entry"])
def test_a_broken_cache_is_ignored(backbone, cache, monkeypatch, damage):
    monkeypatch.setattr(openvino_runtime, "_MIN_CACHED_BYTES", 0)
    crop = np.full((1, 3, 255, 255), 90, np.float32)
    expected = load_network(backbone)(crop)
    (entry,) = cache.iterdir()
    content = entry.read_bytes()
    entry.unlink()
    if damage == "a damaged entry":
        entry.write_bytes(content[: len(content) // 2])
    else:
        cache.rmdir()
        cache.write_text("in the way")
    np.testing.assert_array_equal(load_network(backbone)(crop), expected)


def test_bf16_falls_back_to_f32_with_a_warning(backbone, monkeypatch, caplog):
    monkeypatch.setattr(openvino_runtime, "supports_bf16", lambda: False)
    crop = np.full((1, 3, 255, 255), 90, np.float32)
    with caplog.at_level(logging.WARNING):
        outputs = load_network(backbone, precision="bf16")(crop)
    assert "no bf16 arithmetic: the network runs in f32" in caplog.text
    np.testing.assert_array_equal(outputs, load_network(backbone)(crop))
