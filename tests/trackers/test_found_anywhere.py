"""Where a lost target is searched for, and whether what is found is the target."""

import numpy as np
import pytest

from helpers.synthetic import world
from ssiam import FrameView, StabilizedTracker, StabilizerConfig, Track
from ssiam.motion import Motion
from ssiam.trackers.global_search import GlobalSearch
from ssiam.trackers.recognition import Evidence, TargetRecognition
from ssiam.trackers.scenes import SceneMemory

SIZE = (320, 240)
WIDE = world(3, (640, 240))
OTHER = world(4, SIZE)
FRAME = np.ascontiguousarray(WIDE[:, 100:420])
BOX = (120.0, 90.0, 32.0, 28.0)


def observed_scenes(*frames):
    scenes = SceneMemory()
    for frame in frames:
        for _ in range(20):
            scenes.observe(frame, BOX)
    return scenes


def test_a_known_scene_tells_where_the_target_was():
    scenes = observed_scenes(FRAME)
    assert scenes.find(FRAME) == pytest.approx(BOX, abs=3)
    shifted = np.ascontiguousarray(WIDE[:, 140:460])
    x, y, w, h = scenes.find(shifted)
    assert (x, y, w, h) == pytest.approx((80, 90, 32, 28), abs=5)
    assert scenes.find(OTHER) is None
    assert scenes.find(np.zeros_like(FRAME)) is None
    assert SceneMemory().find(FRAME) is None


def test_several_scenes_take_turns():
    scenes = observed_scenes(FRAME, OTHER)
    assert any(scenes.find(FRAME) is not None for _ in range(4))
    assert any(scenes.find(OTHER) is not None for _ in range(4))


def test_the_same_scene_is_kept_once():
    scenes = observed_scenes(FRAME, FRAME, FRAME, OTHER)
    assert len(scenes._scenes) <= 3


@pytest.mark.parametrize("shape", [(2, 4096, 3), (4096, 2, 3), (7, 2000, 3)])
def test_a_scene_may_have_any_shape(shape):
    strip = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    scenes = observed_scenes(strip)
    assert scenes.find(strip) == pytest.approx(BOX, abs=3)


def test_places_like_the_target_are_searched_first():
    search = GlobalSearch()
    search.observe(FRAME, BOX)
    x, y, w, h = search.window(FRAME, BOX[2:])
    assert (x, y) == pytest.approx(BOX[:2], abs=6)
    assert (w, h) == BOX[2:]


def test_a_sweep_covers_the_frame():
    search = GlobalSearch()
    covered = np.zeros((240, 320), bool)
    for _ in range(60):
        x, y, w, h = search.window(FRAME, (40.0, 40.0))
        assert 0 <= x + w / 2 <= 320
        assert 0 <= y + h / 2 <= 240
        left, top = max(int(x - 20), 0), max(int(y - 20), 0)
        covered[top : int(y + h + 20), left : int(x + w + 20)] = True
    assert covered.all()


@pytest.mark.parametrize("size", [(2.0, 3.0), (600.0, 500.0)])
def test_very_small_and_very_large_targets(size):
    search = GlobalSearch()
    search.observe(FRAME, (0.0, 0.0, *size))
    search.observe(FRAME, (-900.0, 0.0, *size))
    for _ in range(20):
        assert np.isfinite(search.window(FRAME, size)).all()


class Features:
    """The feature of a template is the mean color of its box."""

    has_template_feature = True

    def clone(self):
        return Features()

    def init(self, view, xywh):
        x, y, w, h = (round(each) for each in xywh)
        self.color = view.raw[max(y, 0) : y + h, max(x, 0) : x + w].mean(axis=(0, 1))

    def template_feature(self):
        return self.color


def test_an_object_is_recognized_by_its_features():
    frame = np.full((240, 320, 3), 100, np.uint8)
    frame[90:118, 120:152] = (200, 60, 90)
    frame[20:48, 20:52] = (40, 180, 120)
    view, tracker, recognition = FrameView(frame), Features(), TargetRecognition()
    tracker.init(view, BOX)
    other = (20.0, 20.0, 32.0, 28.0)
    assert not recognition.is_ready
    for _ in range(40):
        recognition.observe(tracker, view, BOX, 0.9)
    assert recognition.is_ready
    assert recognition.likeness(tracker, view, BOX) == pytest.approx(0.5)
    assert recognition.likeness(tracker, view, other) < 0
    assert recognition.likeness(tracker, view, (200.0, 180.0, 32.0, 28.0)) < 0


class SameFeatures(Features):
    """All objects are the same to the network; their surroundings are not."""

    def clone(self):
        return SameFeatures()

    def template_feature(self):
        return np.array([1.0, 0.0]) if np.ptp(self.color) > 15 else np.array([0.0, 1.0])


def test_objects_of_another_color_are_less_like_the_target():
    frame = np.full((240, 320, 3), 100, np.uint8)
    for left, color in ((120, (60, 60, 140)), (220, (30, 30, 100)), (20, (140, 60, 60))):
        frame[90:118, left : left + 32] = color
    view, tracker, recognition = FrameView(frame), SameFeatures(), TargetRecognition()
    tracker.init(view, BOX)
    for _ in range(40):
        recognition.observe(tracker, view, BOX, 0.9)
    same, dark, other = (
        recognition.likeness(tracker, view, (float(left), 90.0, 32.0, 28.0))
        for left in (120, 220, 20)
    )
    assert same == pytest.approx(0.5)
    assert other < dark - 0.3
    assert other < -0.3


STILL = Motion.none(SIZE, reliable=True)


def test_a_high_likeness_is_enough_and_one_at_the_limit_never():
    assert Evidence().add(BOX, 0.36, 0.3)
    evidence = Evidence()
    assert not any(evidence.add(BOX, 0.3, 0.3) for _ in range(100))
    assert not evidence.is_sure
    assert [evidence.add(BOX, 0.33, 0.3) for _ in range(4)] == [False, True, True, True]
    assert evidence.is_sure


def test_refusals_count_against_an_object_until_a_cut():
    evidence = Evidence()
    for _ in range(20):
        evidence.add(BOX, 0.0, 0.3)
    assert evidence.value == -1
    other = (200.0, 90.0, 32.0, 28.0)
    assert evidence.add(other, 0.36, 0.3)
    moved = Motion.from_transform(np.array([[1.0, 0, 60], [0, 1, 0], [0, 0, 1]]), SIZE)
    evidence.advance(moved)
    assert not evidence.add((180.0, 90.0, 32.0, 28.0), 0.36, 0.3)
    evidence.advance(Motion.none(SIZE))
    assert evidence.add((180.0, 90.0, 32.0, 28.0), 0.36, 0.3)


def test_without_features_every_object_may_be_the_target():
    tracker, recognition = Features(), TargetRecognition()
    tracker.has_template_feature = False
    for _ in range(40):
        recognition.observe(tracker, FrameView(FRAME), BOX, 0.9)
    assert not recognition.is_ready


class Described:
    """A tracker with features that cannot be made a second time."""

    def __init__(self, name):
        self.name = name

    def init(self, view, xywh):
        self.xywh = xywh

    def update(self, view):
        return Track(self.xywh, 0.9)

    def seek(self, view, xywh):
        self.xywh = xywh
        return self.update(view)

    def template_feature(self):
        return np.arange(4.0)


class WithoutFeatures(Described):
    """A tracker that declares that it has no features."""

    has_template_feature = False

    def template_feature(self):
        raise NotImplementedError


@pytest.mark.parametrize(
    "tracker", [Described("no clones"), WithoutFeatures("no features")], ids=lambda t: t.name
)
def test_trackers_that_cannot_be_compared_track_on(tracker):
    stabilized = StabilizedTracker(tracker, StabilizerConfig())
    stabilized.init(FRAME, BOX)
    tracks = [stabilized.update(FRAME) for _ in range(12)]
    assert not any(track.lost for track in tracks)
