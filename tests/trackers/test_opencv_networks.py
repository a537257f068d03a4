"""OpenCV's trackers with networks: construction, one-line errors, and a generated network."""

import copy

import cv2
import numpy as np
import pytest

import ssiam
from helpers.synthetic import world
from ssiam import FrameView
from ssiam.errors import ArgumentError, CopyError, MissingExtraError, WeightsError
from ssiam.trackers.opencv_networks import OpenCvNetworkTracker

onnx = pytest.importorskip("onnx")

NAMES = ("opencv_vit", "opencv_nano", "opencv_dasiamrpn")
FRAME = world(1, (320, 240))
BOX = (120.0, 90.0, 40.0, 40.0)


def write_vit(path):
    """A network with VitTrack's inputs and outputs: the peak is always in the central cell."""
    from onnx import TensorProto, helper, numpy_helper

    score = np.zeros((1, 1, 16, 16), np.float32)
    score[0, 0, 8, 8] = 0.9
    values = {
        "output1": score,
        "output2": np.full((1, 2, 16, 16), 0.25, np.float32),
        "output3": np.zeros((1, 2, 16, 16), np.float32),
    }
    nodes = [
        helper.make_node("ReduceMean", ["template"], ["t"], keepdims=1, axes=[1, 2, 3]),
        helper.make_node("ReduceMean", ["search"], ["s"], keepdims=1, axes=[1, 2, 3]),
        helper.make_node("Add", ["t", "s"], ["both"]),
        helper.make_node("Mul", ["both", "zero"], ["nothing"]),
        *(helper.make_node("Add", [f"{name}_value", "nothing"], [name]) for name in values),
    ]
    graph = helper.make_graph(
        nodes,
        "vit",
        [
            helper.make_tensor_value_info("template", TensorProto.FLOAT, (1, 3, 128, 128)),
            helper.make_tensor_value_info("search", TensorProto.FLOAT, (1, 3, 256, 256)),
        ],
        [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, value.shape)
            for name, value in values.items()
        ],
        [
            numpy_helper.from_array(np.zeros((1, 1, 1, 1), np.float32), "zero"),
            *(numpy_helper.from_array(value, f"{name}_value") for name, value in values.items()),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    onnx.save(model, path)
    return path


def test_vit_runs_a_generated_network(tmp_path):
    path = write_vit(tmp_path / "vit.onnx")
    tracker = ssiam.load_tracker("opencv_vit", weights=path, stabilize="off").view_tracker
    assert (tracker.can_seek, tracker.score_is_calibrated) == (False, False)
    with pytest.raises(ArgumentError, match="no target yet"):
        tracker.update(FrameView(FRAME))
    for border in (0, 20):
        tracker.init(FrameView(FRAME, border=border), BOX)
        track = tracker.update(FrameView(FRAME, border=border))
        # The peak is in the middle of the search region, which is around the target.
        x, y, w, h = track.box
        assert (x + w / 2, y + h / 2) == pytest.approx((140, 110), abs=8)
        assert 0.2 < track.score <= 1
    with pytest.raises(CopyError, match="opencv_vit that has a target cannot be copied"):
        copy.deepcopy(tracker)
    cloned = tracker.clone()
    copy.deepcopy(cloned)
    with pytest.raises(ArgumentError, match="cannot search around"):
        tracker.seek(FrameView(FRAME), BOX)
    with pytest.raises(ArgumentError, match="box of 1x40 pixels: draw it larger"):
        cloned.init(FrameView(FRAME), (120, 90, 1, 40))


@pytest.mark.parametrize("name", NAMES)
def test_missing_and_damaged_weights_are_one_line(name, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(WeightsError, match=f"tracker {name} needs weights: "):
        ssiam.load_tracker(name)
    with pytest.raises(WeightsError, match=r"do not exist|holds 0 files"):
        ssiam.load_tracker(name, weights=tmp_path / "missing")
    with pytest.raises(WeightsError, match="holds 0 files named"):
        ssiam.load_tracker(name, weights=tmp_path)
    files = ("vit.onnx", "x_backbone.onnx", "x_head.onnx", "x_model.onnx")
    for file in (*files, "x_kernel_cls1.onnx", "x_kernel_r1.onnx"):
        (tmp_path / file).write_bytes(b"\x08" + bytes(100))
    with pytest.raises(WeightsError, match=r"cannot be read: the file is damaged") as raised:
        ssiam.load_tracker(name, weights=tmp_path)
    assert "\n" not in str(raised.value)
    for file in tmp_path.glob("*.onnx"):
        file.write_text("<!DOCTYPE html>")
    with pytest.raises(WeightsError, match="are a web page"):
        ssiam.load_tracker(name, weights=tmp_path)


@pytest.mark.parametrize("name", NAMES)
def test_options_of_networks_of_this_package_are_refused(name, tmp_path):
    with pytest.raises(ArgumentError, match="leave precision and device out"):
        ssiam.load_tracker(name, weights=tmp_path, precision="bf16")
    with pytest.raises(ArgumentError, match="leave distractors out"):
        ssiam.load_tracker(name, weights=tmp_path, distractors=True)


def test_an_opencv_without_the_tracker_is_named(tmp_path, monkeypatch):
    monkeypatch.delattr(cv2, "TrackerVit")
    with pytest.raises(MissingExtraError, match="has no TrackerVit, which opencv_vit needs"):
        OpenCvNetworkTracker("opencv_vit", tmp_path)


def test_nano_runs_the_authors_files(shared, capfd):
    """OpenCV's own loop, with the weights of NanoTrack v2."""
    weights = shared("data/weights/nanotrackv2")
    tracker = ssiam.load_tracker("opencv_nano", weights=weights, stabilize="off")
    tracker.init(FRAME, BOX)
    track = tracker.update(FRAME)
    assert track.box == pytest.approx(BOX, abs=8)
    assert 0 <= track.score <= 1
    assert capfd.readouterr().err == ""
