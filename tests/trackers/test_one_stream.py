"""One-stream trackers: generated networks of each form, and descriptions that are refused."""

import numpy as np
import pytest

pytest.importorskip("onnx")

import ssiam
from helpers.one_stream_networks import INPUTS, TOML, write_one_stream
from ssiam import FrameView
from ssiam.errors import ArgumentError, SsiamError, WeightsError
from ssiam.geometry import map_box, rigid
from ssiam.runtime.files import weights_sha256
from ssiam.trackers import weights_path

SIZE = (320, 240)
BOX = (100.0, 80.0, 40.0, 40.0)
VIEWS = [np.eye(3), rigid(12, -9, 0.1)]


def frame(box):
    """A dark frame with a bright, textured square."""
    random = np.random.default_rng(3)
    image = random.integers(0, 60, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    x, y, w, h = (round(number) for number in box)
    image[y : y + h, x : x + w] = random.integers(180, 256, (h, w, 3))
    return image


def moved(step):
    x, y, w, h = BOX
    return x + 5 * step, y + 4 * step, w, h


def view_tracker(folder, **options):
    return ssiam.load_tracker("one_stream", weights=folder, stabilize="off", **options).view_tracker


def center_distance(box, truth):
    (x, y, w, h), (u, v, p, q) = box, truth
    return np.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2)


@pytest.mark.parametrize("kind", INPUTS)
@pytest.mark.parametrize("stab_from_raw", VIEWS, ids=["raw", "stabilized"])
def test_a_network_of_each_form_tracks(kind, stab_from_raw, tmp_path):
    tracker = view_tracker(write_one_stream(tmp_path, kind))
    tracker.init(FrameView(frame(BOX), stab_from_raw, 20), map_box(stab_from_raw, BOX))
    for step in range(1, 6):
        truth = moved(step)
        track = tracker.update(FrameView(frame(truth), stab_from_raw, 20))
        assert center_distance(track.box, map_box(stab_from_raw, truth)) < 8
        assert track.box[2:] == pytest.approx((40, 40), abs=1)
        assert 0 < track.score <= 1
    assert not tracker.score_is_calibrated


@pytest.mark.parametrize("kind", INPUTS)
def test_runtimes_give_the_same_boxes(kind, tmp_path):
    pytest.importorskip("onnxruntime")
    folder, boxes = write_one_stream(tmp_path, kind), []
    for runtime in ("openvino", "onnxruntime"):
        tracker = view_tracker(folder, runtime=runtime)
        tracker.init(FrameView(frame(BOX)), BOX)
        boxes.append([tracker.update(FrameView(frame(moved(step)))).box for step in (1, 2)])
    np.testing.assert_allclose(boxes[0], boxes[1], atol=1e-2)


def test_seek_and_clones(tmp_path):
    tracker = view_tracker(write_one_stream(tmp_path, "ostrack"))
    with pytest.raises(ArgumentError, match="no target yet"):
        tracker.update(FrameView(frame(BOX)))
    tracker.init(FrameView(frame(BOX)), BOX)
    far = (240.0, 150.0, 40.0, 40.0)
    found = tracker.seek(FrameView(frame(far)), (220.0, 140.0, 40.0, 40.0))
    assert center_distance(found.box, far) < 8
    cloned = tracker.clone()
    cloned.init(FrameView(frame(BOX)), BOX)
    assert center_distance(tracker.update(FrameView(frame(far))).box, far) < 8


def recorded(tracker):
    """The inputs of the tracker's network from now on."""
    calls, network = [], tracker._network.network

    def call(*inputs):
        calls.append(inputs)
        return network(*inputs)

    object.__setattr__(tracker._network, "network", call)
    return calls


def test_the_recent_template_is_replaced_after_the_interval(tmp_path):
    tracker = view_tracker(write_one_stream(tmp_path, "mixformer"))
    calls = recorded(tracker)
    tracker.init(FrameView(frame(BOX)), BOX)
    for step in range(1, 5):
        tracker.update(FrameView(frame(moved(step))))
    is_first = [np.array_equal(template, recent) for template, recent, _ in calls]
    assert is_first == [True, True, False, False]
    assert not np.array_equal(calls[2][1], calls[0][1])


def test_a_network_gets_the_pixels_that_are_described(tmp_path):
    tracker = view_tracker(write_one_stream(tmp_path, "sutrack"))
    calls = recorded(tracker)
    image = frame(BOX)
    tracker.init(FrameView(image), BOX)
    tracker.update(FrameView(image))
    ((template, search, box),) = calls
    # The template crop is two target sides wide: the target is its central half.
    np.testing.assert_allclose(box, [[0.25, 0.25, 0.5, 0.5]])
    np.testing.assert_array_equal(template[:, :3], template[:, 3:])
    crop = FrameView(image).crop((80, 60, 80, 80), (112, 112)).image[..., ::-1] / 255
    expected = (crop - (0.485, 0.456, 0.406)) / (0.229, 0.224, 0.225)
    np.testing.assert_allclose(template[0, :3], expected.transpose(2, 0, 1), atol=1e-5)
    assert search.shape == (1, 6, 224, 224)


WRONG = {
    "unknown key": ('netwrok = "net.onnx"', "unknown key netwrok; did you mean network?"),
    "no network": ("template_side = 9", "network is missing"),
    "another folder": ('network = "../net.onnx"', "name an .onnx file in this folder"),
    "no file": ('network = "other.onnx"', "other.onnx do not exist"),
    "no search": ('network = "net.onnx"\ninputs = ["template"]', 'need "template" and "search"'),
    "unknown input": ('network = "net.onnx"\ninputs = ["x"]', "inputs[0] is 'x': choose from"),
    "twice": ('network = "net.onnx"\noutputs = ["box", "box"]', "outputs has a name twice"),
    "one map": ('network = "net.onnx"\noutputs = ["score_map"]', "give all three maps"),
    "no box": ('network = "net.onnx"\noutputs = ["score"]', 'outputs need "box", or'),
    "large": ('network = "net.onnx"\nsearch_side = 100000', "search_side is 100000: give 1 to"),
    "no factor": ('network = "net.onnx"\nsearch_factor = 0.0', "search_factor is 0.0: give a num"),
    "nan": ('network = "net.onnx"\ntemplate_factor = nan', "template_factor is nan"),
    "deviation": ('network = "net.onnx"\ndeviation = [1, 0, 1]', "deviation[1] is 0.0"),
    "mean": ('network = "net.onnx"\nmean = [1, nan, 1]', "mean[1] is nan: give a finite number"),
    "window": ('network = "net.onnx"\nwindow = 2.0', "window is 2.0: give 0 to 1"),
    "copies": ('network = "net.onnx"\ncopies = 100', "copies is 100: give 1 to 8"),
    "two means": ('network = "net.onnx"\nmean = [1, 2]', "mean has 2 values: give 3"),
    "other sides": ('network = "net.onnx"\nsearch_side = 224', "the description says"),
    "other outputs": (
        'network = "net.onnx"\noutputs = ["box"]',
        "has 3 outputs, the description 1",
    ),
    "other maps": (
        'network = "net.onnx"\noutputs = ["size_map", "score_map", "offset_map"]',
        "size_map is (1, 1, 16, 16), expected (1, 2, 16, 16)",
    ),
    "not a box": ('network = "net.onnx"\noutputs = ["box", "score", "unused"]', "box is (1, 1, 16"),
    "no TOML": ("[", "not valid TOML"),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_description_is_one_line(text, message, tmp_path):
    folder = write_one_stream(tmp_path, "ostrack")
    (folder / "tracker.toml").write_text(text)
    with pytest.raises(SsiamError) as raised:
        view_tracker(folder)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_the_description_is_a_file_or_the_only_one_of_a_folder(tmp_path):
    folder = write_one_stream(tmp_path / "net", "ostrack")
    view_tracker(folder / "tracker.toml")
    (folder / "second.toml").write_text(TOML["ostrack"])
    for wrong in (folder, tmp_path, tmp_path / "missing", folder / "net.onnx"):
        with pytest.raises(WeightsError, match=r"give the \.toml file that describes"):
            view_tracker(wrong)
    with pytest.raises(WeightsError, match="tracker one_stream needs weights"):
        ssiam.load_tracker("one_stream")
    with pytest.raises(ArgumentError, match="leave distractors out"):
        view_tracker(folder / "tracker.toml", distractors=True)


def test_the_digest_of_the_weights_includes_the_description(tmp_path):
    folder = write_one_stream(tmp_path, "ostrack")
    path = weights_path("one_stream", folder)
    assert path == folder / "tracker.toml"
    before = weights_sha256(path)
    path.write_text(TOML["ostrack"] + "search_factor = 5.0\n")
    assert weights_sha256(path) != before
