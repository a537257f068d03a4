"""Public classes document their thread safety; copies and pickles are independent."""

import copy
import importlib
import inspect
import pickle
import re

import numpy as np
import pytest

import ssiam
from ssiam.motion import KEYPOINTS, PrefetchingCameraMotion
from ssiam.video import VideoSink, open_results, open_source

NAMES = "motion stabilize runtime networks trackers video render exchange datasets training web"
PACKAGES = ["ssiam", *(f"ssiam.{name}" for name in NAMES.split())]
BOX = (53.2, 114.1, 26.5, 66.4)
COPIES = [copy.copy, copy.deepcopy]


def public_classes():
    for package in PACKAGES:
        try:
            module = importlib.import_module(package)
        except ssiam.MissingExtraError:
            continue
        for name in module.__all__:
            found = getattr(module, name)
            if inspect.isclass(found) and found.__module__.startswith("ssiam"):
                yield pytest.param(found, id=f"{package}.{name}")


@pytest.mark.parametrize("public", list(public_classes()))
def test_thread_safety_is_documented(public):
    if not issubclass(public, BaseException):
        assert re.search(r"^ *Threads: \S", vars(public)["__doc__"], re.MULTILINE)


@pytest.fixture(scope="module")
def clip(request):
    return request.config.rootpath / "examples" / "shaky-walker.mp4"


@pytest.fixture(scope="module")
def frames(clip):
    with open_source(clip) as source:
        return [frame.image for frame, _ in zip(source, range(8), strict=False)]


def values(track):
    return track.box, track.score, track.stab_from_raw.tolist()


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize("stabilize", ["predict", "paper"])
@pytest.mark.parametrize("prefetched", [False, True])
def test_a_tracker_and_its_copy_are_independent(frames, copied, stabilize, prefetched):
    tracker = ssiam.load_tracker(stabilize=stabilize)
    tracker.init(frames[0], BOX)
    tracker.update(frames[1], following=frames[2] if prefetched else None)
    twin = copied(tracker)
    expected = [values(tracker.update(frame)) for frame in frames[2:]]
    assert [values(twin.update(frame)) for frame in frames[2:]] == expected


@pytest.mark.parametrize("copied", COPIES)
def test_a_group_and_its_copy_are_independent(frames, copied):
    group = ssiam.TrackerGroup(ssiam.load_tracker())
    group.init(frames[0], [BOX, (200, 60, 40, 40)])
    group.update(frames[1])
    twin = copied(group)
    expected = [[values(track) for track in group.update(frame)] for frame in frames[2:5]]
    assert [[values(track) for track in twin.update(frame)] for frame in frames[2:5]] == expected


def pickled(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("copied", [*COPIES, pickled])
@pytest.mark.parametrize("keypoints", KEYPOINTS)
def test_camera_motion_and_its_copy_are_independent(frames, copied, keypoints):
    camera = ssiam.CameraMotion(keypoints)
    for frame in frames[:3]:
        camera.update(frame)
    twin = copied(camera)
    expected = [camera.update(frame).cur_from_prev.tolist() for frame in frames[3:]]
    assert [twin.update(frame).cur_from_prev.tolist() for frame in frames[3:]] == expected


@pytest.mark.parametrize("copied", [*COPIES, pickled])
def test_a_stabilizer_and_its_copy_are_independent(copied):
    motions = [
        ssiam.Motion.from_transform([[1, 0, 4.0 * k], [0, 1, -2]], (320, 180)) for k in range(6)
    ]
    stabilizer = ssiam.Stabilizer(ssiam.StabilizerConfig("paper"))
    for motion in motions[:3]:
        stabilizer.update(motion)
    twin = copied(stabilizer)
    expected = [stabilizer.update(motion).tolist() for motion in motions[3:]]
    assert [twin.update(motion).tolist() for motion in motions[3:]] == expected


@pytest.mark.parametrize("copied", [*COPIES, pickled])
def test_values_can_be_copied_and_pickled(frames, copied):
    tracker = ssiam.load_tracker()
    tracker.init(frames[0], BOX)
    track = tracker.update(frames[1])
    same = copied(track)
    assert values(same) == values(track)
    np.testing.assert_array_equal(same.mask, track.mask)
    assert same.motion.cur_from_prev.tolist() == track.motion.cur_from_prev.tolist()
    assert copied(tracker.config) == tracker.config
    view = ssiam.FrameView(frames[1], track.stab_from_raw, 20)
    np.testing.assert_array_equal(copied(view).render(), view.render())


def assert_refused(call, value):
    with pytest.raises(ssiam.CopyError, match=r"^[^\n]* cannot be [^\n]*: [^\n]*$"):
        call(value)


@pytest.mark.parametrize("name", ["lite", "kcf"])
def test_trackers_cannot_be_pickled(frames, name):
    tracker = ssiam.load_tracker(name)
    for value in (tracker, ssiam.TrackerGroup(tracker), tracker.new_camera()):
        assert_refused(pickled, value)
    tracker.init(frames[0], BOX)
    assert_refused(pickled, tracker)


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize("name", ["csrt", "kcf", "mil"])
def test_opencv_trackers_can_only_be_copied_without_a_target(frames, copied, name):
    tracker = ssiam.load_tracker(name)
    copied(tracker).init(frames[0], BOX)
    assert not tracker.has_target
    tracker.init(frames[0], BOX)
    assert_refused(copied, tracker)


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_a_copied_network_is_the_same_object(runtime):
    pytest.importorskip(runtime)
    from ssiam.runtime import load_network
    from ssiam.trackers.lite import SHIPPED

    network = load_network(SHIPPED / "template.onnx", runtime=runtime)
    assert all(copied(network) is network for copied in COPIES)
    assert_refused(pickled, network)


@pytest.mark.parametrize("copied", COPIES)
def test_a_prefetching_camera_and_its_copy_are_independent(frames, copied):
    camera = PrefetchingCameraMotion(ssiam.CameraMotion())
    camera.update(frames[0])
    camera.start(frames[1])
    twin = copied(camera)
    expected = [camera.update(frame).cur_from_prev.tolist() for frame in frames[1:4]]
    assert [twin.update(frame).cur_from_prev.tolist() for frame in frames[1:4]] == expected


@pytest.mark.parametrize("call", [*COPIES, pickled])
def test_objects_with_open_files_cannot_be_copied_or_pickled(clip, tmp_path, call):
    with open_source(clip) as source:
        assert_refused(call, source)
    assert_refused(call, open_results(tmp_path / "boxes.csv"))
    assert_refused(call, VideoSink(tmp_path / "out.mp4", 25))
