"""The loops of lite and NanoTrack, step by step on random maps."""

import numpy as np
import pytest

from helpers.stub_networks import Stub
from helpers.synthetic import generator, golden_video
from ssiam import FrameView
from ssiam.trackers import lite, nanotrack
from ssiam.trackers.confidence import Confidence, box_feature
from ssiam.trackers.lite import LiteNetworks, LiteTracker, Memory
from ssiam.trackers.nanotrack import NanoTrack, NanoTrackNetworks
from ssiam.trackers.siamese import SearchParameters

SIZE = (320, 240)
PARAMETERS = SearchParameters(penalty_k=0.2, window_influence=0.3, lr=0.7)


def random_maps(t, side, spread=3.0):
    """Logits of score and quality, and distances."""
    random = generator(500 + t)
    logits = [random.normal(0, spread, (1, 1, side, side)).astype(np.float32) for _ in range(2)]
    return [*logits, random.uniform(5, 60, (1, 4, side, side)).astype(np.float32)]


def sigmoid(values):
    return 1 / (1 + np.exp(-np.asarray(values, float)))


def context(w, h):
    return np.sqrt((w + (w + h) / 2) * (h + (w + h) / 2))


class Reference:
    """The common steps of the loops, written out."""

    def __init__(self, center, size, cells, stride, first, minimum=(10.0, 10.0)):
        self.center, self.size = np.array(center, float), np.array(size, float)
        offsets = (np.arange(cells) - first) * stride
        self.points = np.stack([np.tile(offsets, cells), np.repeat(offsets, cells)])
        self.window = np.outer(np.hanning(cells), np.hanning(cells)).ravel()
        self.minimum = minimum

    def step(self, score, distances, zoom, offset=(0.0, 0.0)):
        """Move to the best candidate; returns its index, its box and the IoU of the minimum."""
        left, top, right, bottom = distances[0].reshape(4, -1).astype(float)
        x, y = self.points + np.multiply(offset, zoom)[:, None]
        x, y, w, h = x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom
        last_w, last_h = self.size * zoom
        scale = context(w, h) / context(last_w, last_h)
        aspect = (last_w / last_h) / (w / h)
        change = np.maximum(scale, 1 / scale) * np.maximum(aspect, 1 / aspect)
        penalty = np.exp(-(change - 1) * PARAMETERS.penalty_k)
        share = PARAMETERS.window_influence
        best = int((penalty * score * (1 - share) + self.window * share).argmax())
        rate = penalty[best] * score[best] * PARAMETERS.lr
        found = np.array([w[best], h[best]]) / zoom
        self.center = np.clip(self.center + np.array([x[best], y[best]]) / zoom, 0, SIZE)
        self.size = np.clip(self.size * (1 - rate) + found * rate, self.minimum, SIZE)
        small = self.size <= self.minimum
        overlap = np.where(small, np.minimum(found / self.size, 1), 1).prod()
        return best, np.array([x[best], y[best], w[best], h[best]]), overlap

    @property
    def xywh(self):
        return (*(self.center - self.size / 2), *self.size)


def half_up_corner(center, side):
    return np.floor(center - (side + 1) / 2 + 0.5)


def crop_of(frame, center, side, out=255):
    view = FrameView(frame)
    crop = view.crop_square(tuple(center), side, out, FRAMES[0].mean(axis=(0, 1)))
    return crop.transpose(2, 0, 1)[None].astype(np.float32)


FRAMES, (X, Y, W, H) = golden_video("A", 9)
START = (X + 0.3, Y - 0.4, W + 0.7, H)


def lite_tracker(**options):
    search = Stub(lambda t, crop, *kernels: random_maps(t, 15))
    template = Stub(lambda t, crop: [crop, np.full((1, 1), t, np.float32)])
    networks = LiteNetworks(template, search)
    confidence = Confidence((0.7, 0.4), -0.2)
    return LiteTracker(networks, PARAMETERS, confidence, distractors=False, **options), networks


def test_the_loop_of_lite():
    tracker, networks = lite_tracker(masks=False)
    x, y, w, h = START
    reference = Reference((x + w / 2, y + h / 2), (w, h), 15, 16, 7)
    tracker.init(FrameView(FRAMES[0]), START)
    side = round(context(w, h))
    np.testing.assert_array_equal(
        networks.template.calls[0][0], crop_of(FRAMES[0], reference.center, side, 127)
    )
    for t, frame in enumerate(FRAMES[1:], 1):
        side = round(255 / 127 * context(*reference.size))
        crop = crop_of(frame, reference.center, side)
        scores, qualities, distances = random_maps(t, 15)
        score = (sigmoid(scores) * sigmoid(qualities)).ravel()
        offset = half_up_corner(reference.center, side) + side / 2 - reference.center
        best, _, overlap = reference.step(score, distances, 255 / side, offset)
        track = tracker.update(FrameView(frame))
        np.testing.assert_array_equal(networks.search.calls[-1][0], crop)
        assert track.box == pytest.approx(reference.xywh, abs=1e-4)
        logits = [float(np.clip(each.ravel()[best], -8, 8)) for each in (scores, qualities)]
        assert track.evidence == pytest.approx(logits)
        assert all(type(value) is float for value in track.evidence)
        probability = sigmoid(0.7 * logits[0] + 0.4 * logits[1] - 0.2)
        assert track.score == pytest.approx(probability * overlap, abs=1e-6)
        assert (track.mask, track.corners) == (None, None)


def test_the_evidence_of_lite_is_within_limits():
    tracker, networks = lite_tracker(masks=False)
    maps = [np.full((1, 1, 15, 15), value, np.float32) for value in (20.0, -20.0)]
    distances = np.full((1, 4, 15, 15), 30, np.float32)
    networks.search.answer = lambda t, *inputs: [*maps, distances]
    tracker.init(FrameView(FRAMES[0]), START)
    assert tracker.update(FrameView(FRAMES[1])).evidence == (8, -8)


def test_seek_starts_at_the_center_of_its_box():
    tracker, networks = lite_tracker(masks=False)
    tracker.init(FrameView(FRAMES[0]), START)
    tracker.seek(FrameView(FRAMES[1]), (50.0, 60.0, 40.0, 60.0))
    side = round(255 / 127 * context(40, 60))
    expected = crop_of(FRAMES[1], (70.0, 90.0), side)
    np.testing.assert_array_equal(networks.search.calls[-1][0], expected)


def test_a_small_target_of_lite_may_stay_small():
    tracker, networks = lite_tracker(masks=False)
    maps = [np.full((1, 1, 15, 15), 20, np.float32)] * 2
    distances = np.full((1, 4, 15, 15), 12, np.float32)
    networks.search.answer = lambda t, *inputs: [*maps, distances]
    tracker.init(FrameView(FRAMES[0]), (100.0, 90.0, 14.0, 12.0))
    for _ in range(30):
        track = tracker.update(FrameView(FRAMES[1]))
    assert track.box[2:] == pytest.approx((7, 6))
    tracker.init(FrameView(FRAMES[0]), (100.0, 90.0, 44.0, 32.0))
    for _ in range(30):
        track = tracker.update(FrameView(FRAMES[1]))
    assert track.box[2:] == pytest.approx((10, 10))


def test_defaults_of_lite():
    networks = lite_tracker()[1]
    tracker = LiteTracker(networks)
    assert (tracker._parameters, tracker._confidence) == (lite.PARAMETERS, lite.CONFIDENCE)
    assert tracker._memory == Memory(interval=0, min_score=0.6, max_distractor_share=0.5)
    assert tracker._has_distractors
    assert tracker._box_mask is None


def test_a_memory_is_due_with_a_score_and_without_a_distractor():
    """The second best cell counts if it is outside of the best one's box."""
    boxes = np.array([[0.0, 9, 11], [0, 0, 0], [20, 20, 20], [20, 20, 20]])
    view = FrameView(FRAMES[0])
    for score, interval, taken in (
        ([0.6, 0.5, 0.29], 1, True),
        ([0.59, 0.5, 0.1], 1, False),
        ([0.8, 0.7, 0.4], 1, False),
        ([0.8, 0.7, 0.39], 1, True),
        ([0.8, 0.7, 0.1], 2, False),
        ([0.8, 0.7, 0.1], 0, False),
    ):
        tracker, networks = lite_tracker(memory=Memory(interval=interval))
        tracker.init(view, START)
        target = tracker._target
        tracker._update_memory(target, view, boxes, np.array(score), 0)
        assert int(target.recent.item()) == (2 if taken else 1)
        assert target.recent_age == (0 if taken else 1)
        assert len(networks.template.calls) == 1 + taken
    near = boxes[:, :2]
    tracker._memory = Memory(interval=2)
    tracker._update_memory(target, view, near, np.array([0.8, 0.7]), 0)
    assert int(target.recent.item()) == 2, "no cell is outside"


def nanotrack_tracker(spread=3.0, side=16):
    def features(t, size):
        return generator(900 + t).uniform(0, 1, (1, 6, size, size)).astype(np.float32)

    def head(t, kernel, found):
        first, second, distances = random_maps(t, side, spread)
        return [np.concatenate([first, second], axis=1), distances]

    stub = Stub(head)
    stub.output_shapes = [(1, 2, side, side), (1, 4, side, side)]
    networks = NanoTrackNetworks(
        Stub(lambda t, crop: [features(0, 8)]), Stub(lambda t, crop: [features(t, 16)]), stub
    )
    return NanoTrack(networks, PARAMETERS, Confidence((0.5, 20.0), -1.0)), networks, features


@pytest.mark.parametrize("side", [15, 16])
@pytest.mark.parametrize("spread", [0.7, 3.0, 9.0])
def test_the_loop_of_nanotrack(spread, side):
    tracker, networks, features = nanotrack_tracker(spread, side)
    x, y, w, h = START
    center = x + (w - 1) / 2, y + (h - 1) / 2
    reference = Reference(center, (w, h), side, 16, side // 2)
    tracker.init(FrameView(FRAMES[0]), START)
    np.testing.assert_array_equal(
        networks.template.calls[0][0], crop_of(FRAMES[0], center, round(context(w, h)), 127)
    )
    scaled = np.array([w, h]) * 127 / context(w, h)
    template = box_feature(features(0, 8), 16, np.array([0, 0, *scaled]))
    mean = None
    for t, frame in enumerate(FRAMES[1:], 1):
        zoom = 127 / context(*reference.size)
        crop = crop_of(frame, reference.center, round(255 / zoom))
        background, foreground, distances = random_maps(t, side, spread)
        score = sigmoid(foreground.astype(float) - background).ravel()
        best, box, overlap = reference.step(score, distances, zoom)
        track = tracker.update(FrameView(frame))
        np.testing.assert_array_equal(networks.search.calls[-1][0], crop)
        assert track.box == pytest.approx(reference.xywh, abs=1e-4)
        logit = float(np.clip(foreground.ravel()[best] - background.ravel()[best], -6, 12))
        similarity = template @ box_feature(features(t, 16), 16, box)
        mean = similarity if mean is None else mean
        difference = similarity - mean
        if logit > 6 or difference > -0.1:
            mean += (0.2 if logit > 6 else 0.05) * difference
        drop = max(min(difference + 0.05, 0), -0.2)
        weight = np.clip((8 - logit) / 4, 0, 1)
        assert track.evidence == pytest.approx((logit, weight * drop), abs=1e-6)
        probability = sigmoid(0.5 * logit + 20 * weight * drop - 1)
        assert track.score == pytest.approx(probability * overlap, abs=1e-5)
        assert track.corners is None


def test_seek_of_nanotrack_starts_at_the_center_of_its_box():
    tracker, networks, _ = nanotrack_tracker()
    tracker.init(FrameView(FRAMES[0]), START)
    tracker.seek(FrameView(FRAMES[1]), (50.0, 60.0, 40.0, 60.0))
    side = round(255 / 127 * context(40, 60))
    expected = crop_of(FRAMES[1], (70.0, 90.0), side)
    np.testing.assert_array_equal(networks.search.calls[-1][0], expected)
    kernel, found = networks.head.calls[-1]
    assert (kernel.shape, found.shape) == ((1, 6, 8, 8), (1, 6, 16, 16))
    assert not tracker._has_distractors


def test_template_features_are_the_networks_outputs():
    for make in (lite_tracker, nanotrack_tracker):
        tracker, networks, *_ = make()
        tracker.init(FrameView(FRAMES[0]), START)
        outputs = networks.template.answer(1, networks.template.calls[0][0])
        expected = np.concatenate([each.ravel() for each in outputs])
        np.testing.assert_array_equal(tracker.template_feature(), expected)
        assert tracker.template_feature().dtype == np.float64
    assert nanotrack.SEARCH_SIDE == lite.SEARCH_SIDE == 255
