"""Every public class says what threads may do with it, and copies and pickles are sound."""

import copy
import importlib
import inspect
import pickle
import re

import numpy as np
import pytest

import ssiam
from ssiam.motion import KEYPOINTS, MotionAhead
from ssiam.video import VideoSink, open_results, open_source

ROOMS = "motion stabilize runtime networks trackers video exchange datasets training web"
PACKAGES = ["ssiam", *(f"ssiam.{room}" for room in ROOMS.split(" "))]
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
def test_it_says_what_threads_may_do(public):
    if not issubclass(public, BaseException):
        assert re.search(r"^ *Threads: \S", vars(public)["__doc__"], re.MULTILINE)


@pytest.fixture(scope="module")
def clip(request):
    return request.config.rootpath / "examples" / "shaky-walker.mp4"


@pytest.fixture(scope="module")
def frames(clip):
    with open_source(clip) as source:
        return [frame.image for frame, _ in zip(source, range(8), strict=False)]


def told(track):
    return track.box, track.score, track.stab_from_raw.tolist()


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize("stabilize", ["predict", "paper"])
@pytest.mark.parametrize("announced", [False, True])
def test_a_tracker_and_its_copy_go_on_by_themselves(frames, copied, stabilize, announced):
    tracker = ssiam.load_tracker(stabilize=stabilize)
    tracker.init(frames[0], BOX)
    tracker.update(frames[1], following=frames[2] if announced else None)
    twin = copied(tracker)
    expected = [told(tracker.update(frame)) for frame in frames[2:]]
    assert [told(twin.update(frame)) for frame in frames[2:]] == expected


@pytest.mark.parametrize("copied", COPIES)
def test_a_group_and_its_copy_go_on_by_themselves(frames, copied):
    group = ssiam.TrackerGroup(ssiam.load_tracker())
    group.init(frames[0], [BOX, (200, 60, 40, 40)])
    group.update(frames[1])
    twin = copied(group)
    expected = [[told(track) for track in group.update(frame)] for frame in frames[2:5]]
    assert [[told(track) for track in twin.update(frame)] for frame in frames[2:5]] == expected


def pickled(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("copied", [*COPIES, pickled])
@pytest.mark.parametrize("keypoints", KEYPOINTS)
def test_camera_motion_and_its_copy_go_on_by_themselves(frames, copied, keypoints):
    camera = ssiam.CameraMotion(keypoints)
    for frame in frames[:3]:
        camera.update(frame)
    twin = copied(camera)
    expected = [camera.update(frame).cur_from_prev.tolist() for frame in frames[3:]]
    assert [twin.update(frame).cur_from_prev.tolist() for frame in frames[3:]] == expected


@pytest.mark.parametrize("copied", [*COPIES, pickled])
def test_a_stabilizer_and_its_copy_go_on_by_themselves(copied):
    motions = [ssiam.Motion.given([[1, 0, 4.0 * k], [0, 1, -2]], (320, 180)) for k in range(6)]
    stabilizer = ssiam.Stabilizer(ssiam.StabilizerConfig("paper"))
    for motion in motions[:3]:
        stabilizer.update(motion)
    twin = copied(stabilizer)
    expected = [stabilizer.update(motion).tolist() for motion in motions[3:]]
    assert [twin.update(motion).tolist() for motion in motions[3:]] == expected


@pytest.mark.parametrize("copied", [*COPIES, pickled])
def test_values_are_copied_and_pickled(frames, copied):
    tracker = ssiam.load_tracker()
    tracker.init(frames[0], BOX)
    track = tracker.update(frames[1])
    same = copied(track)
    assert told(same) == told(track)
    np.testing.assert_array_equal(same.mask, track.mask)
    assert same.motion.cur_from_prev.tolist() == track.motion.cur_from_prev.tolist()
    assert copied(tracker.config) == tracker.config
    view = ssiam.FrameView(frames[1], track.stab_from_raw, 20)
    np.testing.assert_array_equal(copied(view).render(), view.render())


def refuses(call, value):
    with pytest.raises(ssiam.CopyError, match=r"^[^\n]* cannot be [^\n]*: [^\n]*$"):
        call(value)


@pytest.mark.parametrize("name", ["lite", "kcf"])
def test_trackers_are_not_pickled(frames, name):
    tracker = ssiam.load_tracker(name)
    for value in (tracker, ssiam.TrackerGroup(tracker), tracker.new_camera()):
        refuses(pickled, value)
    tracker.init(frames[0], BOX)
    refuses(pickled, tracker)


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize("name", ["csrt", "kcf", "mil"])
def test_opencvs_trackers_are_copied_without_a_target_only(frames, copied, name):
    tracker = ssiam.load_tracker(name)
    copied(tracker).init(frames[0], BOX)
    assert not tracker.has_target
    tracker.init(frames[0], BOX)
    refuses(copied, tracker)


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_copies_of_networks_are_the_networks(runtime):
    pytest.importorskip(runtime)
    from ssiam.runtime import load_network
    from ssiam.trackers.lite import SHIPPED

    network = load_network(SHIPPED / "template.onnx", runtime=runtime)
    assert all(copied(network) is network for copied in COPIES)
    refuses(pickled, network)


@pytest.mark.parametrize("copied", COPIES)
def test_a_camera_that_works_ahead(frames, copied):
    camera = MotionAhead(ssiam.CameraMotion())
    camera.update(frames[0])
    camera.start(frames[1])
    twin = copied(camera)
    expected = [camera.update(frame).cur_from_prev.tolist() for frame in frames[1:4]]
    assert [twin.update(frame).cur_from_prev.tolist() for frame in frames[1:4]] == expected


@pytest.mark.parametrize("call", [*COPIES, pickled])
def test_what_holds_a_file_is_neither_copied_nor_pickled(clip, tmp_path, call):
    with open_source(clip) as source:
        refuses(call, source)
    refuses(call, open_results(tmp_path / "boxes.csv"))
    refuses(call, VideoSink(tmp_path / "out.mp4", 25))
