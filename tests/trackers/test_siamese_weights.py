"""The paper's trackers, loaded from checkpoints and exported files."""

import shutil

import numpy as np
import pytest

import ssiam
from ssiam import cli
from ssiam.runtime import MODEL_ZOO, RuntimeOptions

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers.network_files import constant_state, save_checkpoint  # noqa: E402
from helpers.network_models import NETWORKS, SLOW, checkpoint, exported, folder  # noqa: E402
from helpers.synthetic import golden_video  # noqa: E402
from ssiam.runtime import loading  # noqa: E402

ALEX, R50, MASK = "siamrpn_alex_dwxcorr", "siamrpn_r50_l234_dwxcorr", "siammask_r50_l3"


@pytest.fixture(autouse=True)
def shared_cache(monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder() / "cache"))


@pytest.fixture
def cache(shared_cache, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "ssiam"


def tracked(tracker, count=3):
    frames, box = golden_video("A", count)
    tracker.init(frames[0], box)
    return [tracker.update(frame) for frame in frames[1:]]


def test_the_weights_of_every_tracker_are_in_the_model_zoo():
    without = {"lite", "csrt", "kcf", "mil", "dlib", "one_stream"}
    opencv = {"opencv_vit", "opencv_nano", "opencv_dasiamrpn"}
    assert set(MODEL_ZOO) == set(ssiam.TRACKERS) - without - opencv


@pytest.mark.parametrize("golden", [ALEX, "siamfc", *([MASK, R50] if SLOW else [])])
def test_the_runtimes_agree(golden):
    pytest.importorskip("onnxruntime")
    name, weights = NETWORKS[golden][1], checkpoint(golden)
    boxes = {}
    for runtime in ("torch", "onnxruntime", "openvino"):
        tracker = ssiam.load_tracker(name, weights=weights, stabilize="off", runtime=runtime)
        boxes[runtime] = np.array([track.box for track in tracked(tracker)])
    for runtime in ("onnxruntime", "openvino"):
        np.testing.assert_allclose(boxes[runtime], boxes["torch"], atol=0.01)


def test_resnet_is_loaded_from_one_of_its_exported_files():
    tracker = ssiam.load_tracker(R50, weights=exported(R50) / "search.onnx", stabilize="paper")
    (track,) = tracked(tracker, 2)
    assert np.isfinite(track.box).all()


def test_all_siammask_trackers_share_one_network(monkeypatch):
    loaded = loading.load_pieces(exported(MASK), MASK, RuntimeOptions())
    monkeypatch.setattr(loading, "load_pieces", lambda *arguments: loaded)
    for name in (each for each in MODEL_ZOO if each.startswith("siammask")):
        tracker = ssiam.load_tracker(name, weights=exported(MASK), stabilize="off")
        (track,) = tracked(tracker, 2)
        assert track.mask.shape == (240, 320)
        assert track.corners.shape == (4, 2)


def test_a_checkpoint_is_exported_once(cache, tmp_path, monkeypatch):
    weights = tmp_path / "model.pth"
    shutil.copyfile(checkpoint(ALEX), weights)
    first = tracked(ssiam.load_tracker(ALEX, weights=weights, stabilize="off"))
    (folder,) = (cache / "networks").iterdir()
    assert {path.name for path in folder.iterdir()} == {
        "template.onnx",
        "search.onnx",
        "network.json",
    }
    monkeypatch.setattr("ssiam.runtime.export.export_network", None)
    again = tracked(ssiam.load_tracker(ALEX, weights=weights, stabilize="off"))
    assert [track.box for track in first] == [track.box for track in again]


def test_a_cache_that_cannot_be_written_is_not_fatal(cache, caplog):
    cache.parent.write_text("in the way")
    tracker = ssiam.load_tracker(ALEX, weights=checkpoint(ALEX), stabilize="off")
    assert "not cached" in caplog.text
    assert len(tracked(tracker)) == 2


@pytest.mark.parametrize("runtime", ["torch", "openvino"])
@pytest.mark.parametrize(
    ("name", "keys", "found"),
    [
        (MASK, "siamrpn_alex_dwxcorr", ALEX),
        ("siammask_e", "siamrpn_r50_l234_dwxcorr", R50),
        (R50, "siamrpn_r50_l234_dwxcorr_otb", f"{R50}_otb"),
        ("siamfc", "SiamMask_foolwood_base", "siammask_base"),
    ],
)
def test_weights_of_another_network_name_both(tmp_path, runtime, name, keys, found):
    weights = save_checkpoint(tmp_path / "model.pth", constant_state(keys))
    expected = MODEL_ZOO[name].network
    with pytest.raises(ssiam.WeightsError, match=f"those of {found}, not of {expected}") as caught:
        ssiam.load_tracker(name, weights=weights, runtime=runtime)
    assert "\n" not in str(caught.value)


def test_exported_weights_of_another_network():
    with pytest.raises(ssiam.WeightsError, match=f"those of {ALEX}, not of siamfc"):
        ssiam.load_tracker("siamfc", weights=exported(ALEX))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        pytest.param(lambda path: path.mkdir(), "holds no network.json", id="empty folder"),
        pytest.param(lambda path: None, "do not exist", id="nothing"),
        pytest.param(lambda path: path.write_text("<html>"), "are a web page", id="html"),
        pytest.param(
            lambda path: (path.mkdir(), (path / "network.json").write_text("{}")),
            "network.json is damaged",
            id="damaged manifest",
        ),
    ],
)
def test_bad_weights_are_named(tmp_path, make, message):
    make(tmp_path / "given")
    with pytest.raises(ssiam.WeightsError, match=message) as caught:
        ssiam.load_tracker("siamfc", weights=tmp_path / "given")
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_onnx_file_without_a_manifest(tmp_path):
    shutil.copy(exported(ALEX) / "search.onnx", tmp_path)
    with pytest.raises(ssiam.WeightsError, match=r"holds no network.json"):
        ssiam.load_tracker(ALEX, weights=tmp_path / "search.onnx")


def test_the_message_without_weights_names_their_command():
    with pytest.raises(ssiam.WeightsError, match="ssiam weights get siammask_davis"):
        ssiam.load_tracker("siammask_davis")


def test_imported_weights_are_found(cache):
    assert cli.main(["weights", "import", str(checkpoint(ALEX))]) == 0
    for runtime in ("openvino", "torch"):
        tracker = ssiam.load_tracker(ALEX, runtime=runtime, stabilize="off")
        assert len(tracked(tracker, 2)) == 1


def test_trackers_of_one_kind_share_the_networks(monkeypatch):
    loaded = []
    load = loading.load_network
    monkeypatch.setattr(
        loading, "load_network", lambda *a, **k: (loaded.append(a), load(*a, **k))[1]
    )
    group = ssiam.TrackerGroup(ssiam.load_tracker(ALEX, weights=exported(ALEX)))
    frames, box = golden_video("A", 2)
    group.init(frames[0], [box, (20, 30, 40, 40), (200, 80, 60, 50)])
    assert len(group.update(frames[1])) == 3
    assert len(loaded) == 2
