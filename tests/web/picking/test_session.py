"""`PickSession` through `PickPage`: choosing, correcting, previewing, waiting."""

from __future__ import annotations

import threading
import time

import pytest

from helpers.live_server import until
from helpers.picking import FRAMES, NumberedClip, number_of, picking
from ssiam.exchange.blending import Keyframe
from ssiam.track import Track
from ssiam.video import open_results
from ssiam.web.picking.commands import (
    AddBox,
    Adjust,
    Click,
    Correct,
    Discard,
    Finish,
    MarkAbsent,
    Preview,
    Seek,
    TrackAll,
    Undo,
)
from ssiam.web.picking.page import PageClosedError
from ssiam.web.types import CommandError

SECONDS = 20
BOX = (20.0, 30.0, 40.0, 36.0)


@pytest.fixture
def page():
    with picking() as page:
        until(lambda: page._session.newest is not None)
        yield page


@pytest.fixture
def ask(page):
    return lambda command: page._session.submit(command).result(SECONDS)


def boxes(page):
    return [(each.id, each.frame, each.xywh) for each in page._session.state.targets]


def test_targets_begin_in_the_frames_in_which_they_are_chosen(page, ask):
    assert ask(AddBox(0, BOX)) == 1
    assert ask(Seek(9)) == 9
    assert number_of(page._session.newest.frame.image) == 9
    assert ask(Click(9, (60, 50))) == 2
    ask(Adjust(1, (21, 30, 40, 36)))
    ask(TrackAll())
    assert page.wait_for_targets() == [
        (Keyframe(0, (21, 30, 40, 36)),),
        (Keyframe(9, (50, 40, 20, 20)),),
    ]


def keyframes(page):
    return [
        {keyframe.frame: keyframe.xywh for keyframe in each.keyframes}
        for each in page._session.state.targets
    ]


def test_a_target_has_keyframes_in_further_frames(page, ask):
    ask(Seek(9))
    assert ask(AddBox(9, BOX)) == 1
    ask(Seek(4))
    assert ask(Click(4, (60, 50), id=1)) == 1
    ask(Adjust(1, (1, 2, 30, 40), frame=9))
    ask(Seek(15))
    ask(MarkAbsent(15, 1))
    ask(Seek(20))
    assert ask(AddBox(20, BOX, id=1)) == 1
    expected = {4: (50, 40, 20, 20), 9: (1, 2, 30, 40), 15: None, 20: BOX}
    assert keyframes(page) == [expected]
    assert list(keyframes(page)[0]) == sorted(expected)
    assert boxes(page) == [(1, 4, (50, 40, 20, 20))]
    # Each is replaced in its own frame, and removed alone.
    ask(MarkAbsent(20, 1))
    ask(Discard(1, frame=4))
    assert keyframes(page) == [{9: (1, 2, 30, 40), 15: None, 20: None}]
    for _ in range(2):
        ask(Undo())
    assert keyframes(page) == [expected]
    ask(TrackAll())
    (own,) = page.wait_for_targets()
    assert {each.frame: each.xywh for each in own} == expected


def test_a_target_is_removed_with_its_last_box(page, ask):
    ask(AddBox(0, BOX))
    with pytest.raises(CommandError, match="only box"):
        ask(MarkAbsent(0, 1))
    ask(Seek(5))
    ask(MarkAbsent(5, 1))
    ask(Discard(1, frame=0))
    assert keyframes(page) == []
    ask(Undo())
    assert keyframes(page) == [{0: BOX, 5: None}]


def test_further_keyframes_are_refused_where_they_cannot_be_tracked():
    with picking(no_keyframes="x: cannot be read from its end") as page:
        until(lambda: page._session.newest is not None)
        ask = lambda command: page._session.submit(command).result(SECONDS)  # noqa: E731
        ask(AddBox(0, BOX))
        ask(AddBox(0, (1, 2, 30, 40), id=1))
        ask(Seek(5))
        for command in (AddBox(5, BOX, id=1), Click(5, (60, 50), id=1), MarkAbsent(5, 1)):
            with pytest.raises(CommandError, match="read from its end"):
                ask(command)
        assert keyframes(page) == [{0: (1, 2, 30, 40)}]
        assert ask(AddBox(5, BOX)) == 2


def test_every_change_can_be_taken_back(page, ask):
    ask(AddBox(0, BOX))
    ask(Adjust(1, (1, 2, 30, 40)))
    ask(Discard(1))
    seen = []
    while page._session.state.can_undo:
        ask(Undo())
        seen.append(boxes(page))
    assert seen == [[(1, 0, (1, 2, 30, 40))], [(1, 0, BOX)], []]
    with pytest.raises(CommandError, match="nothing to take back"):
        ask(Undo())
    assert ask(AddBox(0, BOX)) == 2, "an id was used twice"


REFUSED = [
    # command, code
    (AddBox(3, BOX), "too-old"),
    (Click(3, (60, 50)), "too-old"),
    (Click(0, (161, 50)), "bad-box"),
    (AddBox(0, (500, 500, 9, 9)), "bad-box"),
    (AddBox(0, (0, 0, 0.5, 9)), "bad-box"),
    (Adjust(1, (0, 0, 1e6, 1e6)), "bad-box"),
    (Adjust(7, BOX), "no-such-target"),
    (Adjust(1, BOX, frame=3), "no-such-target"),
    (AddBox(0, BOX, id=7), "no-such-target"),
    (AddBox(3, BOX, id=1), "too-old"),
    (MarkAbsent(3, 1), "too-old"),
    (MarkAbsent(0, 7), "no-such-target"),
    (Discard(7), "no-such-target"),
    (Discard(1, frame=3), "no-such-target"),
    (Preview(7), "no-such-target"),
    (Finish(), "not-possible"),
]


@pytest.mark.parametrize(("command", "code"), REFUSED, ids=lambda value: str(value)[:30])
def test_a_refused_command_changes_nothing(page, ask, command, code):
    ask(AddBox(0, BOX))
    before = page._session.state
    with pytest.raises(CommandError) as refusal:
        ask(command)
    assert refusal.value.code == code
    assert page._session.state == before


def test_a_target_that_does_not_exist_cannot_be_removed(ask):
    with pytest.raises(CommandError, match="no target 1"):
        ask(Discard(1))


def test_nothing_is_tracked_without_a_target(page, ask):
    for command in (TrackAll(), Preview()):
        with pytest.raises(CommandError, match="no target"):
            ask(command)


def test_the_targets_are_fixed_once_the_run_has_begun(page, ask):
    ask(AddBox(0, BOX))
    ask(TrackAll())
    for command in (Seek(3), Discard(1), Undo(), TrackAll()):
        with pytest.raises(CommandError, match="being tracked"):
            ask(command)
    page.report(3, FRAMES, 50.0)
    page.finish([])
    ask(Finish())
    page.wait_until_done()


def test_a_written_clip_is_corrected_with_its_boxes_as_a_guide(page, ask, tmp_path):
    ask(AddBox(0, BOX))
    with pytest.raises(CommandError, match="nothing is written"):
        ask(Correct())
    ask(TrackAll())
    page._on_clients(1)
    assert len(page.wait_for_targets()) == 1
    results = tmp_path / "r.csv"
    with open_results(results, layout=None, targets=1) as sink:
        for index, lost in enumerate([False, False, False, True]):
            sink.write(index, None, [Track((index, 2, 30, 40), score=0.5, lost=lost)])
    page.finish([("results", results)], ["look here: frame 2"])
    answer = []
    waiter = threading.Thread(target=lambda: answer.append(page.wait_until_done()))
    waiter.start()
    ask(Correct())
    waiter.join(SECONDS)
    assert answer == [True]
    state = page._session.state
    assert (state.phase, state.notes, state.can_undo) == ("picking", ("look here: frame 2",), True)
    shown = []
    for index in range(4):
        ask(Seek(index))
        shown.append([each.track.box for each in page._session.newest.targets])
    assert shown == [[BOX], [(1, 2, 30, 40)], [(2, 2, 30, 40)], []]
    ask(Seek(2))
    ask(AddBox(2, BOX, id=1))
    assert page._session.newest.targets[0].track.box == BOX
    ask(TrackAll())
    assert [each.frame for each in page.wait_for_targets()[0]] == [0, 2]
    page.finish([])
    ask(Finish())
    assert not page.wait_until_done()


def test_a_second_run_is_refused_where_results_cannot_be_replaced():
    with picking(no_second_run="cannot be written again") as page:
        until(lambda: page._session.newest is not None)
        ask = lambda command: page._session.submit(command).result(SECONDS)  # noqa: E731
        ask(AddBox(0, BOX))
        ask(TrackAll())
        page.finish([])
        with pytest.raises(CommandError, match="written again"):
            ask(Correct())
        assert page._session.state.phase == "written"


def test_a_preview_shows_one_second_with_all_targets_of_it(page, ask):
    ask(AddBox(0, BOX))
    ask(Seek(4))
    ask(AddBox(4, (80, 40, 30, 30)))
    steps = []
    page._session.listen(steps.append, lambda state: None)
    ask(Preview())
    shown = [(step.frame.index, [t.name for t in step.targets]) for step in steps]
    assert shown == [(index, ["target 1", "target 2"][: 1 + (index >= 4)]) for index in range(10)]
    assert all(step.playback == "playing" for step in steps)
    assert page._session.state.phase == "picking"


def test_a_preview_begins_again_at_keyframes(page, ask):
    ask(AddBox(0, BOX))
    for index, command in ((4, MarkAbsent(4, 1)), (7, AddBox(7, (80, 40, 30, 30), id=1))):
        ask(Seek(index))
        ask(command)
    steps = []
    page._session.listen(steps.append, lambda state: None)
    ask(Preview(1))
    assert steps[0].frame.index == 7, "not from the keyframe that is shown"
    ask(Seek(1))
    steps.clear()
    ask(Preview(1))
    shown = {step.frame.index: [each.id for each in step.targets] for step in steps}
    assert shown == {index: [] if 4 <= index < 7 else [1] for index in range(10)}
    (again,) = (step.targets for step in steps if step.frame.index == 7)
    assert again[0].track.box == (80, 40, 30, 30)


def test_a_command_ends_the_preview(page, ask):
    ask(AddBox(0, BOX))
    phases = []
    page._session.listen(lambda step: None, lambda state: phases.append(state.phase))
    preview = page._session.submit(Preview())
    until(lambda: "preview" in phases)
    assert ask(Seek(20)) == 20
    assert preview.done()
    assert page._session.newest.frame.index == 20


def test_the_newest_of_many_seeks_is_shown(page):
    answers = [page._session.submit(Seek(index)) for index in (23, 5, 22, 7)]
    assert answers[-1].result(SECONDS) == 7
    assert all(answer.done() for answer in answers)


def test_a_failing_proposal_is_answered_and_the_page_lives_on():
    def fail(image, point):
        raise RuntimeError("no memory")

    with picking(propose=fail) as page:
        until(lambda: page._session.newest is not None)
        with pytest.raises(CommandError, match="no memory"):
            page._session.submit(Click(0, (9, 9))).result(SECONDS)
        assert page._session.submit(AddBox(0, BOX)).result(SECONDS) == 1


def test_the_page_begins_where_the_run_begins():
    with picking(is_selectable=lambda frame: frame.index >= 5) as page:
        until(lambda: page._session.newest is not None)
        session = page._session
        assert session.newest.frame.index == 5
        assert session.submit(Seek(4)).result(SECONDS) == 4
        with pytest.raises(CommandError, match="outside of the part"):
            session.submit(AddBox(4, BOX)).result(SECONDS)


def test_waiting_ends_when_the_page_was_closed():
    with picking() as page:
        page._on_clients(1)
        page._on_clients(0)
        with pytest.raises(PageClosedError):
            page.wait_for_targets()


def test_a_page_that_comes_back_is_waited_for(page):
    page._on_clients(1)
    page._on_clients(0)
    page._on_clients(1)
    found = []
    waiter = threading.Thread(target=lambda: found.append(page.wait_for_targets()))
    waiter.start()
    time.sleep(1)
    page._session.submit(AddBox(0, BOX)).result(SECONDS)
    page._session.submit(TrackAll()).result(SECONDS)
    waiter.join(SECONDS)
    assert found == [[(Keyframe(0, BOX),)]]


def test_without_a_visitor_nobody_has_to_say_done(page):
    page.finish([])
    page.wait_until_done()


def test_closing_refuses_what_waits():
    with picking(NumberedClip()) as page:
        session = page._session
    with pytest.raises(CommandError, match="ended"):
        session.submit(Seek(1)).result(SECONDS)
