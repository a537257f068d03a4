"""A call that is refused leaves everything as it was."""

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
    pytest.param(np.zeros((180, 320), np.uint8), id="grey"),
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


def told(track):
    view = None if track.stab_from_raw is None else track.stab_from_raw.tolist()
    return track.box, track.score, track.lost, view


@pytest.fixture(params=["lite", "kcf", "csrt"])
def name(request):
    return request.param


@pytest.fixture(params=["predict", "paper", "off"])
def stabilize(request):
    return request.param


def begun(frames, stabilize="predict", name="lite"):
    """Two trackers that have seen two frames; one is asked for what it refuses, the other not."""
    first = ssiam.load_tracker(name, stabilize=stabilize)
    pair = first, first.clone()
    for each in pair:
        each.init(frames[0], BOX)
        each.update(frames[1])
    return pair


def go_on_alike(pair, frames, **options):
    for frame in frames[2:5]:
        asked, alone = (told(each.update(frame, **options)) for each in pair)
        assert asked == alone


def refused(call, *arguments, error=ArgumentError, **options):
    with pytest.raises(error) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("box", BAD_BOXES)
def test_a_refused_box(frames, box):
    pair = begun(frames, name="kcf")
    refused(pair[0].init, frames[1], box)
    go_on_alike(pair, frames)


def test_a_refused_init_of_each_tracker(frames, name, stabilize):
    pair = begun(frames, stabilize, name)
    refused(pair[0].init, np.zeros((100, 100, 3), np.uint8), (500, 500, 10, 10))
    refused(pair[0].init, None, BOX)
    go_on_alike(pair, frames)


@pytest.mark.parametrize("frame", BAD_FRAMES)
def test_a_refused_frame(frames, stabilize, frame):
    pair = begun(frames, stabilize, "kcf")
    for call in (
        lambda: pair[0].update(frame),
        lambda: pair[0].init(frame, BOX),
        lambda: pair[0].switch(StabilizerConfig("literal"), frame),
    ):
        refused(call)
    if frame is not None:
        refused(pair[0].update, frames[2], following=frame)
    assert pair[0].config == pair[1].config
    go_on_alike(pair, frames)


@pytest.mark.parametrize("motion", BAD_MOTIONS)
def test_a_refused_motion(frames, stabilize, motion):
    pair = begun(frames, stabilize, "kcf")
    refused(pair[0].update, frames[2], motion=motion)
    go_on_alike(pair, frames)


def test_a_refused_frame_of_another_size(frames, stabilize):
    pair = begun(frames, stabilize, "kcf")
    small = np.zeros((90, 160, 3), np.uint8)
    refused(pair[0].update, small, error=FrameSizeError)
    refused(pair[0].switch, StabilizerConfig("predict"), small, error=FrameSizeError)
    go_on_alike(pair, frames)


def test_a_frame_of_another_size_that_was_announced_is_no_hindrance(frames):
    pair = begun(frames, name="kcf")
    small = np.zeros((90, 160, 3), np.uint8)
    assert told(pair[0].update(frames[2], following=small)) == told(pair[1].update(frames[2]))
    refused(pair[0].update, small, error=FrameSizeError)
    assert told(pair[0].update(frames[3])) == told(pair[1].update(frames[3]))


def test_another_frame_than_the_announced_one(frames):
    pair = begun(frames, name="kcf")
    for each in pair:
        each.update(frames[2], following=frames[3])
    refused(pair[0].update, frames[5])
    for frame in frames[3:6]:
        asked, alone = (told(each.update(frame)) for each in pair)
        assert asked == alone


def test_a_switch_to_what_is_no_config(frames):
    pair = begun(frames, name="kcf")
    for config in (None, "paper", 3):
        refused(pair[0].switch, config, frames[1])
    assert pair[0].config == pair[1].config
    go_on_alike(pair, frames)
    refused(ssiam.StabilizedTracker, pair[0], "paper")


def groups(frames, stabilize="predict"):
    pair = [ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize=stabilize)) for _ in range(2)]
    for each in pair:
        each.init(frames[0], [BOX, OTHER])
        each.update(frames[1])
    return pair


def groups_go_on_alike(pair, frames):
    for frame in frames[2:5]:
        asked, alone = ([told(track) for track in each.update(frame)] for each in pair)
        assert asked == alone
        assert len(asked) == 2


@pytest.mark.parametrize("box", BAD_BOXES)
def test_a_group_with_a_refused_box(frames, box):
    pair = groups(frames)
    refused(pair[0].init, frames[1], [BOX, box])
    if not (isinstance(box, tuple) and len(box) == 4 and None not in box):
        refused(pair[0].join, late(pair[0], frames), box)
    groups_go_on_alike(pair, frames)


def late(group, frames):
    tracker = group.new_tracker()
    tracker.init(frames[1], BOX)
    return tracker


@pytest.mark.parametrize("boxes", [BOX, None, "53,114,26,66", 5, {1: BOX}, np.array(BOX)])
def test_what_is_no_list_of_boxes(frames, boxes):
    pair = groups(frames)
    refused(pair[0].init, frames[1], boxes)
    groups_go_on_alike(pair, frames)


def test_a_box_that_only_the_tracker_refuses(frames):
    """CSRT cannot start on it: the target before has begun anew by then."""
    pair = [ssiam.TrackerGroup(ssiam.load_tracker("csrt")) for _ in range(2)]
    for each in pair:
        each.init(frames[0], [BOX, OTHER])
    refused(pair[0].init, frames[1], [OTHER, (5, 5, 280, 2)])
    groups_go_on_alike(pair, frames)


@pytest.mark.parametrize("frame", BAD_FRAMES)
def test_a_group_and_a_refused_frame(frames, stabilize, frame):
    pair = groups(frames, stabilize)
    refused(pair[0].update, frame)
    refused(pair[0].init, frame, [BOX])
    refused(pair[0].switch, StabilizerConfig("literal"), frame)
    refused(pair[0].switch, "literal", frames[1])
    refused(pair[0].update, np.zeros((90, 160, 3), np.uint8), error=FrameSizeError)
    groups_go_on_alike(pair, frames)


def test_trackers_that_may_not_join_or_leave(frames):
    pair = groups(frames)
    joined = late(pair[0], frames)
    pair[0].join(joined, BOX)
    refused(pair[0].join, joined, BOX)
    pair[0].leave(joined)
    refused(pair[0].leave, joined)
    refused(pair[0].join, pair[0].new_tracker(), BOX)
    refused(pair[0].join, None, BOX)
    other = ssiam.load_tracker("kcf", stabilize="off")
    other.init(frames[1], BOX)
    refused(pair[0].join, other, BOX)
    groups_go_on_alike(pair, frames)


def test_an_empty_group_says_so(frames):
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf"))
    with pytest.raises(ArgumentError, match="no target yet"):
        group.update(frames[0])
    with pytest.raises(ArgumentError, match="no target yet"):
        group.join(late(group, frames), BOX)
    refused(group.init, frames[0], [None])
    with pytest.raises(ArgumentError, match="no target yet"):
        group.update(frames[0])


def test_a_group_leaves_the_tracker_that_it_was_made_from(frames):
    pair = begun(frames, name="kcf")
    ssiam.TrackerGroup(pair[0]).init(frames[3], [OTHER])
    go_on_alike(pair, frames)


@pytest.mark.parametrize("keypoints", ["direct", "orb"])
def test_camera_motion(frames, keypoints):
    asked, alone = ssiam.CameraMotion(keypoints), ssiam.CameraMotion(keypoints)
    small = np.zeros((90, 160, 3), np.uint8)
    refused(asked.update, small, exclude="walker")  # or the stream would be of that size
    refused(asked.update, small, motion="shake")
    for camera in (asked, alone):
        camera.update(frames[0])
    for exclude in ("walker", (1, 2, 3), [[1, 2], [3]], np.ones((2, 2)), (1, 2, 3, np.nan)):
        refused(asked.update, frames[5], exclude=exclude)
    for motion in BAD_MOTIONS:
        refused(asked.update, frames[5], motion=motion.values[0])
    for frame in BAD_FRAMES:
        refused(asked.update, frame.values[0])
    refused(asked.update, small, error=FrameSizeError)
    for frame in frames[1:4]:
        np.testing.assert_array_equal(
            asked.update(frame).cur_from_prev, alone.update(frame).cur_from_prev
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
def test_settings_that_are_no_settings(values):
    (name,) = values
    with pytest.raises(ArgumentError, match=name):
        StabilizerConfig(**values)


@pytest.mark.parametrize("motion", [None, np.eye(3), "shake"])
def test_a_stabilizer_and_what_is_no_motion(motion):
    asked, alone = (
        ssiam.Stabilizer(StabilizerConfig("paper")),
        ssiam.Stabilizer(StabilizerConfig("paper")),
    )
    steps = [Motion.given([[1, 0, 3.0 * k], [0, 1, -2]], (320, 180)) for k in range(3)]
    for step in steps:
        refused(asked.update, motion)
        np.testing.assert_array_equal(asked.update(step), alone.update(step))
    refused(ssiam.Stabilizer, "paper")
