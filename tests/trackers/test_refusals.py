"""A refused call does not change the state of the object."""

import numpy as np
import pytest

import ssiam
from ssiam import ArgumentError, FrameSizeError, Motion, StabilizerConfig
from ssiam.video import open_source

BOX = (53.2, 114.1, 26.5, 66.4)
OTHER = (200.0, 90.0, 50.0, 50.0)

BAD_BOXES = [
    pytest.param(None, id="None"),
    pytest.param(np.array([BOX]), id="(1, 4)"),
    pytest.param([[1, 2], 3, 4, 5], id="ragged"),
    pytest.param("53,114,26,66", id="text"),
    pytest.param("1234", id="text of four digits"),
    pytest.param(b"1234", id="bytes"),
    pytest.param(("53", "114", "26", "66"), id="texts"),
    pytest.param({1, 2, 3, 4}, id="set"),
    pytest.param((1, 2, 3, float("nan")), id="nan"),
    pytest.param((1, 2, 3, None), id="holds None"),
    pytest.param((1, 2, 3, 4j), id="complex"),
    pytest.param((1, 2, 10**400, 5), id="beyond floats"),
    pytest.param(7, id="one number"),
    pytest.param((1, 2, 3, 4, 5), id="five numbers"),
    pytest.param((900, 900, 5, 5), id="outside"),
]
BAD_FRAMES = [
    pytest.param(None, id="None"),
    pytest.param("clip.mp4", id="text"),
    pytest.param(np.zeros((180, 320), np.uint8), id="gray"),
    pytest.param(np.zeros((180, 320, 3)), id="floats"),
    pytest.param(np.zeros((0, 320, 3), np.uint8), id="empty"),
]
BAD_MOTIONS = [
    pytest.param("shake", id="text"),
    pytest.param(np.zeros((3, 3)), id="singular"),
    pytest.param([[1, 0, 0], [0, 1]], id="ragged"),
    pytest.param(np.full((3, 3), np.nan), id="nan"),
    pytest.param(Motion.none((10, 10)), id="of another size"),
]


@pytest.fixture(scope="module")
def frames(request):
    with open_source(request.config.rootpath / "examples" / "shaky-walker.mp4") as source:
        return [frame.image for frame, _ in zip(source, range(8), strict=False)]


def content(track):
    view = None if track.stab_from_raw is None else track.stab_from_raw.tolist()
    return track.box, track.score, track.lost, view


@pytest.fixture(params=["lite", "kcf", "csrt"])
def name(request):
    return request.param


@pytest.fixture(params=["predict", "paper", "off"])
def stabilize(request):
    return request.param


def started_pair(frames, stabilize="predict", name="lite"):
    """Two trackers after two frames. The tests call the first one with refused arguments."""
    first = ssiam.load_tracker(name, stabilize=stabilize)
    pair = first, first.clone()
    for each in pair:
        each.init(frames[0], BOX)
        each.update(frames[1])
    return pair


def assert_equal_updates(pair, frames, **options):
    for frame in frames[2:5]:
        first, second = (content(each.update(frame, **options)) for each in pair)
        assert first == second


def refused(call, *arguments, error=ArgumentError, **options):
    with pytest.raises(error) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("box", BAD_BOXES)
def test_a_refused_box(frames, box):
    pair = started_pair(frames, name="kcf")
    refused(pair[0].init, frames[1], box)
    assert_equal_updates(pair, frames)


def test_a_refused_init_of_each_tracker(frames, name, stabilize):
    pair = started_pair(frames, stabilize, name)
    refused(pair[0].init, np.zeros((100, 100, 3), np.uint8), (500, 500, 10, 10))
    refused(pair[0].init, None, BOX)
    assert_equal_updates(pair, frames)


@pytest.mark.parametrize("frame", BAD_FRAMES)
def test_a_refused_frame(frames, stabilize, frame):
    pair = started_pair(frames, stabilize, "kcf")
    for call in (
        lambda: pair[0].update(frame),
        lambda: pair[0].init(frame, BOX),
        lambda: pair[0].switch(StabilizerConfig("literal"), frame),
    ):
        refused(call)
    if frame is not None:
        refused(pair[0].update, frames[2], following=frame)
    assert pair[0].config == pair[1].config
    assert_equal_updates(pair, frames)


@pytest.mark.parametrize("motion", BAD_MOTIONS)
def test_a_refused_motion(frames, stabilize, motion):
    pair = started_pair(frames, stabilize, "kcf")
    refused(pair[0].update, frames[2], motion=motion)
    assert_equal_updates(pair, frames)


def test_a_refused_frame_of_another_size(frames, stabilize):
    pair = started_pair(frames, stabilize, "kcf")
    small = np.zeros((90, 160, 3), np.uint8)
    refused(pair[0].update, small, error=FrameSizeError)
    refused(pair[0].switch, StabilizerConfig("predict"), small, error=FrameSizeError)
    assert_equal_updates(pair, frames)


def test_a_following_frame_of_another_size_is_ignored(frames):
    pair = started_pair(frames, name="kcf")
    small = np.zeros((90, 160, 3), np.uint8)
    assert content(pair[0].update(frames[2], following=small)) == content(pair[1].update(frames[2]))
    refused(pair[0].update, small, error=FrameSizeError)
    assert content(pair[0].update(frames[3])) == content(pair[1].update(frames[3]))


def test_another_frame_than_the_following_one(frames):
    pair = started_pair(frames, name="kcf")
    for each in pair:
        each.update(frames[2], following=frames[3])
    refused(pair[0].update, frames[5])
    for frame in frames[3:6]:
        first, second = (content(each.update(frame)) for each in pair)
        assert first == second


def test_a_switch_to_an_invalid_config(frames):
    pair = started_pair(frames, name="kcf")
    for config in (None, "paper", 3):
        refused(pair[0].switch, config, frames[1])
    assert pair[0].config == pair[1].config
    assert_equal_updates(pair, frames)
    refused(ssiam.StabilizedTracker, pair[0], "paper")


def group_pair(frames, stabilize="predict"):
    pair = [ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize=stabilize)) for _ in range(2)]
    for each in pair:
        each.init(frames[0], [BOX, OTHER])
        each.update(frames[1])
    return pair


def assert_equal_group_updates(pair, frames):
    for frame in frames[2:5]:
        first, second = ([content(track) for track in each.update(frame)] for each in pair)
        assert first == second
        assert len(first) == 2


@pytest.mark.parametrize("box", BAD_BOXES)
def test_a_group_with_a_refused_box(frames, box):
    pair = group_pair(frames)
    refused(pair[0].init, frames[1], [BOX, box])
    if not (isinstance(box, tuple) and len(box) == 4 and None not in box):
        refused(pair[0].join, new_tracker(pair[0], frames), box)
    assert_equal_group_updates(pair, frames)


def new_tracker(group, frames):
    tracker = group.new_tracker()
    tracker.init(frames[1], BOX)
    return tracker


@pytest.mark.parametrize("boxes", [BOX, None, "53,114,26,66", 5, {1: BOX}, np.array(BOX)])
def test_a_group_with_an_invalid_list_of_boxes(frames, boxes):
    pair = group_pair(frames)
    refused(pair[0].init, frames[1], boxes)
    assert_equal_group_updates(pair, frames)


def test_a_box_that_only_the_tracker_refuses(frames):
    """CSRT cannot start on the second box, after the first one has been started."""
    pair = [ssiam.TrackerGroup(ssiam.load_tracker("csrt")) for _ in range(2)]
    for each in pair:
        each.init(frames[0], [BOX, OTHER])
    refused(pair[0].init, frames[1], [OTHER, (5, 5, 280, 2)])
    assert_equal_group_updates(pair, frames)


@pytest.mark.parametrize("frame", BAD_FRAMES)
def test_a_group_and_a_refused_frame(frames, stabilize, frame):
    pair = group_pair(frames, stabilize)
    refused(pair[0].update, frame)
    refused(pair[0].init, frame, [BOX])
    refused(pair[0].switch, StabilizerConfig("literal"), frame)
    refused(pair[0].switch, "literal", frames[1])
    refused(pair[0].update, np.zeros((90, 160, 3), np.uint8), error=FrameSizeError)
    assert_equal_group_updates(pair, frames)


def test_refused_joins_and_leaves(frames):
    pair = group_pair(frames)
    joined = new_tracker(pair[0], frames)
    pair[0].join(joined, BOX)
    refused(pair[0].join, joined, BOX)
    pair[0].leave(joined)
    refused(pair[0].leave, joined)
    refused(pair[0].join, pair[0].new_tracker(), BOX)
    refused(pair[0].join, None, BOX)
    other = ssiam.load_tracker("kcf", stabilize="off")
    other.init(frames[1], BOX)
    refused(pair[0].join, other, BOX)
    assert_equal_group_updates(pair, frames)


def test_a_group_without_init(frames):
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf"))
    with pytest.raises(ArgumentError, match="no target yet"):
        group.update(frames[0])
    with pytest.raises(ArgumentError, match="no target yet"):
        group.join(new_tracker(group, frames), BOX)
    refused(group.init, frames[0], [None])
    with pytest.raises(ArgumentError, match="no target yet"):
        group.update(frames[0])


def test_a_group_does_not_change_its_prototype(frames):
    pair = started_pair(frames, name="kcf")
    ssiam.TrackerGroup(pair[0]).init(frames[3], [OTHER])
    assert_equal_updates(pair, frames)


@pytest.mark.parametrize("keypoints", ["direct", "orb"])
def test_camera_motion(frames, keypoints):
    first, second = ssiam.CameraMotion(keypoints), ssiam.CameraMotion(keypoints)
    small = np.zeros((90, 160, 3), np.uint8)
    refused(first.update, small, exclude="walker")  # must not fix the size of the stream
    refused(first.update, small, motion="shake")
    for camera in (first, second):
        camera.update(frames[0])
    for exclude in ("walker", (1, 2, 3), [[1, 2], [3]], np.ones((2, 2)), (1, 2, 3, np.nan)):
        refused(first.update, frames[5], exclude=exclude)
    for motion in BAD_MOTIONS:
        refused(first.update, frames[5], motion=motion.values[0])
    for frame in BAD_FRAMES:
        if np.ndim(frame.values[0]) != 2:  # gray
            refused(first.update, frame.values[0])
    refused(first.update, small, error=FrameSizeError)
    for frame in frames[1:4]:
        np.testing.assert_array_equal(
            first.update(frame).cur_from_prev, second.update(frame).cur_from_prev
        )


@pytest.mark.parametrize(
    "values",
    [
        {"window": "30"},
        {"window": 2.5},
        {"window": 0},
        {"border": 1.5},
        {"border": None},
        {"border": float("nan")},
        {"gate": float("nan")},
        {"gate": "0.1"},
        {"tha": [0.3]},
        {"memory": float("nan")},
        {"memory": None},
        {"find": "no"},
        {"turn": 1},
        {"stabilize": None},
        {"keypoints": 3},
        {"fit": ["robust"]},
    ],
)
def test_invalid_settings(values):
    (name,) = values
    with pytest.raises(ArgumentError, match=name):
        StabilizerConfig().with_options(**values)


@pytest.mark.parametrize("motion", [None, np.eye(3), "shake"])
def test_a_stabilizer_and_an_invalid_motion(motion):
    first, second = (
        ssiam.Stabilizer(StabilizerConfig("paper")),
        ssiam.Stabilizer(StabilizerConfig("paper")),
    )
    steps = [Motion.from_transform([[1, 0, 3.0 * k], [0, 1, -2]], (320, 180)) for k in range(3)]
    for step in steps:
        refused(first.update, motion)
        np.testing.assert_array_equal(first.update(step), second.update(step))
    refused(ssiam.Stabilizer, "paper")
