"""examples/demo.py on its two clips: what it prints, what it writes, and how it judges."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import ssiam
from ssiam.geometry import iou
from ssiam.video import open_source

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "examples" / "demo.py"


@pytest.fixture(scope="module")
def demo():
    """The demo as a module."""
    spec = importlib.util.spec_from_file_location("demo", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["demo"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["demo"]


@pytest.fixture(scope="module")
def comparisons(demo):
    """Both clips, tracked alone and with stabilization."""
    alone, stabilized = ssiam.load_tracker(stabilize="off"), ssiam.load_tracker()
    return [demo.compare(clip, alone, stabilized) for clip in demo.CLIPS]


def test_alone_both_targets_are_lost_and_with_stabilization_none(comparisons):
    for each in comparisons:
        assert each.alone_lost is not None
        assert each.stabilized_lost is None
        assert (iou(each.stabilized, each.truth) >= 0.5).mean() >= 0.9


def test_every_frame_has_a_true_box_inside_of_it(comparisons):
    for each in comparisons:
        height, width = each.images[0].shape[:2]
        assert len(each.truth) == len(each.images)
        assert (each.truth[:, :2] >= 0).all()
        assert (each.truth[:, :2] + each.truth[:, 2:] <= (width, height)).all()


def test_a_target_is_lost_after_the_last_box_on_it(demo):
    on, off = [0.8], [0.1]
    assert demo.lost_from(np.array(on * 30)) is None
    assert demo.lost_from(np.array(off * 30)) == 0
    assert demo.lost_from(np.array(on * 12 + off * 18)) == 12
    assert demo.lost_from(np.array(on * 5 + off * 5 + on * 3 + off * 17)) == 13
    assert demo.lost_from(np.array(on * 21 + off * 9)) is None
    assert demo.lost_from(np.array(on * 20 + off * 10)) == 20


def test_the_sentence_is_true_of_any_outcome(demo, comparisons):
    first = comparisons[0]
    swapped = demo.Comparison(
        first.clip, first.fps, first.images, first.truth, first.stabilized, first.alone
    )
    good, bad = demo.sentence(first), demo.sentence(swapped)
    assert re.search(r"alone loses her after \d\.\d s.*; with ssiam it follows her to the", good)
    assert re.search(r"alone keeps her to the end.*; with ssiam it loses her after \d\.\d s", bad)


def test_the_demo_prints_three_lines_and_replaces_its_video_and_image(tmp_path):
    out = tmp_path / "folder"
    out.mkdir()
    for name in ("demo.mp4", "demo.png"):
        (out / name).write_bytes(b"of an earlier run")
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--out", str(out)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) == 3
    assert sorted(path.name for path in out.iterdir()) == ["demo.mp4", "demo.png"]
    with open_source(out / "demo.mp4") as source:
        frames = [frame.image for frame in source]
    boxes = [np.loadtxt(path, delimiter=",") for path in (ROOT / "examples/demo").glob("*.txt")]
    assert len(frames) == sum(map(len, boxes))
    assert frames[0].shape[1] == 2 * 560
    assert cv2.imread(str(out / "demo.png")).shape == (28 + 2 * 316, 3 * 560, 3)


def test_stabilization_helps_a_weaker_tracker():
    truth = np.loadtxt(ROOT / "examples" / "shaky-walker.txt", delimiter=",")
    tracked = {}
    for stabilize in ("off", "predict"):
        tracker = ssiam.load_tracker("csrt", stabilize=stabilize)
        with open_source(ROOT / "examples" / "shaky-walker.mp4") as frames:
            tracker.init(next(frames).image, truth[0])
            boxes = [truth[0], *(tracker.update(frame.image).box for frame in frames)]
        tracked[stabilize] = (iou(np.array(boxes), truth) >= 0.5).sum()
    assert tracked["predict"] > tracked["off"] + 20
