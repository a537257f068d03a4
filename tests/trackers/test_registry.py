"""Loading trackers by name, and the messages for refused names and weights."""

import cv2
import numpy as np
import pytest

import ssiam


def test_the_default_tracker_needs_no_arguments():
    assert ssiam.load_tracker().config == ssiam.StabilizerConfig("predict")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param(
            {"name": "magic"}, "unknown tracker 'magic': choose from lite, csrt", id="tracker"
        ),
        pytest.param({"stabilize": "magic"}, "unknown stabilize 'magic'", id="stabilize"),
        pytest.param({"threads": 0}, "threads is 0", id="threads"),
    ],
)
def test_unknown_names_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        ssiam.load_tracker(**arguments)


def write(folder, backbone=None, head=None):
    for name, content in (("a_backbone.onnx", backbone), ("a_head.onnx", head)):
        if content is not None:
            (folder / name).write_bytes(content)
    return folder


@pytest.mark.parametrize(
    ("backbone", "head", "message"),
    [
        pytest.param(None, None, r"holds 0 files named \*backbone\*", id="empty folder"),
        pytest.param(b"\x08\x07", None, r"holds 0 files named \*head\*", id="no head"),
        pytest.param(b"<html>sign in</html>", b"\x08", "are a web page", id="html"),
        pytest.param(b"not a network", b"\x08", "are not an ONNX file", id="text"),
        pytest.param(b"", b"\x08", "are not an ONNX file", id="empty file"),
        pytest.param(b"\x08\x07\x12\xff\xff", b"\x08", "damaged or cut short", id="cut short"),
    ],
)
def test_bad_weights_are_named(tmp_path, backbone, head, message):
    weights = write(tmp_path, backbone, head)
    with pytest.raises(ssiam.WeightsError, match=message) as caught:
        ssiam.load_tracker("nanotrack_v2", weights=weights)
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_weights():
    with pytest.raises(ssiam.WeightsError, match="nowhere do not exist"):
        ssiam.load_tracker("nanotrack_v1", weights="nowhere")
    needed = "nanotrack_v1 needs weights: ssiam weights get nanotrack_v1;"
    with pytest.raises(ssiam.WeightsError, match=needed):
        ssiam.load_tracker("nanotrack_v1")
    needed = r"then: ssiam weights import model\.pth --tracker siammask_e"
    with pytest.raises(ssiam.WeightsError, match=needed):
        ssiam.load_tracker("siammask_e")
    with pytest.raises(ssiam.WeightsError, match="csrt has no weights"):
        ssiam.load_tracker("csrt", weights="nowhere")


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("nanotrack_v3", "nanotrackv2"),
        ("nanotrack_v2", "nanotrackv1"),
        ("nanotrack_v1", "nanotrackv2"),
    ],
)
def test_weights_of_another_network(shared, name, folder):
    with pytest.raises(ssiam.WeightsError, match=f"another network than {name}"):
        ssiam.load_tracker(name, weights=shared(f"data/weights/{folder}"))


def test_truncated_weights(shared, tmp_path):
    source = shared("data/weights/nanotrackv3")
    whole = (source / "nanotrack_backbone.onnx").read_bytes()
    write(tmp_path, whole[: len(whole) // 2], (source / "nanotrack_head.onnx").read_bytes())
    with pytest.raises(ssiam.WeightsError, match="damaged or cut short"):
        ssiam.load_tracker("nanotrack_v3", weights=tmp_path)


def test_pth_files_of_nanotrack_are_refused(shared):
    with pytest.raises(ssiam.WeightsError, match=r"nanotrackv3.pth are not an .onnx file"):
        ssiam.load_tracker(
            "nanotrack_v3", weights=shared("data/weights/nanotrackv3/nanotrackv3.pth")
        )


@pytest.mark.parametrize("version", ["v1", "v2", "v3"])
def test_nanotrack_tracks_and_repeats(shared, version):
    files = sorted(shared("data/sequences/Couple/img").iterdir())[:25]
    frames = [cv2.imread(str(file)) for file in files]
    truth = np.loadtxt(shared("data/sequences/Couple/groundtruth_rect.txt"))[:25] - (1, 1, 0, 0)
    weights = shared(f"data/weights/nanotrack{version}")
    runs = []
    first = ssiam.load_tracker(f"nanotrack_{version}", weights=weights, stabilize="off")
    for tracker in (first, first.clone()):
        tracker.init(frames[0], truth[0])
        runs.append([tracker.update(frame).box for frame in frames[1:]])
    assert runs[0] == runs[1]
    found = np.array(runs[0])
    shift = np.hypot(*(found[:, :2] + found[:, 2:] / 2 - truth[1:, :2] - truth[1:, 2:] / 2).T)
    assert shift.mean() < 8
    by_file = ssiam.load_tracker(
        f"nanotrack_{version}", weights=next(weights.glob("*head*.onnx")), stabilize="off"
    )
    by_file.init(frames[0], truth[0])
    assert by_file.update(frames[1]).box == runs[0][0]


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_int8_requires_quantized_files(shared, runtime):
    weights = shared("data/weights/nanotrackv3")
    with pytest.raises(ssiam.WeightsError, match="int8") as caught:
        ssiam.load_tracker("nanotrack_v3", weights=weights, runtime=runtime, precision="int8")
    assert "backbone" in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param({"precision": "f16"}, "openvino has no precision 'f16'", id="precision"),
        pytest.param({"device": "mps"}, "openvino has no device 'mps'", id="device"),
        pytest.param(
            {"runtime": "onnxruntime", "device": "cuda"}, "device cuda is not", id="build"
        ),
    ],
)
def test_unsupported_runtime_options_are_refused(shared, arguments, message):
    with pytest.raises(ssiam.errors.ArgumentError, match=message):
        ssiam.load_tracker("nanotrack_v3", weights=shared("data/weights/nanotrackv3"), **arguments)


def test_opencv_trackers_have_neither_precision_nor_device():
    with pytest.raises(ssiam.errors.ArgumentError, match="kcf has no network"):
        ssiam.load_tracker("kcf", precision="bf16")
