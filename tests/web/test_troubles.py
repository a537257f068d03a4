"""What goes wrong in a session ends neither it nor anybody else's target, and is told."""

import logging
import threading
import time
from fractions import Fraction

import cv2
import numpy as np
import pytest

import ssiam
from helpers.failing_trackers import Hang, every_tenth, failing_tracker, leave
from helpers.live_clients import Client, step_until
from helpers.live_server import SECONDS, SIZE, EndlessFeed, until
from ssiam.errors import IncompleteError, SourceError
from ssiam.video import Frame
from ssiam.video.frames import SourceFacts
from ssiam.web import commands
from ssiam.web.errors import CommandError
from ssiam.web.feeds.feed import open_feed
from ssiam.web.feeds.pacing import PacedFeed
from ssiam.web.feeds.reconnecting import ReconnectingFeed
from ssiam.web.recording import Recordings
from ssiam.web.rerun_tap import RerunTap
from ssiam.web.rota import Rota
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session
from ssiam.web.troubles import Troubles

BOX = (50, 40, 40, 36)


class Told:
    """A session that is not served, with everything that it says."""

    def __init__(self, tracker, feed=None, **options):
        self.steps, self.notes, self.healths = [], [], []
        self.session = Session(feed or EndlessFeed(SIZE), tracker, "kcf", Recordings(), **options)
        self.session.listen(self.steps.append)
        self.session.notes(self.notes.append)
        self.session.healths(self.healths.append)

    def __enter__(self):
        self.session.start()
        until(lambda: self.steps)
        return self

    def __exit__(self, *exc):
        self.session.close()

    def ask(self, command):
        return self.session.submit(command).result(SECONDS)


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_a_tracker_that_raises_every_tenth_frame_costs_these_frames(stabilize):
    with Told(failing_tracker(every_tenth, stabilize)) as told:
        first, second = (told.ask(commands.Add(BOX)) for _ in range(2))
        until(lambda: sum(bool(step.targets and step.targets[0].error) for step in told.steps) >= 3)
        seen = [step for step in told.steps if len(step.targets) == 2]
    failed = [step for step in seen if step.targets[0].error]
    assert {step.targets[0].error for step in failed} == {
        "RuntimeError: this network has come apart in two lines"
    }
    assert all(step.targets[0].track.lost for step in failed)
    numbers = [step.number for step in failed]
    assert set(np.diff(numbers)) == {10}
    good = [step for step in seen if not step.targets[0].error]
    assert all(step.targets[0].track.score > 0 for step in good[2:])
    assert not any(step.error for step in seen)
    # Two targets, each told of once, and not thirty times a second.
    notes = [note for note in told.notes if "come apart" in note.message]
    assert len(notes) == 2
    assert {note.level for note in notes} == {"error"}
    assert (first, second) == (1, 2)


def test_a_thread_that_dies_is_told_and_everybody_who_waits_is_answered():
    with Told(failing_tracker(leave)) as told:
        told.ask(commands.Add(BOX))
        until(lambda: told.session.health.state == "failed")
        assert "SystemExit: out of the thread" in told.session.health.message
        with pytest.raises(CommandError, match="Tracking has ended"):
            told.ask(commands.Pause(True))
        assert [health.state for health in told.healths] == ["failed"]
    assert not told.session.stuck


def test_a_frame_that_does_not_end_is_told_and_commands_are_refused_until_it_does():
    hang = Hang()
    with Told(failing_tracker(hang), patience=0.5) as told:
        told.ask(commands.Add(BOX))
        assert hang.hangs.wait(SECONDS)
        waiting = told.session.submit(commands.Pause(False))
        with pytest.raises(CommandError, match=r"stands still: frame \d+ has not come to an end"):
            waiting.result(SECONDS)
        assert told.session.health.state == "stalled"
        with pytest.raises(CommandError, match="stands still"):
            told.ask(commands.Remove())
        hang.let_go.set()
        until(lambda: told.session.health.state == "running")
        told.ask(commands.Remove())
        assert [health.state for health in told.healths] == ["stalled", "running"]


def test_a_command_that_does_not_end_is_answered():
    with Told(failing_tracker(lambda frame: None), patience=0.3) as told:
        told.session._following._record = lambda on: time.sleep(1.5)
        with pytest.raises(CommandError, match="the command record has not come to an end"):
            told.ask(commands.Record(True))
        until(lambda: told.session.health.state == "running")
        assert told.ask(commands.Pause(False)) is None


def test_a_session_with_a_frame_that_never_ends_can_be_closed():
    hang = Hang()
    told = Told(failing_tracker(hang), patience=0.3)
    with told:
        told.ask(commands.Add(BOX))
        assert hang.hangs.wait(SECONDS)
    assert told.session.stuck
    hang.let_go.set()
    until(lambda: not told.session.stuck)


def test_a_listener_that_raises_disturbs_no_other():
    with Told(ssiam.load_tracker("kcf")) as told:
        told.session.listen(lambda step: 1 / 0)
        count = len(told.steps)
        later = []
        told.session.listen(later.append)
        until(lambda: len(told.steps) > count + 3 and len(later) > 3)


@pytest.mark.parametrize("smaller", [(64, 48), (32, 20), (1, 1)])
def test_a_restart_of_a_file_that_has_another_size_now(tmp_path, smaller):
    path = tmp_path / "frames"
    write_frames(path, (320, 240))
    feed = open_feed(str(path), pace="fast", notes=lambda note: None)
    with Told(ssiam.load_tracker("csrt"), feed) as told:
        told.ask(commands.Add((200, 150, 60, 50)))
        write_frames(path, smaller)
        told.ask(commands.Restart())
        until(lambda: told.steps[-1].frame.image.shape[:2] == smaller[::-1])
        assert told.session.info.size_wh == smaller
        assert not told.steps[-1].targets
        assert "draw the targets anew" in told.notes[-1].message
        write_frames(path, (320, 240))
        told.ask(commands.Restart())
        until(lambda: told.steps[-1].frame.image.shape[:2] == (240, 320))
        assert told.ask(commands.Add((200, 150, 60, 50))) == 2
        assert told.session.health.state == "running"


def write_frames(folder, size_wh):
    folder.mkdir(exist_ok=True)
    r = np.random.default_rng(5)
    background = r.integers(0, 255, (size_wh[1], size_wh[0], 3), dtype=np.uint8)
    for index in range(40):
        cv2.imwrite(str(folder / f"{index:04}.png"), background)


class Broken:
    """A source that breaks with an error of its reader's own, in front of its second frame."""

    name, size_wh, fps, length = "broken", SIZE, Fraction(20), None
    facts = SourceFacts()

    def __iter__(self):
        yield Frame(0, None, np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
        raise MemoryError("rtsp://user:secret@camera")

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        return None


def test_a_file_whose_reader_raises_anything_has_ended_and_says_so():
    notes = []
    feed = PacedFeed(Broken(), notes.append)
    assert feed.take(SECONDS) is not None
    until(lambda: feed.state == "ended")
    feed.close()
    (note,) = notes
    assert "broken cannot be read any further (MemoryError)" in note.message
    assert "secret" not in note.message


def test_a_stream_whose_reader_raises_anything_is_opened_again():
    opened = []

    def reopen():
        opened.append(time.monotonic())
        if len(opened) == 1:
            raise ValueError("not yet")
        return Broken()

    feed = ReconnectingFeed(Broken(), lambda note: None, reopen)
    until(lambda: len(opened) >= 3)
    assert feed.take(SECONDS) is not None
    feed.close()


def test_the_same_error_is_told_again_after_a_while_with_its_count(caplog):
    now, notes = [0.0], []
    troubles = Troubles(notes.append, clock=lambda: now[0])
    with caplog.at_level(logging.ERROR):
        for second in range(12):
            now[0] = float(second)
            assert troubles.tell("a frame", KeyError("x")) == "KeyError: 'x'"
            troubles.tell("a frame", SourceError("gone"))
    texts = [note.message for note in notes]
    assert texts == [
        "a frame: KeyError: 'x'",
        "a frame: gone",
        "a frame: KeyError: 'x' (and 9 times more since it was last reported)",
        "a frame: gone (and 9 times more since it was last reported)",
    ]
    assert caplog.text.count("Traceback") + caplog.text.count("KeyError: 'x'") >= 2


def test_everything_is_told_through_the_socket():
    hang, news = Hang(), Rota()
    with (
        Session(
            EndlessFeed(SIZE), failing_tracker(hang), "kcf", Recordings(), news, patience=0.5
        ) as session,
        LiveServer(session, port=0) as server,
    ):
        live = Served(session, server)
        with Client(live) as client:
            assert client.ask(type="add", box=BOX)["type"] == "done"
            told = client.next("health")
            assert (told["state"], "stands still" in told["message"]) == ("stalled", True)
            answer = client.ask(type="pause")
            assert (answer["type"], "stands still" in answer["message"]) == ("error", True)
            with Client(live) as late:
                assert late.next("health")["state"] == "stalled"
            hang.let_go.set()
            assert client.next("health") == {"type": "health", "state": "running", "message": ""}
            assert client.ask(type="pause")["type"] == "done"


def test_a_failing_tracker_is_told_in_every_step():
    with (
        Session(EndlessFeed(SIZE), failing_tracker(every_tenth), "kcf", Recordings()) as session,
        LiveServer(session, port=0) as server,
        Client(Served(session, server)) as client,
    ):
        assert client.ask(type="add", box=BOX)["type"] == "done"
        failed = step_until(client, lambda step: step["targets"] and step["targets"][0]["error"])
        assert failed["targets"][0]["lost"]
        assert "come apart" in failed["targets"][0]["error"]
        step_until(client, lambda step: step["targets"] and not step["targets"][0]["error"])


class Served:
    def __init__(self, session, server):
        self.session = session
        self.url = f"ws://127.0.0.1:{server.access.port}/session"


def test_a_server_that_ends_by_itself_is_told(monkeypatch):
    with Told(ssiam.load_tracker("kcf")) as told:
        server = LiveServer(told.session, port=0)

        async def broken(counter):
            raise RuntimeError("no more")

        monkeypatch.setattr(server._server, "on_tick", broken)
        monkeypatch.setattr(threading, "excepthook", lambda args: None)
        with pytest.raises(IncompleteError, match="the server has ended"):
            server.run()


def test_a_rerun_file_that_fails_is_told_and_holds_no_frames(tmp_path, monkeypatch):
    pytest.importorskip("rerun")
    with Told(ssiam.load_tracker("kcf")) as told:
        monkeypatch.setattr(RerunTap, "_write", staticmethod(lambda log, step: 1 / 0))
        with RerunTap(told.session, tmp_path / "a.rrd") as tap:
            until(lambda: told.notes)
            count = len(told.steps)
            until(lambda: len(told.steps) > count + 5)
            until(lambda: tap._backlog._steps.qsize() <= 1)
        assert "the Rerun file has ended: ZeroDivisionError" in told.notes[0].message
