"""NanoTrack's networks: how they are compiled, which are refused, and the evidence they give."""

import numpy as np
import pytest

from helpers.stub_networks import Stub, marker_cells
from helpers.tracker_loops import LoopTests
from ssiam import FrameView
from ssiam.errors import WeightsError
from ssiam.runtime import RuntimeOptions, loading
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.nanotrack import PARAMETERS, NanoTrack, NanoTrackNetworks
from ssiam.trackers.siamese import SearchParameters


def marker_head(t, kernel, crop):
    """A head on the crop itself that detects the marker."""
    logits, distances = marker_cells(crop[0], 16)
    return [np.stack([0 * logits, logits])[None], distances[None]]


class TestNanoTrackLoop(LoopTests):
    def tracker(self):
        head = Stub(marker_head)
        head.output_shapes = [(1, 2, 16, 16), (1, 4, 16, 16)]
        same = Stub(lambda t, crop: [crop])
        confidence = Confidence((1.0, 0.0), 0.0)
        return NanoTrack(
            NanoTrackNetworks(same, same, head), PARAMETERS["nanotrack_v2"], confidence
        )


FEATURES = {
    "nanotrack_v1": (48, 16, 18),
    "nanotrack_v2": (48, 16, 34),
    "nanotrack_v3": (96, 15, 46),
}


def networks_of(channels, side, convolutions):
    template, search, head = (Stub(None) for _ in range(3))
    template.output_shapes = [(1, channels, 8, 8)]
    search.output_shapes = [(1, channels, 16, 16)]
    head.input_shapes = [(1, channels, 8, 8), (1, channels, 16, 16)]
    head.output_shapes = [(1, 2, side, side), (1, 4, side, side)]
    head.convolution_count = convolutions
    return NanoTrackNetworks(template, search, head)


@pytest.fixture
def compiled(monkeypatch, tmp_path):
    """`load_network` that returns parts of the networks in the list, and its calls."""
    networks, calls = [], []

    def load(path, shape, **options):
        calls.append((path.name, shape, options))
        return getattr(networks[0], ("template", "search", "head")[(len(calls) - 1) % 3])

    monkeypatch.setattr(loading, "load_network", load)
    for part in ("backbone", "head"):
        (tmp_path / f"x_{part}.onnx").touch()
    return networks, calls, tmp_path


@pytest.mark.parametrize("name", FEATURES)
@pytest.mark.parametrize(
    ("runtime", "precision", "of_head"),
    [("onnxruntime", "f32", "f32"), ("onnxruntime", "int8", "f32"), ("openvino", "bf16", "bf16")],
)
def test_nanotracks_backbone_is_compiled_for_both_crops(
    compiled, name, runtime, precision, of_head
):
    networks, calls, folder = compiled
    networks.append(networks_of(*FEATURES[name]))
    options = RuntimeOptions(runtime, 3, precision)
    found = NanoTrackNetworks.load(name, folder, options)
    assert found == networks[0]
    common = {"runtime": runtime, "threads": 3, "device": options.device}
    assert calls == [
        ("x_backbone.onnx", (1, 3, 127, 127), {**common, "precision": precision}),
        ("x_backbone.onnx", (1, 3, 255, 255), {**common, "precision": precision}),
        ("x_head.onnx", None, {**common, "precision": of_head}),
    ]


@pytest.mark.parametrize("name", FEATURES)
def test_networks_of_other_shapes_are_refused(compiled, name):
    networks, _, folder = compiled
    channels, side, convolutions = FEATURES[name]
    options = RuntimeOptions()
    altered = []
    for part, attribute in (
        ("template", "output_shapes"),
        ("search", "output_shapes"),
        ("head", "input_shapes"),
        ("head", "output_shapes"),
    ):
        wrong = networks_of(*FEATURES[name])
        shapes = getattr(getattr(wrong, part), attribute)
        setattr(getattr(wrong, part), attribute, [*shapes[:-1], (1, 3, 5, 5)])
        altered.append(wrong)
    altered += [
        networks_of(channels + 1, side, convolutions),
        networks_of(channels, side + 1, convolutions),
        networks_of(channels, side, convolutions + 1),
    ]
    for wrong in altered:
        networks[:] = [wrong]
        with pytest.raises(WeightsError) as caught:
            NanoTrackNetworks.load(name, folder, options)
        reason = f"{folder} holds weights of another network than {name}: "
        assert str(caught.value).startswith(reason)
    maps = f"[(1, 2, {side}, {side}), (1, 4, {side}, {side})]"
    assert str(caught.value) == (
        f"{reason}features (1, {channels}, 16, 16), maps {maps}, {convolutions + 1} convolutions "
        f"in the head; expected (1, {channels}, 16, 16), {maps}, {convolutions}"
    )


def maps_with_a_peak(background, foreground, side=16):
    """Low scores but for a cell near the center, and boxes of 40 px."""
    scores = np.zeros((1, 2, side, side), np.float32)
    scores[0, 0] = 9
    scores[0, :, 8, 8] = background, foreground
    return scores, np.full((1, 4, side, side), 20, np.float32)


@pytest.mark.parametrize(
    ("background", "foreground", "logit"),
    [(0, 5, 5), (3, 5, 2), (-4, 5, 9), (-9, 5, 12), (7, -3, -6), (1, 0, -1)],
)
def test_the_evidence_is_the_difference_of_the_scores_within_limits(background, foreground, logit):
    networks = networks_of(*FEATURES["nanotrack_v1"])
    for part, side in (("template", 8), ("search", 16)):
        features = np.ones((1, 48, side, side), np.float32)
        getattr(networks, part).answer = lambda t, crop, features=features: [features]
    maps = maps_with_a_peak(background, foreground)
    networks.head.answer = lambda t, kernel, features: list(maps)
    parameters = SearchParameters(penalty_k=0.1, window_influence=0.1, lr=0.3)
    tracker = NanoTrack(networks, parameters, Confidence((1.0, 1.0), 0.0))
    frame = np.full((240, 320, 3), 90, np.uint8)
    tracker.init(FrameView(frame), (140.0, 100.0, 40.0, 40.0))
    track = tracker.update(FrameView(frame))
    assert track.evidence == pytest.approx((logit, 0), abs=1e-5)
