"""The template memory on a real video: how similar the target and its surroundings are."""

import pytest

import ssiam
from ssiam import FrameView
from ssiam.trackers.opencv import OpenCvTracker
from ssiam.trackers.template_memory import MemoryParameters, TemplateMemoryTracker
from ssiam.video import open_source


@pytest.fixture(scope="module")
def walker(request):
    """Frames of the example clip, and the walker's box in the first one."""
    with open_source(request.config.rootpath / "examples" / "shaky-walker.mp4") as source:
        return [frame.image for frame, _ in zip(source, range(24), strict=False)]


WALKER = (53.2, 114.1, 26.5, 66.4)


def test_the_target_is_more_similar_to_the_memory_than_what_is_beside_it(walker):
    tracker = ssiam.load_tracker(template_memory=True)
    tracker.init(walker[0], WALKER)
    tracks = [tracker.update(frame) for frame in walker[1:]]
    memory, view = tracker._tracker, FrameView(walker[-1])
    x, y, w, h = tracks[-1].box
    target = memory.similarity(view, (x, y, w, h))
    assert target > 0.7
    for dx in (-2.5 * w, 2.5 * w):
        assert memory.similarity(view, (x + dx, y, w, h)) < 0.55
    assert memory.similarity(FrameView(walker[0]), WALKER) == pytest.approx(1)


def test_a_tracker_without_features_is_compared_by_its_image(walker):
    """KCF has no network."""
    memory = TemplateMemoryTracker(
        OpenCvTracker("kcf"), MemoryParameters(interval=1, min_score=0.5, search_below=1.0)
    )
    memory.init(FrameView(walker[0]), WALKER)
    for frame in walker[1:]:
        memory.update(FrameView(frame))
    x, y, w, h = WALKER
    assert memory.similarity(FrameView(walker[0]), WALKER) == pytest.approx(1)
    assert memory.similarity(FrameView(walker[0]), (x + 2.5 * w, y, w, h)) < 0.6
