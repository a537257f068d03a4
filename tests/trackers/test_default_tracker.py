"""The default tracker: small weights in the package, masks, and refused options."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

import ssiam
from helpers.synthetic import golden_video
from ssiam.cli import main
from ssiam.errors import ArgumentError, WeightsError
from ssiam.geometry import iou
from ssiam.trackers.lite import SHIPPED

MAX_BYTES = 12_000_000


def tracked(tracker, name="A"):
    """Tracks of a textured ellipse that moves over a pattern of blocks, and the frames."""
    frames, (x, y, w, h) = golden_video(name)
    tracker.init(frames[0], (x, y, w, h))
    return [tracker.update(frame) for frame in frames[1:]], frames


def test_it_is_loaded_without_a_name():
    assert ssiam.load_tracker().config.stabilize == "predict"
    assert ssiam.TRACKERS[0] == "lite"
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < MAX_BYTES


def test_it_does_not_need_torch():
    code = (
        "import sys; sys.modules['torch'] = sys.modules['onnx'] = None\n"
        "import ssiam; ssiam.load_tracker(); print('loaded')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "loaded\n", done.stderr


@pytest.fixture(scope="module")
def int8(tmp_path_factory):
    """Folder of the network in int8, calibrated on a drawn video, by `ssiam weights export`."""
    pytest.importorskip("onnxruntime")
    folder = tmp_path_factory.mktemp("int8")
    for number, frame in enumerate(golden_video("B")[0][:4]):
        cv2.imwrite(str(folder / f"{number}.png"), frame)
    command = ["weights", "export", "lite", "--precision", "int8", "--pictures", str(folder)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ssiam.runtime.quantization._CROPS", 4)
        assert main([*command, "--out", str(folder / "weights")]) == 0
    return folder / "weights" / "lite"


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_int8_tracks_as_f32_does(int8, runtime):
    exact, _ = tracked(ssiam.load_tracker(stabilize="off"))
    tracker = ssiam.load_tracker(weights=int8, stabilize="off", runtime=runtime, precision="int8")
    tracks, _ = tracked(tracker)
    overlaps = iou([track.box for track in tracks], [track.box for track in exact])
    assert 0.8 < np.mean(overlaps) < 1
    assert (int8 / "search.onnx").stat().st_size < 0.8 * (SHIPPED / "search.onnx").stat().st_size


def test_bf16_tracks_as_f32_does():
    exact, _ = tracked(ssiam.load_tracker(stabilize="off"))
    tracks, _ = tracked(ssiam.load_tracker(stabilize="off", precision="bf16"))
    assert np.mean(iou([track.box for track in tracks], [track.box for track in exact])) > 0.8


def test_int8_needs_weights_in_int8(int8, tmp_path, capsys):
    with pytest.raises(ArgumentError, match=r"weights export lite \[FILE\] --precision int8"):
        ssiam.load_tracker(precision="int8")
    for arguments, words in (
        ([str(int8), "--precision", "int8", "--pictures", str(int8.parents[1])], "are in int8"),
        (["--precision", "int8"], "needs images"),
        ([], "lite is in ONNX already: give --precision int8"),
        (["missing", "--precision", "int8", "--pictures", str(int8.parents[1])], "missing"),
    ):
        assert main(["weights", "export", "lite", *arguments, "--out", str(tmp_path)]) == 2
        assert words in capsys.readouterr().err
    assert not list(tmp_path.glob("*/*.onnx"))


@pytest.mark.parametrize("stabilize", ["off", "predict"])
def test_it_tracks_with_box_mask_and_corners(stabilize):
    tracks, frames = tracked(ssiam.load_tracker(stabilize=stabilize))
    found = np.array([track.box for track in tracks])
    assert (np.ptp(found[:, :2], axis=0) > 20).all()
    covered = []
    for track, frame in zip(tracks, frames[1:], strict=True):
        assert track.mask.shape == frame.shape[:2]
        assert track.corners.shape == (4, 2)
        x, y, w, h = track.box
        rows, columns = (
            slice(round(first + side / 4), round(first + 3 * side / 4))
            for first, side in ((y, h), (x, w))
        )
        covered.append(track.mask[rows, columns].mean())
        assert track.mask.sum() < w * h
        assert not track.lost
    assert np.mean(covered) > 0.6
    assert min(covered) > 0.4


def test_the_runtimes_agree():
    openvino, onnxruntime = (
        np.array([track.box for track in tracked(ssiam.load_tracker(runtime=runtime))[0]])
        for runtime in ("openvino", "onnxruntime")
    )
    # Rounding errors grow from frame to frame.
    assert iou(openvino[:5], onnxruntime[:5]).min() > 0.999


def test_a_clone_does_not_change_the_original():
    first = ssiam.load_tracker()
    alone = [track.box for track in tracked(first)[0]]
    second = first.clone()
    frames, box = golden_video("A")
    others, _ = golden_video("B")
    first.init(frames[0], box)
    second.init(others[0], (0, 0, 38, 52))
    both = []
    for frame, other in zip(frames[1:], others[1:], strict=True):
        both.append(first.update(frame).box)
        second.update(other)
    assert both == alone


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param({"runtime": "torch"}, "choose runtime openvino or onnxruntime", id="torch"),
    ],
)
def test_unsupported_options_are_refused(options, message):
    with pytest.raises(ArgumentError, match=message):
        ssiam.load_tracker(**options)


def test_missing_weights_are_refused(tmp_path):
    with pytest.raises(WeightsError, match="absent do not exist"):
        ssiam.load_tracker("lite", weights=tmp_path / "absent")
