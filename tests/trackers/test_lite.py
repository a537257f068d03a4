"""The loop of `lite` on a marker, and its memory."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.stub_networks import Stub, marked, marker_cells
from helpers.tracker_loops import BOX, LoopTests, moving_marker
from ssiam import FrameView
from ssiam.errors import ArgumentError, WeightsError
from ssiam.runtime import RuntimeOptions, loading
from ssiam.trackers.lite import LiteNetworks, LiteTracker, Memory


def marker_search(distractor=0.0):
    """Search network with distances to the marker's edges; `distractor` is a corner's score."""

    def answer(t, crop, *kernels):
        score, distances = marker_cells(crop[0], 15)
        if distractor:
            score[0, 0] = np.log(distractor / (1 - distractor))
        quality = np.full((1, 1, 15, 15), 8, np.float32)
        return [score[None, None], quality, distances[None]]

    return Stub(answer)


def networks(**options):
    """The context of template number n is n."""

    def template(t, crop):
        return [crop, np.full((1, 1), t, np.float32)]

    return LiteNetworks(Stub(template), marker_search(**options))


class TestLite(LoopTests):
    def tracker(self):
        return LiteTracker(networks())


def recent(tracker, frames):
    """Number of the recent template in each frame."""
    tracker.init(FrameView(frames[0]), BOX)
    for frame in frames[1:]:
        tracker.update(FrameView(frame))
    return [int(inputs[-1].item()) for inputs in tracker._networks.search.calls]


FRAMES = [moving_marker(BOX)[0][0]] * 12


def test_the_recent_template_is_replaced():
    tracker = LiteTracker(networks(), memory=Memory(interval=4))
    assert recent(tracker, FRAMES) == [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3]


@pytest.mark.parametrize(
    ("memory", "distractor"),
    [
        pytest.param(Memory(interval=0), 0.0, id="never"),
        pytest.param(Memory(interval=4, min_score=1.0), 0.0, id="low score"),
        pytest.param(Memory(interval=4), 0.6, id="distractor"),
    ],
)
def test_the_recent_template_stays_the_first(memory, distractor):
    tracker = LiteTracker(networks(distractor=distractor), memory=memory)
    assert set(recent(tracker, FRAMES)) == {1}


def test_seek_returns_to_the_first_template():
    tracker = LiteTracker(networks(), memory=Memory(interval=4))
    recent(tracker, FRAMES)
    tracker.seek(FrameView(FRAMES[0]), BOX)
    assert int(tracker._networks.search.calls[-1][-1].item()) == 1


def test_a_clone_has_the_same_memory_settings():
    tracker = LiteTracker(networks(), memory=replace(Memory(), interval=4))
    assert tracker.clone()._memory == tracker._memory


def test_a_mask_network_is_run_when_the_mask_is_read():
    mask = Stub(lambda t, crop: [np.full((1, 1, 64, 64), 8, np.float32)])
    tracker = LiteTracker(replace(networks(), mask=mask))
    tracker.init(FrameView(FRAMES[0]), BOX)
    track = tracker.update(FrameView(FRAMES[1]))
    assert not mask.calls
    x, y, w, h = (round(value) for value in track.box)
    assert track.mask[y + h // 2, x + w // 2]
    assert len(mask.calls) == 1


def test_masks_can_be_switched_off():
    mask = Stub(lambda t, crop: [np.full((1, 1, 64, 64), 8, np.float32)])
    tracker = LiteTracker(replace(networks(), mask=mask), masks=False)
    tracker.init(FrameView(FRAMES[0]), BOX)
    assert tracker.update(FrameView(FRAMES[1])).mask is None


def test_templates_are_the_crop_around_the_target():
    tracker = LiteTracker(networks())
    tracker.init(FrameView(FRAMES[0]), BOX)
    ((crop,),) = tracker._networks.template.calls
    assert crop.shape == (1, 3, 127, 127)
    rows, columns = np.nonzero(marked(crop[0]))
    assert rows.mean() == pytest.approx(63, abs=1)
    assert columns.mean() == pytest.approx(63, abs=1)


PIECES = {name: Stub(None) for name in ("template", "search", "mask")}
KERNELS = [(1, 64, 96), (1, 64, 96), (1, 96, 4, 4), (1, 96, 4, 4), (1, 2, 2, 96, 64)]
PIECES["template"].input_shapes = [(1, 3, 127, 127)]
PIECES["template"].output_shapes = KERNELS
PIECES["search"].input_shapes = [(1, 3, 255, 255), *KERNELS, KERNELS[-1]]
PIECES["search"].output_shapes = [(1, 1, 15, 15), (1, 1, 15, 15), (1, 4, 15, 15)]
PIECES["mask"].input_shapes = [(1, 3, 128, 128)]
PIECES["mask"].output_shapes = [(1, 1, 64, 64)]


@pytest.mark.parametrize("names", [("template", "search"), ("template", "search", "mask")])
def test_the_networks_are_the_pieces_of_the_weights(monkeypatch, tmp_path, names):
    calls = []

    def load(weights, network, options):
        calls.append((weights, network, options))
        return {name: PIECES[name] for name in names}

    monkeypatch.setattr(loading, "load_pieces", load)
    options = RuntimeOptions(threads=2)
    found = LiteNetworks.load(tmp_path, options)
    assert calls == [(tmp_path, "lite2", options)]
    assert (found.template, found.search) == (PIECES["template"], PIECES["search"])
    assert found.mask is (PIECES["mask"] if "mask" in names else None)


@pytest.mark.parametrize(
    ("piece", "shapes"),
    [
        ("template", []),
        ("template", [*KERNELS, KERNELS[-1]]),
        ("template", [*KERNELS[:4], ()]),
        ("template", [*KERNELS[:3], KERNELS[0], KERNELS[-1]]),
        ("search", [(1, 1, 15, 15), (1, 1, 15, 15), (1, 5, 15, 15)]),
        ("mask", [(1, 64, 64)]),
    ],
)
def test_networks_of_other_shapes_are_not_lite(monkeypatch, tmp_path, piece, shapes):
    other = Stub(None)
    other.input_shapes, other.output_shapes = PIECES[piece].input_shapes, shapes
    monkeypatch.setattr(loading, "load_pieces", lambda *_: {**PIECES, piece: other})
    with pytest.raises(WeightsError, match="holds weights of another network than lite"):
        LiteNetworks.load(tmp_path, RuntimeOptions())


def test_pytorch_is_refused(tmp_path):
    with pytest.raises(ArgumentError, match="tracker lite is in ONNX: choose runtime openvino or"):
        LiteNetworks.load(tmp_path, RuntimeOptions("torch"))


@pytest.mark.parametrize(("taken", "given"), [(2, 2), (3, 3), (4, 4), (0, 4)])
def test_a_network_gets_as_many_inputs_as_it_takes(taken, given):
    """Crop, two kernels and the recent template's context."""
    search = Stub(lambda t, *inputs: list(inputs))
    search.input_shapes = [(1,)] * taken
    both = LiteNetworks(Stub(None), search)
    assert both.responses("crop", ["first", "second"], "recent") == [
        *("crop", "first", "second", "recent")[:given]
    ]
