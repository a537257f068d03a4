"""Errors and stalls are reported, and affect neither the session nor other targets."""

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
from helpers.live_server import SECONDS, SIZE, EndlessFeed, socket_url, until
from ssiam.errors import IncompleteError, SourceError
from ssiam.video import Frame
from ssiam.video.frames import SourceInfo
from ssiam.web import Add, Pause, Record, Remove, Restart
from ssiam.web.events import Listeners
from ssiam.web.feeds.opening import open_feed
from ssiam.web.feeds.paced import PacedFeed
from ssiam.web.feeds.reconnecting import ReconnectingFeed
from ssiam.web.monitoring import ErrorReporter
from ssiam.web.recording import Recordings
from ssiam.web.rerun import RerunRecorder
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session
from ssiam.web.types import CommandError

BOX = (50, 40, 40, 36)


class ObservedSession:
    """A session without a server, with all its steps, notes and health changes."""

    def __init__(self, tracker, feed=None, **options):
        self.steps, self.notes, self.healths = [], [], []
        self.session = Session(feed or EndlessFeed(SIZE), tracker, "kcf", Recordings(), **options)
        self.session.listen(self.steps.append)
        self.session.listen_notes(self.notes.append)
        self.session.listen_health(self.healths.append)

    def __enter__(self):
        self.session.start()
        until(lambda: self.steps)
        return self

    def __exit__(self, *exc):
        self.session.close()

    def ask(self, command):
        return self.session.submit(command).result(SECONDS)


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_a_tracker_that_raises_on_every_tenth_frame_loses_these_frames(stabilize):
    with ObservedSession(failing_tracker(every_tenth, stabilize)) as observed:
        first, second = (observed.ask(Add(BOX)) for _ in range(2))
        until(
            lambda: (
                sum(bool(step.targets and step.targets[0].error) for step in observed.steps) >= 3
            )
        )
        steps = [step for step in observed.steps if len(step.targets) == 2]
    failed = [step for step in steps if step.targets[0].error]
    assert {step.targets[0].error for step in failed} == {
        "FailingTracker.update failed: RuntimeError: this network has come apart in two lines"
    }
    assert all(step.targets[0].track.lost for step in failed)
    numbers = [step.number for step in failed]
    assert set(np.diff(numbers)) == {10}
    good = [step for step in steps if not step.targets[0].error]
    assert all(step.targets[0].track.score > 0 for step in good[2:])
    assert not any(step.error for step in steps)
    # One note for each of the two targets, not one for each frame.
    notes = [note for note in observed.notes if "come apart" in note.message]
    assert len(notes) == 2
    assert {note.level for note in notes} == {"error"}
    assert (first, second) == (1, 2)


def test_when_the_session_thread_dies_pending_commands_are_refused():
    with ObservedSession(failing_tracker(leave)) as observed:
        observed.ask(Add(BOX))
        until(lambda: observed.session.health.state == "failed")
        assert "SystemExit: out of the thread" in observed.session.health.message
        with pytest.raises(CommandError, match="Tracking has ended"):
            observed.ask(Pause(True))
        assert [health.state for health in observed.healths] == ["failed"]
    assert not observed.session.stuck


def test_commands_are_refused_while_a_frame_is_stalled():
    hang = Hang()
    with ObservedSession(failing_tracker(hang), stall_seconds=2.0) as observed:
        observed.ask(Add(BOX))
        assert hang.hangs.wait(SECONDS)
        waiting = observed.session.submit(Pause(False))
        with pytest.raises(CommandError, match=r"stalled: frame \d+ has not finished"):
            waiting.result(SECONDS)
        assert observed.session.health.state == "stalled"
        with pytest.raises(CommandError, match="has stalled"):
            observed.ask(Remove())
        hang.let_go.set()
        until(lambda: observed.session.health.state == "running")
        observed.ask(Remove())
        assert [health.state for health in observed.healths] == ["stalled", "running"]


def test_a_stalled_command_is_refused():
    with ObservedSession(failing_tracker(lambda frame: None), stall_seconds=0.3) as observed:
        observed.session._engine._record = lambda on: time.sleep(1.5)
        with pytest.raises(CommandError, match="the command record has not finished"):
            observed.ask(Record(True))
        until(lambda: observed.session.health.state == "running")
        assert observed.ask(Pause(False)) is None


def test_a_session_with_a_stalled_frame_can_be_closed():
    hang = Hang()
    observed = ObservedSession(failing_tracker(hang), stall_seconds=0.3)
    with observed:
        observed.ask(Add(BOX))
        assert hang.hangs.wait(SECONDS)
    assert observed.session.stuck
    hang.let_go.set()
    until(lambda: not observed.session.stuck)


def test_a_listener_that_raises_affects_no_other():
    with ObservedSession(ssiam.load_tracker("kcf")) as observed:
        observed.session.listen(lambda step: 1 / 0)
        count = len(observed.steps)
        later = []
        observed.session.listen(later.append)
        until(lambda: len(observed.steps) > count + 3 and len(later) > 3)


@pytest.mark.parametrize("smaller", [(64, 48), (32, 20), (1, 1)])
def test_a_restart_of_a_file_whose_size_has_changed(tmp_path, smaller):
    path = tmp_path / "frames"
    write_frames(path, (320, 240))
    feed = open_feed(str(path), pace="fast", notify=lambda note: None)
    with ObservedSession(ssiam.load_tracker("csrt"), feed) as observed:
        observed.ask(Add((200, 150, 60, 50)))
        write_frames(path, smaller)
        observed.ask(Restart())
        until(lambda: observed.steps[-1].frame.image.shape[:2] == smaller[::-1])
        assert observed.session.info.size_wh == smaller
        assert not observed.steps[-1].targets
        assert "draw the targets again" in observed.notes[-1].message
        write_frames(path, (320, 240))
        observed.ask(Restart())
        until(lambda: observed.steps[-1].frame.image.shape[:2] == (240, 320))
        assert observed.ask(Add((200, 150, 60, 50))) == 2
        assert observed.session.health.state == "running"


def write_frames(folder, size_wh):
    folder.mkdir(exist_ok=True)
    r = np.random.default_rng(5)
    background = r.integers(0, 255, (size_wh[1], size_wh[0], 3), dtype=np.uint8)
    for index in range(40):
        cv2.imwrite(str(folder / f"{index:04}.png"), background)


class BrokenSource:
    """A source whose reader raises an unexpected error before the second frame."""

    name, size_wh, fps, length = "broken", SIZE, Fraction(20), None
    info = SourceInfo()

    def __iter__(self):
        yield Frame(0, None, np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
        raise MemoryError("rtsp://user:secret@camera")

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        return None


def test_a_file_whose_reader_raises_ends_with_a_note():
    notes = []
    feed = PacedFeed(BrokenSource(), notes.append)
    assert feed.take(SECONDS) is not None
    until(lambda: feed.state == "ended")
    feed.close()
    (note,) = notes
    assert "broken cannot be read further (MemoryError)" in note.message
    assert "secret" not in note.message


def test_a_stream_whose_reader_raises_is_opened_again():
    opened = []

    def reopen():
        opened.append(time.monotonic())
        if len(opened) == 1:
            raise ValueError("not yet")
        return BrokenSource()

    feed = ReconnectingFeed(BrokenSource(), lambda note: None, reopen)
    until(lambda: len(opened) >= 3)
    assert feed.take(SECONDS) is not None
    feed.close()


def test_a_repeated_error_is_reported_again_after_a_pause_with_a_count(caplog):
    now, notes = [0.0], []
    errors = ErrorReporter(notes.append, clock=lambda: now[0])
    with caplog.at_level(logging.ERROR):
        for second in range(12):
            now[0] = float(second)
            assert errors.report("a frame", KeyError("x")) == "KeyError: 'x'"
            errors.report("a frame", SourceError("gone"))
    texts = [note.message for note in notes]
    assert texts == [
        "a frame: KeyError: 'x'",
        "a frame: gone",
        "a frame: KeyError: 'x' (and 9 more times since the last report)",
        "a frame: gone (and 9 more times since the last report)",
    ]
    assert caplog.text.count("Traceback") + caplog.text.count("KeyError: 'x'") >= 2


def test_a_stall_is_reported_to_clients():
    hang, notes = Hang(), Listeners()
    with (
        Session(
            EndlessFeed(SIZE), failing_tracker(hang), "kcf", Recordings(), notes, stall_seconds=0.5
        ) as session,
        LiveServer(session, port=0) as server,
    ):
        live = Served(session, server)
        with Client(live) as client:
            assert client.ask(type="add", box=BOX)["type"] == "done"
            health = client.next("health")
            assert (health["state"], "has stalled" in health["message"]) == ("stalled", True)
            answer = client.ask(type="pause")
            assert (answer["type"], "has stalled" in answer["message"]) == ("error", True)
            with Client(live) as late:
                assert late.next("health")["state"] == "stalled"
            hang.let_go.set()
            assert client.next("health") == {"type": "health", "state": "running", "message": ""}
            assert client.ask(type="pause")["type"] == "done"


def test_the_error_of_a_tracker_is_part_of_the_step():
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
    """What `Client` needs of a served session."""

    def __init__(self, session, server):
        self.session = session
        self.url = socket_url(server.address)


def test_a_server_that_ends_by_itself_raises(monkeypatch):
    with ObservedSession(ssiam.load_tracker("kcf")) as observed:
        server = LiveServer(observed.session, port=0)

        async def broken(counter):
            raise RuntimeError("no more")

        monkeypatch.setattr(server._server, "on_tick", broken)
        monkeypatch.setattr(threading, "excepthook", lambda args: None)
        with pytest.raises(IncompleteError, match="the server has ended"):
            server.run()


def test_a_rerun_file_that_fails_is_reported_and_holds_no_frames(tmp_path, monkeypatch):
    pytest.importorskip("rerun")
    with ObservedSession(ssiam.load_tracker("kcf")) as observed:
        monkeypatch.setattr(RerunRecorder, "_write", staticmethod(lambda log, step: 1 / 0))
        with RerunRecorder(observed.session, tmp_path / "a.rrd") as recorder:
            until(lambda: observed.notes)
            count = len(observed.steps)
            until(lambda: len(observed.steps) > count + 5)
            until(lambda: recorder._queue._steps.qsize() <= 1)
        assert "the Rerun file has ended: ZeroDivisionError" in observed.notes[0].message
