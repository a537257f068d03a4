"""A session on real files: what is asked for happens between two frames, and is told."""

import threading

import numpy as np
import pytest

from helpers.shaky_clip import SIZE, write_clip
from helpers.watched_session import Watched
from ssiam.geometry import iou
from ssiam.web import commands
from ssiam.web.errors import CommandError

FRAMES = 60


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clips") / "clip.mp4"
    return path, write_clip(path, FRAMES)


def overlap(a, b):
    return iou(np.array([a]), np.array([b]))[0]


def test_a_target_is_followed_to_the_end(clip):
    path, boxes = clip
    with Watched(path) as watched:
        assert watched.ask(commands.Add(boxes[0], name="  the \n patch ")) == 1
        watched.ask(commands.Pause(False))
        seen = []
        watched.until(lambda step: seen.append(step) or step.playing == "ended")
    followed = {step.frame.index: step.targets[0] for step in seen if step.targets}
    assert set(followed) == set(range(FRAMES))
    right = [overlap(followed[index].track.box, boxes[index]) > 0.5 for index in followed]
    assert sum(right) > 0.9 * FRAMES
    assert {target.name for target in followed.values()} == {"the patch"}
    assert [step.number for step in seen] == list(range(seen[0].number, seen[-1].number + 1))
    assert all(step.arrived <= step.done for step in seen)


def test_a_box_that_is_drawn_into_an_old_step_is_caught_up_with(clip):
    path, boxes = clip
    with Watched(path) as watched:
        for _ in range(2):
            watched.ask(commands.Advance())
        drawn_into = watched.until(lambda step: step.frame.index == 2)
        watched.ask(commands.Hold(drawn_into.number))
        for _ in range(28):
            watched.ask(commands.Advance())
        watched.until(lambda step: step.frame.index == 30)
        watched.ask(commands.Add(boxes[2], drawn_into.number))
        (target,) = watched.until(lambda step: step.targets).targets
    assert overlap(target.track.box, boxes[30]) > 0.6
    assert overlap(boxes[2], boxes[30]) < 0.3


def test_targets_come_and_go_and_are_renamed(clip):
    path, boxes = clip
    with Watched(path) as watched:
        first = watched.ask(commands.Add(boxes[0]))
        second = watched.ask(commands.Add((200, 150, 30, 30)))
        watched.ask(commands.Rename(second, "wall"))
        step = watched.until(lambda step: len(step.targets) == 2 and step.targets[1].name == "wall")
        assert step.targets[0].name == "target 1"
        assert step.targets[0].colour != step.targets[1].colour
        watched.ask(commands.Remove(first))
        watched.ask(commands.Advance())
        step = watched.until(lambda step: step.frame.index == 1)
        assert [target.id for target in step.targets] == [second]
        watched.ask(commands.Remove())
        assert watched.ask(commands.Add(boxes[1])) == 3
        watched.until(lambda step: [target.id for target in step.targets] == [3])


@pytest.mark.parametrize("after", ["off", "paper", "predict"])
@pytest.mark.parametrize("before", ["off", "predict"])
def test_the_steadying_is_switched_and_the_target_kept(clip, before, after):
    path, boxes = clip
    with Watched(path, stabilize=before) as watched:
        watched.ask(commands.Add(boxes[0]))
        for _ in range(5):
            watched.ask(commands.Advance())
        watched.until(lambda step: step.frame.index == 5)
        watched.ask(commands.Steady(after))
        for _ in range(5):
            watched.ask(commands.Advance())
        step = watched.until(lambda step: step.frame.index == 10)
    assert step.stabilize == after
    assert (step.motion is None) == (after == "off")
    assert overlap(step.targets[0].track.box, boxes[10]) > 0.5


def test_a_restart_begins_where_the_target_was_drawn(clip):
    path, boxes = clip
    with Watched(path) as watched:
        for _ in range(3):
            watched.ask(commands.Advance())
        watched.until(lambda step: step.frame.index == 3)
        watched.ask(commands.Add(boxes[3]))
        for _ in range(4):
            watched.ask(commands.Advance())
        watched.until(lambda step: step.frame.index == 7)
        watched.ask(commands.Restart())
        step = watched.until(lambda step: step.frame.index == 0)
        assert step.targets == ()
        for _ in range(3):
            watched.ask(commands.Advance())
        step = watched.until(lambda step: step.frame.index == 3)
        assert step.targets[0].id == 1
        assert step.targets[0].track.box == boxes[3]


@pytest.mark.parametrize(
    ("command", "code"),
    [
        pytest.param(commands.Add((5, 5, 0, 10)), "bad-box", id="empty box"),
        pytest.param(commands.Add((900, 5, 10, 10)), "bad-box", id="box elsewhere"),
        pytest.param(commands.Add((5, 5, float("nan"), 10)), "bad-box", id="no number"),
        pytest.param(commands.Add((5, 5, 30, 30), 4711), "too-old", id="unknown step"),
        pytest.param(commands.Add((5, 5, 30, 30), None, "a" * 41), "not-possible", id="long name"),
        pytest.param(commands.Remove(9), "no-such-target", id="unknown target"),
        pytest.param(commands.Rename(9, "a"), "no-such-target", id="unknown to rename"),
        pytest.param(commands.Record(False), "not-possible", id="nothing recorded"),
    ],
)
def test_what_cannot_be_done_is_told_and_nothing_happens(clip, command, code):
    path, boxes = clip
    with Watched(path) as watched:
        with pytest.raises(CommandError) as caught:
            watched.ask(command)
        assert caught.value.code == code
        assert "\n" not in str(caught.value)
        watched.ask(commands.Add(boxes[0]))
        watched.ask(commands.Advance())
        step = watched.until(lambda step: step.frame.index == 1)
        assert [target.id for target in step.targets] == [1]


def test_there_are_not_too_many_targets(clip):
    path, boxes = clip
    with Watched(path, targets=1) as watched:
        watched.ask(commands.Add(boxes[0]))
        with pytest.raises(CommandError, match="1 targets are followed"):
            watched.ask(commands.Add(boxes[0]))


def test_a_listener_is_told_until_it_ends(clip):
    path, _ = clip
    with Watched(path) as watched:
        told = []
        end = watched.session.listen(told.append)
        watched.ask(commands.Advance())
        watched.until(lambda step: step.frame.index == 1)
        end()
        count = len(told)
        assert count
        watched.ask(commands.Advance())
        watched.until(lambda step: step.frame.index == 2)
        assert len(told) == count


def test_nothing_runs_on_after_the_end(clip):
    path, _ = clip
    with Watched(path, pace="clock") as watched:
        watched.ask(commands.Pause(False))
        assert watched.session.info.size_wh == SIZE
    names = {thread.name for thread in threading.enumerate()}
    assert not {name for name in names if name.startswith("ssiam")}
