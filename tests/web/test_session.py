"""A session on real files: commands are executed between two frames."""

import threading

import numpy as np
import pytest

from helpers.shaky_clip import SIZE, write_clip
from helpers.watched_session import WatchedSession
from ssiam.geometry import iou, map_point
from ssiam.web import (
    Add,
    Advance,
    Hold,
    Pause,
    Record,
    Remove,
    Rename,
    Restart,
    Stabilize,
    SwitchCamera,
)
from ssiam.web.types import CommandError

FRAMES = 60


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clips") / "clip.mp4"
    return path, write_clip(path, FRAMES)


def overlap(a, b):
    return iou(np.array([a]), np.array([b]))[0]


def test_a_target_is_tracked_to_the_end(clip):
    path, boxes = clip
    with WatchedSession(path) as watched:
        assert watched.ask(Add(boxes[0], name="  the \n patch ")) == 1
        watched.ask(Pause(False))
        steps = []
        watched.until(lambda step: steps.append(step) or step.playback == "ended")
    tracked = {step.frame.index: step.targets[0] for step in steps if step.targets}
    assert set(tracked) == set(range(FRAMES))
    correct = [overlap(tracked[index].track.box, boxes[index]) > 0.5 for index in tracked]
    assert sum(correct) > 0.9 * FRAMES
    assert {target.name for target in tracked.values()} == {"the patch"}
    assert [step.number for step in steps] == list(range(steps[0].number, steps[-1].number + 1))
    assert all(step.arrived <= step.done for step in steps)


def test_a_box_drawn_into_an_old_step_is_tracked_to_the_newest(clip):
    path, boxes = clip
    with WatchedSession(path) as watched:
        for _ in range(2):
            watched.ask(Advance())
        drawn_into = watched.until(lambda step: step.frame.index == 2)
        watched.ask(Hold(drawn_into.number))
        for _ in range(28):
            watched.ask(Advance())
        watched.until(lambda step: step.frame.index == 30)
        watched.ask(Add(boxes[2], drawn_into.number))
        (target,) = watched.until(lambda step: step.targets).targets
    assert overlap(target.track.box, boxes[30]) > 0.6
    assert overlap(boxes[2], boxes[30]) < 0.3


def test_the_locked_camera_holds_the_first_target_in_the_middle(clip):
    path, boxes = clip
    with WatchedSession(path) as watched:
        watched.ask(Add(boxes[0]))
        watched.ask(SwitchCamera("locked"))
        watched.until(lambda step: step.targets and step.camera == "locked")
        watched.ask(Pause(False))
        steps = []
        watched.until(lambda step: steps.append(step) or step.frame.index >= 30)
        watched.ask(SwitchCamera("stabilized"))
        watched.until(lambda step: step.camera == "stabilized")
    distances = []
    for step in steps[10:]:
        x, y, w, h = step.targets[0].track.box
        held = map_point(step.stab_from_raw, x + w / 2, y + h / 2)
        distances.append(np.hypot(*(np.array(held) - np.array(SIZE) / 2)))
    assert np.mean(distances) < 0.1 * SIZE[0]


def test_targets_are_added_removed_and_renamed(clip):
    path, boxes = clip
    with WatchedSession(path) as watched:
        first = watched.ask(Add(boxes[0]))
        second = watched.ask(Add((200, 150, 30, 30)))
        watched.ask(Rename(second, "wall"))
        step = watched.until(lambda step: len(step.targets) == 2 and step.targets[1].name == "wall")
        assert step.targets[0].name == "target 1"
        assert step.targets[0].color != step.targets[1].color
        watched.ask(Remove(first))
        watched.ask(Advance())
        step = watched.until(lambda step: step.frame.index == 1)
        assert [target.id for target in step.targets] == [second]
        watched.ask(Remove())
        assert watched.ask(Add(boxes[1])) == 3
        watched.until(lambda step: [target.id for target in step.targets] == [3])


@pytest.mark.parametrize("after", ["off", "paper", "predict"])
@pytest.mark.parametrize("before", ["off", "predict"])
def test_targets_are_kept_when_the_method_is_switched(clip, before, after):
    path, boxes = clip
    with WatchedSession(path, stabilize=before) as watched:
        watched.ask(Add(boxes[0]))
        for _ in range(5):
            watched.ask(Advance())
        watched.until(lambda step: step.frame.index == 5)
        watched.ask(Stabilize(after))
        for _ in range(5):
            watched.ask(Advance())
        step = watched.until(lambda step: step.frame.index == 10)
    assert step.stabilize == after
    assert (step.motion is None) == (after == "off")
    assert overlap(step.targets[0].track.box, boxes[10]) > 0.5


def test_after_a_restart_the_target_starts_where_it_was_drawn(clip):
    path, boxes = clip
    with WatchedSession(path) as watched:
        for _ in range(3):
            watched.ask(Advance())
        watched.until(lambda step: step.frame.index == 3)
        watched.ask(Add(boxes[3]))
        for _ in range(4):
            watched.ask(Advance())
        watched.until(lambda step: step.frame.index == 7)
        watched.ask(Restart())
        step = watched.until(lambda step: step.frame.index == 0)
        assert step.targets == ()
        for _ in range(3):
            watched.ask(Advance())
        step = watched.until(lambda step: step.frame.index == 3)
        assert step.targets[0].id == 1
        assert step.targets[0].track.box == boxes[3]


def test_a_target_waits_for_the_frame_in_which_it_was_drawn(clip):
    path, boxes = clip
    with WatchedSession(path) as watched:
        for _ in range(3):
            watched.ask(Advance())
        watched.until(lambda step: step.frame.index == 3)
        watched.ask(Add(boxes[3], name="boat"))
        watched.ask(Restart())
        step = watched.until(lambda step: step.frame.index == 0)
        assert [(each.name, each.frame) for each in step.waiting] == [("boat", 3)]
        # Played from a frame after it, the target does not begin with a box of another frame.
        watched.ask(Restart(6))
        step = watched.until(lambda step: step.frame.index >= 6)
        assert step.frame.index == 6
        watched.ask(Advance())
        step = watched.until(lambda step: step.frame.index == 7)
        assert step.targets == ()
        assert [each.frame for each in step.waiting] == [3]
        watched.ask(Restart(2))
        watched.until(lambda step: step.frame.index == 2)
        watched.ask(Advance())
        step = watched.until(lambda step: step.frame.index == 3)
        assert step.waiting == ()
        assert step.targets[0].track.box == boxes[3]
        with pytest.raises(CommandError, match="does not exist"):
            watched.ask(Restart(10**6))


@pytest.mark.parametrize(
    ("command", "code"),
    [
        pytest.param(Add((5, 5, 0, 10)), "bad-box", id="empty box"),
        pytest.param(Add((900, 5, 10, 10)), "bad-box", id="box outside of the frame"),
        pytest.param(Add((5, 5, float("nan"), 10)), "bad-box", id="NaN"),
        pytest.param(Add((5, 5, 30, 30), 4711), "too-old", id="unknown step"),
        pytest.param(Add((5, 5, 30, 30), None, "a" * 41), "not-possible", id="long name"),
        pytest.param(Remove(9), "no-such-target", id="unknown target"),
        pytest.param(Rename(9, "a"), "no-such-target", id="unknown to rename"),
        pytest.param(Record(False), "not-possible", id="no open recording"),
    ],
)
def test_a_command_that_fails_changes_nothing(clip, command, code):
    path, boxes = clip
    with WatchedSession(path) as watched:
        with pytest.raises(CommandError) as caught:
            watched.ask(command)
        assert caught.value.code == code
        assert "\n" not in str(caught.value)
        watched.ask(Add(boxes[0]))
        watched.ask(Advance())
        step = watched.until(lambda step: step.frame.index == 1)
        assert [target.id for target in step.targets] == [1]


def test_the_number_of_targets_is_limited(clip):
    path, boxes = clip
    with WatchedSession(path, targets=1) as watched:
        watched.ask(Add(boxes[0]))
        with pytest.raises(CommandError, match="1 targets are tracked"):
            watched.ask(Add(boxes[0]))


def test_a_listener_is_called_until_it_is_removed(clip):
    path, _ = clip
    with WatchedSession(path) as watched:
        steps = []
        unlisten = watched.session.listen(steps.append)
        watched.ask(Advance())
        watched.until(lambda step: step.frame.index == 1)
        unlisten()
        count = len(steps)
        assert count
        watched.ask(Advance())
        watched.until(lambda step: step.frame.index == 2)
        assert len(steps) == count


def test_no_thread_is_left_after_close(clip):
    path, _ = clip
    with WatchedSession(path, pace="clock") as watched:
        watched.ask(Pause(False))
        assert watched.session.info.size_wh == SIZE
    names = {thread.name for thread in threading.enumerate()}
    assert not {name for name in names if name.startswith("ssiam")}
