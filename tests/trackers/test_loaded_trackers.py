"""What `load_tracker` loads for a name: networks, weights, options and further templates."""

from pathlib import Path
from typing import get_args

import pytest

import ssiam
from helpers.stub_networks import Stub, kernels
from ssiam import StabilizerConfig
from ssiam.errors import ArgumentError, WeightsError
from ssiam.runtime import MODEL_ZOO, RuntimeOptions, loading
from ssiam.trackers import TRACKERS, registry, siammask, siamrpn
from ssiam.trackers.lite import SHIPPED, LiteNetworks, LiteTracker
from ssiam.trackers.nanotrack import CONFIDENCE, PARAMETERS, NanoTrack, NanoTrackNetworks
from ssiam.trackers.opencv import OpenCvTracker
from ssiam.trackers.registry import (
    find_weights,
    has_networks,
    imported_weights,
    load_siamese_tracker,
    recognizes_distractors,
    weights_folders,
    weights_path,
)
from ssiam.trackers.siamfc import SiamFc
from ssiam.trackers.siammask import SiamMask
from ssiam.trackers.siamrpn import SiamRpn
from ssiam.trackers.template_memory import TemplateMemoryTracker

OPENCV = ("csrt", "kcf", "mil")
NANOTRACK = ("nanotrack_v1", "nanotrack_v2", "nanotrack_v3")
SIAMESE = get_args(registry.SiameseName)
WITHOUT_NETWORKS = (*OPENCV, "opencv_vit", "opencv_nano", "opencv_dasiamrpn", "dlib")


@pytest.fixture
def pieces(monkeypatch):
    """Pieces that any weights have, and the calls that loaded them."""
    found = {name: Stub(kernels) for name in ("template", "search", "refine")}
    calls = []

    def load(*given):
        calls.append(given)
        return found

    monkeypatch.setattr(loading, "load_pieces", load)
    return found, calls


@pytest.fixture
def nowhere(tmp_path, monkeypatch):
    """No imported weights; returns the folder of those of the user, and of those here."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "cache" / "ssiam" / "weights", Path("weights")


def view_tracker(*names, **options):
    return ssiam.load_tracker(*names, **options)._tracker


def test_the_default_tracker_and_method():
    tracker = ssiam.load_tracker()
    assert registry.DEFAULT_TRACKER == "lite"
    assert type(tracker._tracker) is LiteTracker
    assert tracker._tracker.prefers_prediction
    assert tracker.config == StabilizerConfig("predict")
    assert ssiam.load_tracker("kcf", stabilize="paper").config == StabilizerConfig("paper")
    config = StabilizerConfig("literal").with_options(border=3)
    assert ssiam.load_tracker("kcf", stabilize=config).config is config


def test_lite_is_loaded_with_its_options(monkeypatch, tmp_path):
    calls = []

    def load(weights, options):
        calls.append((weights, options))
        return LiteNetworks(Stub(kernels), Stub(kernels))

    monkeypatch.setattr(LiteNetworks, "load", load)
    view_tracker("lite")
    view_tracker("lite", weights=str(tmp_path), runtime="onnxruntime", threads=3, device="cpu")
    assert calls == [
        (SHIPPED, RuntimeOptions("openvino", 1, "f32", None)),
        (tmp_path, RuntimeOptions("onnxruntime", 3, "f32", "cpu")),
    ]


@pytest.mark.parametrize("name", NANOTRACK)
def test_nanotrack_is_loaded_with_its_numbers(monkeypatch, tmp_path, name):
    head = Stub(None)
    head.output_shapes = [(1, 2, 16, 16), (1, 4, 16, 16)]
    networks, calls = NanoTrackNetworks(Stub(None), Stub(None), head), []

    def load(*given):
        calls.append(given)
        return networks

    monkeypatch.setattr(NanoTrackNetworks, "load", load)
    found = view_tracker(name, weights=tmp_path, precision="bf16")
    assert type(found) is NanoTrack
    assert calls == [(name, tmp_path, RuntimeOptions(precision="bf16"))]
    assert found._networks is networks
    assert (found._parameters, found._confidence) == (PARAMETERS[name], CONFIDENCE[name])
    assert found.prefers_prediction == (name == "nanotrack_v3")


@pytest.mark.parametrize("name", SIAMESE)
def test_the_papers_trackers_are_loaded_with_their_parameters(pieces, tmp_path, name):
    found, calls = pieces
    options = RuntimeOptions("onnxruntime", 2)
    tracker = load_siamese_tracker(name, tmp_path, options)
    assert calls == [(tmp_path, MODEL_ZOO[name].network, options)]
    assert tracker._networks.template is found["template"]
    assert tracker._networks.search is found["search"]
    assert not tracker._has_distractors
    if name == "siamfc":
        assert type(tracker) is SiamFc
    elif name in siammask.PARAMETERS:
        assert type(tracker) is SiamMask
        assert tracker._networks.refine is found["refine"]
        assert tracker._parameters is siammask.PARAMETERS[name]
    else:
        assert type(tracker) is SiamRpn
        assert tracker._parameters is siamrpn.PARAMETERS[name]
    assert load_siamese_tracker(name, tmp_path, options, distractors=True)._has_distractors
    view_tracker(name, weights=tmp_path, runtime="torch", precision="bf16")
    assert calls[-1][2] == RuntimeOptions("torch", 1, "bf16")


def test_distractors_are_recognized_by_lite_alone(pieces, tmp_path):
    assert [name for name in TRACKERS if recognizes_distractors(name)] == ["lite"]
    assert not view_tracker("siamfc", weights=tmp_path)._has_distractors
    assert view_tracker("siamfc", weights=tmp_path, distractors=True)._has_distractors


def test_a_memory_is_around_trackers_that_can_seek(pieces, tmp_path):
    found = view_tracker("siamfc", weights=tmp_path, template_memory=True)
    assert type(found) is TemplateMemoryTracker
    assert type(found._tracker) is SiamFc
    assert type(view_tracker("kcf", template_memory=True)) is TemplateMemoryTracker
    for name in ("csrt", "mil"):
        with pytest.raises(ArgumentError, match=f"tracker {name} cannot search .* has no memory"):
            view_tracker(name, template_memory=True)


@pytest.mark.parametrize("name", OPENCV)
def test_opencvs_trackers_have_no_networks(name, tmp_path):
    assert type(view_tracker(name)) is OpenCvTracker
    assert view_tracker(name, threads=4)._name == name
    with pytest.raises(WeightsError, match=f"tracker {name} has no weights: leave"):
        view_tracker(name, weights=tmp_path)
    for options in ({"precision": "bf16"}, {"runtime": "torch", "device": "cuda"}):
        with pytest.raises(ArgumentError, match=f"tracker {name} has no network: leave precision"):
            view_tracker(name, **options)
    assert not has_networks(name)
    assert weights_path(name) is None
    assert weights_path(name, tmp_path) is None


def test_all_others_have_networks():
    assert {name for name in TRACKERS if not has_networks(name)} == set(WITHOUT_NETWORKS)


def stored(folder, name="network.json"):
    folder.mkdir(parents=True)
    (folder / name).touch()


def test_weights_are_those_in_the_users_cache_or_here(nowhere, pieces):
    cache, here = nowhere
    assert weights_folders() == (cache, here)
    published = MODEL_ZOO["siamfc"]
    assert imported_weights(published) is None
    with pytest.raises(WeightsError, match="siamfc needs weights: ssiam weights get siamfc; or"):
        view_tracker("siamfc")
    (here / published.folder).mkdir(parents=True)
    assert imported_weights(published) is None, "an empty folder"
    (here / published.folder / "network.json").touch()
    assert imported_weights(published) == here / published.folder
    stored(cache / published.folder)
    assert imported_weights(published) == cache / published.folder
    view_tracker("siamfc")
    assert pieces[1][-1][0] == cache / published.folder
    view_tracker("siamfc", weights="elsewhere")
    assert pieces[1][-1][0] == Path("elsewhere")


def test_the_authors_folder_names_are_known(tmp_path):
    published = next(each for each in MODEL_ZOO.values() if each.authors_folders)
    stored(tmp_path / published.authors_folders[0], "model.pth")
    found = find_weights(published, [tmp_path / "none", tmp_path])
    assert found == tmp_path / published.authors_folders[0]
    assert find_weights(published, []) is None
    stored(tmp_path / published.folder)
    assert find_weights(published, [tmp_path]) == tmp_path / published.folder


def test_paths_of_weights(nowhere, tmp_path):
    assert weights_path("lite") == SHIPPED
    assert weights_path("siamfc") is None
    assert weights_path("siamfc", tmp_path) == tmp_path
    assert weights_path("siamfc", tmp_path / "none") is None
    stored(nowhere[0] / MODEL_ZOO["siamfc"].folder)
    assert weights_path("siamfc") == nowhere[0] / MODEL_ZOO["siamfc"].folder
