"""Hyperparameters are those of the authors' configuration files, or the measured ones."""

import json
from pathlib import Path

import numpy as np
import pytest

import ssiam
from helpers.stub_networks import Stub
from helpers.synthetic import golden_video
from ssiam.trackers import lite, nanotrack, opencv, siammask, siamrpn
from ssiam.trackers.anchors import ANCHORS, STRIDE, anchor_boxes
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.nanotrack import SEARCH_SIDE, NanoTrackNetworks
from ssiam.trackers.siamese import CONTEXT, TEMPLATE_SIDE
from ssiam.trackers.siamfc import SiamFcParameters

GOLDEN = Path(__file__).parents[1] / "golden"
AUTHORS = json.loads((GOLDEN / "hyperparameters.json").read_text())
MEASURED = json.loads((GOLDEN / "measured.json").read_text())
CALIBRATED = MEASURED["confidence"]

SIAMMASK = {  # our name: the authors' configuration
    "siammask_r50_l3": "siammask_r50_l3",
    "siammask_e": "siammaske_r50_l3",
    "siammask_e_unrefined": "siammaske_r50_l3",
    "siammask_vot": "SiamMask_VOT.pth (config_vot)",
    "siammask_vot18": "SiamMask_VOT_LD.pth (config_vot18)",
    "siammask_davis": "SiamMask_DAVIS.pth (config_davis)",
}


def assert_search(parameters, expected):
    for name in ("penalty_k", "window_influence", "lr"):
        assert getattr(parameters, name) == expected[name], name


@pytest.mark.parametrize("name", siamrpn.PARAMETERS)
def test_siamrpn_has_the_authors_hyperparameters(name):
    parameters = siamrpn.PARAMETERS[name]
    assert_search(parameters, AUTHORS[name])
    assert parameters.instance == AUTHORS[name]["instance"]
    assert parameters.base == AUTHORS[name]["base_size"]
    assert parameters.variant == "pysot"


@pytest.mark.parametrize("name", siammask.PARAMETERS)
def test_siammask_has_the_authors_hyperparameters(name):
    parameters, authors = siammask.PARAMETERS[name], AUTHORS[SIAMMASK[name]]
    assert_search(parameters, authors)
    assert parameters.instance == authors["instance"]
    assert parameters.base == authors["base_size"]
    pysot = "mask_threshold" in authors
    assert parameters.mask_threshold == authors["mask_threshold" if pysot else "seg_thr"]
    assert parameters.variant == ("pysot" if pysot else "siammask")
    assert parameters.factor == (None if name == "siammask_e_unrefined" else authors.get("factor"))


@pytest.mark.parametrize("name", nanotrack.PARAMETERS)
def test_nanotrack_has_the_authors_hyperparameters(name):
    assert_search(nanotrack.PARAMETERS[name], AUTHORS[name])
    assert (AUTHORS[name]["exemplar"], AUTHORS[name]["instance"]) == (TEMPLATE_SIDE, SEARCH_SIDE)


def test_lite_has_the_measured_hyperparameters():
    assert_search(lite.PARAMETERS, MEASURED["lite"])
    assert MEASURED["lite"]["mask_threshold"] == lite.MASK_THRESHOLD


def test_siamfc_has_the_authors_hyperparameters():
    authors, parameters = AUTHORS["siamfc"], SiamFcParameters()
    for name in ("scale_step", "scale_lr", "scale_penalty", "window_influence"):
        assert getattr(parameters, name) == authors[name], name


def test_anchors_and_context_are_pysots():
    common = AUTHORS["common_pysot"]
    assert (common["exemplar"], common["context_amount"]) == (TEMPLATE_SIDE, CONTEXT)
    assert (len(common["anchor_ratios"]), common["anchor_stride"]) == (ANCHORS, STRIDE)
    (scale,) = common["anchor_scales"]
    for ratio, w, h in zip(common["anchor_ratios"], *anchor_boxes(1)[2:], strict=True):
        whole_w = int(np.sqrt(STRIDE**2 / ratio))
        assert (w, h) == (scale * whole_w, scale * int(ratio * whole_w))


CALIBRATIONS = {**nanotrack.CONFIDENCE, **opencv._CONFIDENCE, "lite": lite.CONFIDENCE}


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_confidence_is_as_calibrated(name):
    model = CALIBRATIONS[name]
    assert {"weights": list(model.weights), "bias": model.bias} == CALIBRATED[name]


def nanotrack_networks():
    """Networks with a low logit for a target whose features change from frame to frame."""
    scores = np.zeros((1, 2, 16, 16), np.float32)
    scores[0, 1] = 5  # a logit at which the features have weight
    distances = np.full((1, 4, 16, 16), 20, np.float32)

    def features(t, side):
        vectors = np.zeros((1, 48, side, side), np.float32)
        vectors[0, 0], vectors[0, 1] = np.cos(0.3 * t), np.sin(0.3 * t)
        return vectors

    head = Stub(lambda t, template, search: [scores, distances])
    head.output_shapes = [scores.shape, distances.shape]
    return NanoTrackNetworks(
        template=Stub(lambda t, crop: [features(0, side=8)]),
        search=Stub(lambda t, crop: [features(t, side=16)]),
        head=head,
    )


@pytest.mark.parametrize("name", nanotrack.CONFIDENCE)
def test_each_nanotrack_is_loaded_with_its_own_calibration(monkeypatch, tmp_path, name):
    monkeypatch.setattr(NanoTrackNetworks, "load", lambda *arguments: nanotrack_networks())
    model = Confidence(tuple(CALIBRATED[name]["weights"]), CALIBRATED[name]["bias"])
    tracker = ssiam.load_tracker(name, weights=tmp_path, stabilize="off")
    frames, box = golden_video("A", 4)
    tracker.init(frames[0], box)
    tracks = [tracker.update(frame) for frame in frames[1:]]
    assert tracks[-1].evidence[1] < 0
    for track in tracks:
        assert track.score == pytest.approx(model.probability(track.evidence))
