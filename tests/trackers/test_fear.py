"""FEAR-XS: its loop on given maps, its networks on both runtimes, and its import."""

import shutil

import numpy as np
import pytest

import ssiam
from helpers.stub_networks import Stub, marker_cells
from helpers.synthetic import world
from helpers.tracker_loops import LoopTests
from ssiam import FrameView
from ssiam.cli import main
from ssiam.errors import WeightsError
from ssiam.geometry import rigid
from ssiam.runtime import RuntimeOptions
from ssiam.trackers.fear import (
    _MEAN_RGB,
    CONFIDENCE,
    PARAMETERS,
    FearNetworks,
    FearXs,
    _expanded,
    _whole_pixels,
)
from ssiam.trackers.siamese import SearchParameters

FRAME = world(1, (320, 240))
BOX = (100.0, 80.0, 40.0, 30.0)


def maps(cell, distances, logit=6.0):
    """A search network with one high logit at (row, column), and the same distances everywhere."""

    def answer(t, crop, features):
        logits = np.full((1, 1, 16, 16), -8, np.float32)
        logits[0, 0][cell] = logit
        regression = np.zeros((1, 4, 16, 16), np.float32)
        regression[0] += np.array(distances, np.float32)[:, None, None]
        return [regression, logits]

    return Stub(answer)


def tracker_of(search, parameters=None):
    template = Stub(lambda t, crop: [crop])
    networks = FearNetworks(template, search)
    parameters = parameters or SearchParameters(0.0, 0.0, 1.0)
    return FearXs(networks, parameters), template


def marker_search(t, crop, features):
    """A search network that detects the marker."""
    logits, distances = marker_cells(crop[0] + np.array(_MEAN_RGB)[:, None, None], 16)
    return [distances[None], logits[None, None]]


class TestFearLoop(LoopTests):
    def tracker(self):
        return tracker_of(Stub(marker_search), PARAMETERS)[0]


def test_the_crops_are_stretched_rgb_without_the_mean():
    tracker, template = tracker_of(maps((8, 8), [25.6] * 4))
    tracker.init(FrameView(FRAME), BOX)
    ((crop,),) = template.calls
    assert (crop.shape, crop.dtype) == ((1, 3, 128, 128), np.float32)
    # 1.4 times the box: 56 x 42 pixels from (92, 74), both stretched to 128.
    patch = FRAME[74:116, 92:148, ::-1].astype(float) - (123.675, 116.28, 103.53)
    np.testing.assert_allclose(crop.mean(axis=(0, 2, 3)), patch.mean(axis=(0, 1)), atol=1.5)
    tracker.update(FrameView(FRAME))
    ((search, features),) = tracker._networks.search.calls
    assert search.shape == (1, 3, 256, 256)
    assert features is template.calls[0][0]


@pytest.mark.parametrize("shift", [(0, 0), (9, -7)])
def test_cells_and_distances_become_a_box_of_the_view(shift):
    # The search region is 200 x 150 from (20, 20): 256 / 5 px of the crop are a side of the box.
    tracker, _ = tracker_of(maps((9, 10), [20, 30, 31.2, 21.2]))
    view = FrameView(FRAME, rigid(*shift, 0))
    tracker.init(FrameView(FRAME), BOX)
    track = tracker.update(view)
    x, y = (10 - 8) * 16 + 128 + (31.2 - 20) / 2, (9 - 8) * 16 + 128 + (21.2 - 30) / 2
    cx, cy = 20 + x * 200 / 256, 20 + y * 150 / 256
    left, top, right, bottom = (
        round(each) for each in (cx - 20, cy - 15, cx - 20 + 40, cy - 15 + 30)
    )
    assert track.box == pytest.approx((left, top, right - left, bottom - top), abs=1)
    assert all(number == int(number) for number in track.box)
    assert track.evidence == (6.0,)
    assert track.score == CONFIDENCE.probability((6.0,))


def test_seek_begins_at_whole_pixels():
    tracker, _ = tracker_of(maps((8, 8), [25.6] * 4))
    tracker.init(FrameView(FRAME), BOX)
    track = tracker.seek(FrameView(FRAME), (200.4, 100.6, 40.0, 30.0))
    assert track.box[:2] == pytest.approx((200, 101), abs=1.5)
    assert tracker.template_feature().shape == (3 * 128 * 128,)


@pytest.mark.parametrize(
    ("xywh", "expected"),
    [
        ((10.4, 20.6, 30.2, 9.9), (10, 21, 31, 9)),
        ((-5, -5, 20, 20), (0, 0, 15, 15)),
        ((317, 230, 50, 50), (317, 230, 3, 10)),
        ((400, 300, 5, 5), (317, 237, 3, 3)),
        ((10, 10, 0.2, 0.2), (10, 10, 3, 3)),
        ((np.nan, 10, 20, np.inf), (0, 10, 3, 3)),
    ],
)
def test_boxes_are_whole_pixels_inside_of_the_frame(xywh, expected):
    assert _whole_pixels(xywh, (320, 240)) == expected
    assert _whole_pixels((0, 0, 9, 9), (2, 1)) == (0, 0, 2, 1)


def test_margins_are_truncated():
    assert _expanded((10.9, 20.9, 10.0, 20.0), 0.2) == (8, 16, 14, 28)
    assert _expanded((10.9, 20.9, 0.1, 0.1), 0.2)[2:] == (1, 1)


@pytest.fixture
def weights(shared):
    return shared("data/weights/fear_xs")


def test_both_runtimes_give_the_same_maps(weights):
    pytest.importorskip("onnxruntime")
    crop = FrameView(FRAME).crop((60, 50, 160, 120), (256, 256)).tensor(rgb=True, mean=110)
    small = FrameView(FRAME).crop((90, 70, 60, 50), (128, 128)).tensor(rgb=True, mean=110)
    outputs = []
    for runtime in ("openvino", "onnxruntime"):
        networks = FearNetworks.load(weights, RuntimeOptions(runtime))
        (features,) = networks.template(small)
        outputs.append([features, *networks.search(crop, features)])
    for first, second in zip(*outputs, strict=True):
        np.testing.assert_allclose(first, second, atol=1e-3 * np.abs(first).max())


def test_weights_are_imported_and_track(weights, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(WeightsError, match="ssiam weights get fear_xs_coreml"):
        ssiam.load_tracker("fear_xs")
    assert main(["weights", "import", str(weights)]) == 0
    assert f"stored in {tmp_path / 'ssiam/weights/fear_xs'} for fear_xs" in capsys.readouterr().out
    tracker = ssiam.load_tracker("fear_xs")
    assert tracker.score_is_calibrated
    tracker.init(FRAME, BOX)
    x, y, w, h = tracker.update(FRAME).box
    assert (x, y, w, h) == pytest.approx(BOX, abs=6)


def test_wrong_weights_are_refused(weights, tmp_path):
    for missing in (tmp_path, tmp_path / "none"):
        with pytest.raises(WeightsError, match="fear_template"):
            FearNetworks.load(missing, RuntimeOptions())
    shutil.copyfile(weights / "fear_search.onnx", tmp_path / "fear_template.onnx")
    shutil.copyfile(weights / "fear_template.onnx", tmp_path / "fear_search.onnx")
    with pytest.raises(WeightsError, match="holds weights of another network than fear_xs"):
        FearNetworks.load(tmp_path / "fear_search.onnx", RuntimeOptions())
