"""The motion to a following frame begins with the first inference of a frame, or at once."""

import pytest

import ssiam
from helpers.synthetic import camera_frame, world
from ssiam.geometry import rigid
from ssiam.inferences import inference_begins, started_by_inference
from ssiam.motion import PrefetchingCameraMotion
from ssiam.trackers import TrackerGroup

SIZE = (320, 240)
BOX = (130.0, 90.0, 40.0, 50.0)


@pytest.fixture(scope="module")
def frames():
    scene = world(size_wh=SIZE)
    return [camera_frame(scene, rigid(3.0 * t, -2.0 * t, 0.0)) for t in range(4)]


def test_work_starts_once_with_the_first_inference():
    calls = []
    with started_by_inference(lambda: calls.append("started")):
        calls.append("crop")
        inference_begins()
        calls.append("network")
        inference_begins()
    assert calls == ["crop", "started", "network"]
    inference_begins()
    assert len(calls) == 3


def test_work_starts_after_a_block_without_an_inference():
    calls = []
    with pytest.raises(KeyError), started_by_inference(lambda: calls.append("started")):
        raise KeyError
    assert calls == ["started"]


@pytest.mark.parametrize(("name", "first"), [("lite", "crop"), ("kcf", "started")])
@pytest.mark.parametrize("several", [False, True])
def test_the_next_motion_starts_when_the_network_does(frames, monkeypatch, name, first, several):
    calls = []
    tracker = ssiam.load_tracker(name)
    target = TrackerGroup(tracker) if several else tracker
    target.init(frames[0], [BOX] if several else BOX)
    start, locate = PrefetchingCameraMotion.start, ssiam.StabilizedTracker._locate
    crop = ssiam.FrameView.crop_square

    def started(self, *args, **kwargs):
        calls.append("started")
        start(self, *args, **kwargs)

    def cropped(self, *args):
        calls.append("crop")
        return crop(self, *args)

    def located(self, *args, **kwargs):
        track = locate(self, *args, **kwargs)
        calls.append("located")
        return track

    monkeypatch.setattr(PrefetchingCameraMotion, "start", started)
    monkeypatch.setattr(ssiam.StabilizedTracker, "_locate", located)
    monkeypatch.setattr(ssiam.FrameView, "crop_square", cropped)
    target.update(frames[1], following=frames[2])
    assert calls[0] == first
    assert calls.index("started") < calls.index("located")
    assert calls.count("started") == 1
