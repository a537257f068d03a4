import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import CameraMotion, FrameSizeError, Motion
from ssiam.geometry import map_points, rigid
from ssiam.motion.camera import _low_high_boxes

SIZE = (640, 360)
CORNERS = np.array([[0, 0], [640, 0], [640, 360], [0, 360]])
GENERATORS = ["direct", "orb", "gftt", "harris", "brisk", "mser"]


def corner_error(cur_from_prev, truth):
    return np.hypot(*(map_points(cur_from_prev, CORNERS) - map_points(truth, CORNERS)).T).mean()


def shaken(count=6, seed=3, shift=8.0, angle=0.01):
    """Frames with a known white shake, and the true cur_from_prev of each."""
    r = generator(seed)
    steps = r.normal(0, (shift, shift, angle), (count, 3))
    frame_from_world = poses(steps, SIZE)
    frames = [camera_frame(world(), pose) for pose in frame_from_world]
    pairs = zip(frame_from_world[1:], frame_from_world[:-1], strict=True)
    return frames, [np.eye(3)] + [cur @ np.linalg.inv(prev) for cur, prev in pairs]


@pytest.mark.parametrize("keypoints", GENERATORS)
def test_a_known_shake_is_estimated(keypoints):
    camera = CameraMotion(keypoints=keypoints)
    for frame, truth in zip(*shaken(), strict=True):
        motion = camera.update(frame)
        assert motion.reliable
        assert corner_error(motion.cur_from_prev, truth) < 0.5


def test_the_motion_of_the_first_frame_is_the_identity():
    motion = CameraMotion().update(world())
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
    assert motion.reliable


def test_several_boxes_can_be_excluded():
    frames, truths = shaken(count=3)
    camera = CameraMotion()
    for frame, truth in zip(frames, truths, strict=True):
        motion = camera.update(frame, exclude=[(0, 0, 200, 300), (500, 40, 300, 900)])
        assert corner_error(motion.cur_from_prev, truth) < 0.5


NOISE = generator(5).integers(0, 256, (360, 640, 3), dtype=np.uint8)
UNUSABLE_FRAMES = {
    "black": np.zeros((360, 640, 3), np.uint8),
    "white": np.full((360, 640, 3), 255, np.uint8),
    "noise": NOISE,
    "cut": world(seed=42),
}


@pytest.mark.parametrize("keypoints", GENERATORS)
@pytest.mark.parametrize("kind", UNUSABLE_FRAMES)
def test_unusable_frames_are_unreliable(kind, keypoints):
    camera = CameraMotion(keypoints=keypoints)
    frames, _ = shaken(count=3)
    for frame in frames:
        camera.update(frame)
    motion = camera.update(UNUSABLE_FRAMES[kind])
    assert not motion.reliable
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
    camera.update(frames[0])
    assert camera.update(frames[1]).reliable  # and the camera recovers


def test_least_squares_fit():
    camera = CameraMotion("orb", fit="least_squares")
    for frame, truth in zip(*shaken(shift=2.0, angle=0.003), strict=True):
        assert corner_error(camera.update(frame).cur_from_prev, truth) < 1.0


def test_a_change_of_size_is_refused():
    camera = CameraMotion()
    camera.update(world())
    with pytest.raises(FrameSizeError, match="320x180 pixels after frames of 640x360"):
        camera.update(world(size_wh=(320, 180)))


@pytest.mark.parametrize(
    ("settings", "message"),
    {
        "keypoints": ({"keypoints": "sift"}, r"unknown keypoints 'sift'.*orb"),
        "fit": ({"fit": "magic"}, r"unknown fit 'magic'.*least_squares"),
        "model": ({"model": "magic"}, r"unknown model 'magic'.*homography"),
    }.values(),
)
def test_unknown_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        CameraMotion(**settings)


@pytest.mark.parametrize("exclude", [(1, 2, 3), (0, 0, float("nan"), 4), "12"])
def test_invalid_boxes_are_refused(exclude):
    camera = CameraMotion()
    with pytest.raises(ValueError, match=r"exclude is .*\(x, y, w, h\)"):
        camera.update(world(), exclude=exclude)


def test_the_shift_is_that_of_the_frame_center():
    frames, truths = shaken(count=2)
    camera = CameraMotion()
    camera.update(frames[0])
    motion = camera.update(frames[1])
    center = map_points(truths[1], [[319.5, 179.5]])[0] - (319.5, 179.5)
    assert motion.shift_angle[:2] == pytest.approx(center, abs=0.2)


@pytest.mark.parametrize("size_wh", [(24, 16), (1, 1), (700, 3), (5, 400)])
def test_tiny_frames_are_accepted(size_wh):
    camera = CameraMotion()
    for seed in range(3):
        motion = camera.update(generator(seed).integers(0, 256, (*size_wh[::-1], 3), np.uint8))
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))


def test_a_given_motion_replaces_the_estimate():
    frames, truths = shaken(count=4)
    camera = CameraMotion()
    camera.update(frames[0])
    given = camera.update(frames[1], motion=rigid(7, 8, 0.1)[:2])
    np.testing.assert_allclose(given.cur_from_prev, rigid(7, 8, 0.1))
    motion = camera.update(frames[2])  # estimated again, from the frame before
    assert corner_error(motion.cur_from_prev, truths[2]) < 0.5
    same = Motion.from_transform(np.eye(3), SIZE)
    assert camera.update(frames[3], motion=same) is same


def test_boxes_are_enlarged_by_a_tenth_on_each_side():
    assert _low_high_boxes((100, 50, 40, 20)).tolist() == [[96, 48, 144, 72]]
    several = _low_high_boxes([(0, 0, 10, 10), (5, 6, 20, 40)])
    np.testing.assert_allclose(several, [[-1, -1, 11, 11], [3, 2, 27, 50]])
    for none in (None, [], np.empty((0, 4))):
        assert _low_high_boxes(none).shape == (0, 4)


@pytest.mark.parametrize(
    "exclude", [(1, 2, 3), [(1, 2, 3)], np.zeros((1, 1, 4)), 5, "x", [(1, 2, 3, np.inf)]]
)
def test_other_shapes_are_no_boxes(exclude):
    with pytest.raises(ValueError, match=r"^exclude is .*: give \(x, y, w, h\)"):
        _low_high_boxes(exclude)


class Recorded:
    """An estimator that returns a given motion and records its calls."""

    def __init__(self, size_wh):
        self.motion = Motion.from_transform(rigid(3, -2, 0.01), size_wh)
        self.previous, self.estimated = [], []

    def set_previous(self, frame):
        self.previous.append(frame.shape)

    def estimate(self, frame, boxes):
        self.estimated.append((frame.shape, boxes))
        return self.motion


@pytest.fixture
def recorded(monkeypatch):
    made = []

    def new(self, frame, area):
        frame = area.of(frame)
        made.append(Recorded((frame.shape[1], frame.shape[0])))
        return made[-1]

    monkeypatch.setattr(CameraMotion, "_new_estimator", new)
    return made


def with_bars(frame, left=80, top=0):
    height, width = frame.shape[:2]
    framed = np.zeros_like(frame)
    inside = slice(top, height - top), slice(left, width - left)
    framed[inside] = frame[inside]
    return framed


def test_the_estimator_gets_the_content_and_boxes_in_it(recorded):
    frames = [with_bars(frame, 80, 40) for frame in shaken(count=3)[0]]
    camera = CameraMotion()
    first = camera.update(frames[0])
    assert (first.reliable, first.inliers, first.size_wh) == (True, 1, SIZE)
    found = camera.update(frames[1], exclude=(100, 60, 40, 20))
    (estimator,) = recorded
    ((shape, boxes),) = estimator.estimated
    assert shape == (280, 480, 3)
    assert boxes.tolist() == [[96 - 80, 58 - 40, 144 - 80, 82 - 40]]
    assert found.size_wh == SIZE
    moved = rigid(80, 40, 0) @ rigid(3, -2, 0.01) @ rigid(-80, -40, 0)
    np.testing.assert_allclose(found.cur_from_prev, moved)


def test_a_given_motion_is_returned_and_the_frame_becomes_the_previous_one(recorded):
    frames, _ = shaken(count=3)
    camera = CameraMotion()
    given = Motion.from_transform(rigid(5, 0, 0), SIZE)
    assert camera.update(frames[0], motion=given) is given
    assert camera.update(frames[1], motion=given) is given
    (estimator,) = recorded
    assert estimator.previous == [(360, 640, 3)]
    assert estimator.estimated == []


def test_new_bars_start_a_new_estimator(recorded):
    frames, _ = shaken(count=4)
    camera = CameraMotion()
    given = Motion.from_transform(rigid(5, 0, 0), SIZE)
    camera.update(frames[0])
    camera.update(frames[1])
    camera.update(with_bars(frames[2]))
    assert len(recorded) == 2
    assert recorded[0].estimated[-1][0] == (360, 640, 3), "in the content of the previous frame"
    camera.update(with_bars(frames[3]))
    assert recorded[1].estimated[-1][0] == (360, 480, 3)
    camera.update(frames[3], motion=given)
    assert len(recorded) == 3
    assert recorded[1].previous == []


def test_while_bars_are_uncertain_the_motion_is_not_reliable(recorded):
    frames, _ = shaken(count=3)
    camera = CameraMotion()
    camera.update(frames[0])
    camera._content.uncertain = True
    camera._content.update = lambda frame: False
    found = camera.update(frames[1])
    assert (found.reliable, found.size_wh) == (False, SIZE)
    given = Motion.from_transform(rigid(5, 0, 0), SIZE)
    assert camera.update(frames[2], motion=given) is given


def test_estimators_have_the_settings_of_the_camera():
    frame = world()
    camera = CameraMotion("gftt", "least_squares", "affine", spread=False)
    camera.update(frame)
    estimator = camera._estimator
    assert estimator._generator._name == "gftt"
    assert (estimator._fit, estimator._model, estimator._spread_points) == (
        *("least_squares", "affine"),
        False,
    )
    assert estimator._size_wh == SIZE
    assert estimator._prev_gray is not None
    direct = CameraMotion(model="homography")
    direct.update(frame)
    assert direct._estimator._grid.model == "homography"
    assert direct._estimator._size_wh == SIZE
    default = CameraMotion()
    assert (default._keypoints, default._fit, default._model, default._spread) == (
        *("direct", "robust", "similarity"),
        True,
    )
