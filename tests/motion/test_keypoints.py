"""Each keypoint generator finds what its name promises, and enough of it."""

import pickle
from itertools import product

import cv2
import numpy as np
import pytest

from helpers.synthetic import generator, world
from ssiam import CameraMotion
from ssiam.errors import ArgumentError
from ssiam.geometry import map_points, rigid
from ssiam.motion import keypoints
from ssiam.motion.keypoints import KeypointGenerator, KeypointMotion, _follow, _spread

SIZE = (640, 360)
TEXTURED = cv2.cvtColor(world(), cv2.COLOR_BGR2GRAY)
MINIMUM = {  # keypoints of a textured frame, and cells of a 16 x 12 grid that they cover
    "orb": (400, 120),
    "gftt": (150, 90),
    "harris": (120, 80),
    "brisk": (200, 80),
    "mser": (40, 25),
}


@pytest.mark.parametrize("name", MINIMUM)
def test_a_textured_frame_has_keypoints_all_over(name):
    points = KeypointGenerator(name)(TEXTURED, None)
    min_points, min_cells = MINIMUM[name]
    assert len(points) >= min_points
    assert len(_spread(points, SIZE)) >= min_cells


@pytest.mark.parametrize("name", MINIMUM)
def test_no_keypoint_is_outside_of_the_mask(name):
    mask = np.full(TEXTURED.shape, 255, np.uint8)
    mask[100:260, 200:440] = 0
    points = KeypointGenerator(name)(TEXTURED, mask)
    inside = (np.abs(points - (320, 180)) < (115, 75)).all(axis=1)  # not at the mask's edge
    assert len(points) > 20
    assert not inside.any()


def test_harris_rejects_points_on_a_strong_edge_that_gftt_accepts():
    """Harris and Stephens (1988): det - k trace² is negative where one gradient dominates."""
    frame = np.full((120, 160), 20, np.uint8)
    frame[:, 80:] = 220
    frame[50:70, 80:90] = 200  # a faint rectangle that touches the edge with its left side
    gftt, harris = (KeypointGenerator(name)(frame, None) for name in ("gftt", "harris"))
    assert set(gftt[:, 0]) == {81}
    assert set(harris[:, 0]) == {89}


def frames_with_a_textured_object(shift):
    """Two frames of a scene that shifts, and of an object with more corners that does not."""
    rng = generator(1)
    scene = np.full((SIZE[1], SIZE[0], 3), 100, np.uint8)
    for x, y in product(range(20, SIZE[0], 70), range(20, SIZE[1], 60)):
        corner = (x + int(rng.integers(6, 12)), y + int(rng.integers(6, 12)))
        cv2.rectangle(scene, (x, y), corner, rng.uniform(140, 230, 3).tolist(), -1)
    moved = cv2.warpAffine(scene, rigid(shift, 0, 0)[:2], SIZE, borderMode=cv2.BORDER_REFLECT_101)
    squares = 255 * rng.integers(0, 2, (20, 20, 1)).astype(np.uint8)
    for frame in (scene, moved):
        frame[100:260, 240:400] = np.kron(squares, np.ones((8, 8, 1), np.uint8))
    return scene, moved


@pytest.mark.parametrize("name", ["gftt", "brisk"])
def test_evenly_spread_keypoints_follow_the_scene_and_not_its_most_textured_part(name):
    shift, shifts = 9.0, []
    for spread in (True, False):
        camera = CameraMotion(name, model="rigid", spread=spread)
        for frame in frames_with_a_textured_object(shift):
            motion = camera.update(frame)
        shifts.append(map_points(motion.cur_from_prev, [(60.0, 60.0)])[0, 0] - 60)
    assert shifts == pytest.approx([shift, 0], abs=0.1)


def test_spread_is_on_or_off():
    with pytest.raises(ArgumentError, match=r"^spread is 1: it must be True or False"):
        CameraMotion("orb", spread=1)


@pytest.mark.parametrize("name", ["orb", "brisk", "mser"])
def test_a_mask_takes_nothing_but_the_points_in_it(name):
    """Where the mask is set, the points are those without a mask."""
    mask = np.zeros(TEXTURED.shape, np.uint8)
    mask[60:300, 60:580] = 255
    found = KeypointGenerator(name)(TEXTURED, mask)
    assert len(found) > 20
    assert ((found >= (59, 59)) & (found <= (580, 300))).all()
    assert len(KeypointGenerator(name)(TEXTURED, np.zeros_like(mask))) == 0


@pytest.mark.parametrize("name", MINIMUM)
def test_a_flat_frame_has_no_keypoints(name):
    points = KeypointGenerator(name)(np.full((120, 160), 90, np.uint8), None)
    assert points.shape == (0, 2)
    assert points.dtype == np.float32


@pytest.mark.parametrize("name", MINIMUM)
def test_copies_of_a_generator_find_the_same(name):
    first = KeypointGenerator(name)
    second = pickle.loads(pickle.dumps(first))
    np.testing.assert_array_equal(first(TEXTURED, None), second(TEXTURED, None))


@pytest.mark.parametrize("name", ["gftt", "harris"])
def test_corners_are_at_least_10_pixels_apart_and_at_most_200(name):
    points = KeypointGenerator(name)(TEXTURED, None)
    assert len(points) <= 200
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    assert distances[~np.eye(len(points), dtype=bool)].min() >= 10


@pytest.mark.parametrize("name", ["orb", "brisk", "gftt", "harris"])
def test_the_strongest_keypoints_come_first(name):
    """The left half has less contrast."""
    frame = TEXTURED.copy()
    frame[:, :320] = 100 + 0.4 * (frame[:, :320] - 100.0)
    points = KeypointGenerator(name)(frame, None)
    assert (points[:20, 0] > 310).all()


def test_spread_keeps_the_first_point_of_each_cell():
    """Cells of a frame of 160 x 120 px are 10 x 10 px."""
    points = np.array([[15, 15], [19, 11], [0, 0], [159, 119], [9, 9], [20, 15]], np.float32)
    found = _spread(points, (160, 120))
    assert found.tolist() == [[0, 0], [15, 15], [20, 15], [159, 119]]
    assert _spread(points[:0], (160, 120)).shape == (0, 2)


def test_followed_points_that_leave_the_frame_are_removed():
    scene = cv2.cvtColor(world(4, (320, 240)), cv2.COLOR_BGR2GRAY)
    prev, cur = scene[20:180, 20:240].copy(), scene[20:180, 28:248].copy()
    points = np.array([[110, 80], [4, 80], [180, 100]], np.float32)
    before, after = _follow(prev, cur, points)
    assert before.tolist() == [[110, 80], [180, 100]]
    assert after == pytest.approx(before - (8, 0), abs=0.1)
    none = points[:0]
    assert [len(each) for each in _follow(prev, cur, none)] == [0, 0]


def shifted_frames(count, shift, size=(320, 180)):
    frame = world(2, (size[0] + 80, size[1] + 40))
    return [
        np.ascontiguousarray(frame[20 : 20 + size[1], 20 + shift * t : 20 + shift * t + size[0]])
        for t in range(count)
    ]


def estimator(fit="robust", size=(320, 180)):
    return KeypointMotion(size, KeypointGenerator("gftt"), fit, "rigid")


def test_the_first_frame_has_no_motion_and_is_reliable():
    frames = shifted_frames(2, 4)
    found = estimator().estimate(frames[0], np.empty((0, 4)))
    assert found.reliable
    assert found.size_wh == (320, 180)
    np.testing.assert_array_equal(found.cur_from_prev, np.eye(3))


def test_the_motion_is_from_the_previous_frame_or_the_given_one():
    frames, none = shifted_frames(4, 4), np.empty((0, 4))
    camera = estimator()
    camera.set_previous(frames[0])
    assert camera.estimate(frames[1], none).shift_angle[:2] == pytest.approx((-4, 0), abs=0.2)
    assert camera.estimate(frames[3], none).shift_angle[:2] == pytest.approx((-8, 0), abs=0.2)
    camera.set_previous(frames[1])
    found = camera.estimate(frames[3], none)
    assert found.reliable
    assert found.size_wh == (320, 180)
    assert found.shift_angle[:2] == pytest.approx((-8, 0), abs=0.2)


def test_a_blank_frame_is_skipped():
    frames, none = shifted_frames(2, 4), np.empty((0, 4))
    camera = estimator()
    camera.estimate(frames[0], none)
    blank = camera.estimate(np.full_like(frames[0], 77), none)
    assert not blank.reliable
    assert blank.size_wh == (320, 180)
    assert camera.estimate(frames[1], none).shift_angle[0] == pytest.approx(-4, abs=0.2)


@pytest.mark.parametrize("fit", ["robust", "least_squares"])
def test_boxes_over_the_whole_frame_leave_no_points(fit):
    frames = shifted_frames(2, 4)
    camera = estimator(fit)
    camera.set_previous(frames[0])
    found = camera.estimate(frames[1], np.array([[-5.0, -5, 400, 300]]))
    assert not found.reliable
    assert found.size_wh == (320, 180)
    np.testing.assert_array_equal(found.cur_from_prev, np.eye(3))


def test_the_background_is_outside_of_the_boxes():
    camera = estimator()
    gray = cv2.cvtColor(shifted_frames(1, 0)[0], cv2.COLOR_BGR2GRAY)
    assert camera._background(gray, np.empty((0, 4))) is None
    boxes = np.array([[10.4, 20.6, 50.2, 60.7], [-8, 170, 4, 500]])
    mask = camera._background(gray, boxes)
    expected = np.full((180, 320), 255)
    expected[21:61, 10:50] = 0
    expected[170:, :4] = 0
    np.testing.assert_array_equal(mask, expected)


def test_a_few_points_that_agree_are_not_enough():
    """At least twelve points are needed."""
    none = np.empty((0, 4))
    for count, enough in ((11, False), (12, True)):
        frames = []
        for shift in (0, 3):
            frame = np.full((180, 320, 3), 90, np.uint8)
            for index in range(count):
                x, y = 30 + 40 * (index % 7), 40 + 45 * (index // 7)
                cv2.circle(frame, (x + shift, y), 4, (40 + 15 * index,) * 3, -1)
            frames.append(frame)
        points = np.array([[30 + 40 * (i % 7), 40 + 45 * (i // 7)] for i in range(count)])
        camera = KeypointMotion(
            (320, 180), lambda gray, mask, p=points: p.astype(np.float32), "robust", "rigid"
        )
        camera.set_previous(frames[0])
        found = camera.estimate(frames[1], none)
        assert found.reliable == enough
        if enough:
            assert found.shift_angle[0] == pytest.approx(3, abs=0.3)


def detected(detector):
    keypoints = sorted(detector.detect(TEXTURED, None), key=lambda each: -each.response)
    return np.array([each.pt for each in keypoints], np.float32)


def corners(**how):
    return cv2.goodFeaturesToTrack(TEXTURED, 200, 0.01, 10, **how).reshape(-1, 2)


REFERENCES = {  # OpenCV's detectors with the values that were measured to be fast and accurate
    "orb": lambda: detected(
        cv2.ORB.create(500, 2.0, 2, edgeThreshold=9, patchSize=9, scoreType=cv2.ORB_FAST_SCORE)
    ),
    "mser": lambda: detected(cv2.MSER.create()),
    "gftt": corners,
    "harris": lambda: corners(useHarrisDetector=True),
}


@pytest.mark.parametrize("name", REFERENCES)
def test_keypoints_are_those_of_opencv(name):
    found, expected = KeypointGenerator(name)(TEXTURED, None), REFERENCES[name]()
    assert found.shape == expected.shape
    assert {tuple(point) for point in found} == {tuple(point) for point in expected}


def test_the_flow_has_windows_of_17_pixels_on_five_levels():
    first, second = (cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) for frame in shifted_frames(2, 7))
    points = KeypointGenerator("gftt")(first, None)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.03)
    expected, found, _ = cv2.calcOpticalFlowPyrLK(
        first, second, points, None, winSize=(17, 17), maxLevel=4, criteria=stop
    )
    before, after = _follow(first, second, points)
    inside = ((expected >= 0) & (expected <= (319, 179))).all(axis=1) & (found.ravel() == 1)
    assert 0 < inside.sum() < len(points)
    np.testing.assert_array_equal(before, points[inside])
    np.testing.assert_array_equal(after, expected[inside])


@pytest.mark.parametrize(
    ("width", "tolerance"), [(320, 1.0), (426, 1.0), (640, 1.5), (1280, 3.0), (1920, 4.5)]
)
def test_the_tolerance_grows_with_the_frame(width, tolerance):
    """Errors of inliers are at most 1.5 px in frames of 640 px, and 1 px in small ones."""
    for size in ((width, width // 2), (width // 2, width)):
        assert estimator(size=size)._tolerance == pytest.approx(tolerance)


def test_flat_bars_are_no_background():
    frame = shifted_frames(1, 0)[0]
    frame[:, :60] = frame[:, 260:] = 0
    gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    mask = estimator()._background(gray, np.array([[100.0, 50, 150, 90]]))
    assert mask.shape == gray.shape
    assert mask.dtype == np.uint8
    assert not mask[:, :60].any()
    assert not mask[:, 260:].any()
    assert not mask[50:90, 100:150].any()
    assert mask[10:170, 160:250].all()
    large = estimator(size=(640, 360))._background(cv2.resize(gray, (640, 360)), np.empty((0, 4)))
    assert large.shape == (360, 640)
    assert not large[:, :118].any()
    assert large[20:340, 140:500].all()


@pytest.mark.parametrize("share", [0.15, 0.3])
def test_a_fit_needs_a_fifth_of_the_points(share):
    """The other points move apart from each other."""
    rng, count = generator(4), 150
    points = rng.uniform((20, 20), (300, 160), (count, 2)).astype(np.float32)
    moved = points + 3
    others = slice(int(share * count), None)
    moved[others] += rng.uniform(-18, 18, moved[others].shape)
    assert estimator_of(points, moved).reliable == (share > 0.2)


def estimator_of(points, moved):
    """The motion that a camera estimates from points that were followed."""
    camera = KeypointMotion((320, 180), lambda gray, mask: points, "robust", "rigid", spread=False)
    frames = shifted_frames(2, 0)
    camera.set_previous(frames[0])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(keypoints, "_follow", lambda prev, cur, points: (points, moved))
        return camera.estimate(frames[1], np.empty((0, 4)))
