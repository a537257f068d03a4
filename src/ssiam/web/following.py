"""`Following`: frames and commands in, steps out; the work of a live session."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from ssiam.geometry import IDENTITY, Transform
from ssiam.stabilize import Stabilizer, StabilizerConfig
from ssiam.video import Frame
from ssiam.web import commands
from ssiam.web.commands import Command
from ssiam.web.errors import CommandError, Note
from ssiam.web.feeds.feed import Arrival, Feed
from ssiam.web.past import Past
from ssiam.web.recording import Recordings
from ssiam.web.step import Playing, Step
from ssiam.web.targets import Targets
from ssiam.web.troubles import Troubles

_RATE_STEPS: Final = 30  # over which the rate is taken


class Following:
    """Follows targets on what a feed delivers; not to be shared between threads.

    An error in a frame is told of, and the next frame is taken as if there had been none.

    Parameters
    ----------
    feed : Feed
    targets : Targets
    recordings : Recordings
    troubles : Troubles
        Told of errors.
    note : callable
        Told what else people should know.
    """

    def __init__(
        self,
        feed: Feed,
        targets: Targets,
        recordings: Recordings,
        troubles: Troubles,
        note: Callable[[Note], None],
    ) -> None:
        self._feed, self._targets, self._recordings = feed, targets, recordings
        self._troubles, self._note = troubles, note
        self._stabilizer = Stabilizer(StabilizerConfig("paper"))
        self._past = Past()
        self._done: deque[float] = deque(maxlen=_RATE_STEPS)
        self._paused = False
        self._size_wh: tuple[int, int] | None = None
        self._begins = True  # whether the next frame is the first one of its source
        self.newest: Step | None = None

    @property
    def playing(self) -> Playing:
        """What the source is doing."""
        if self._feed.state == "playing" and self._paused:
            return "paused"
        return self._feed.state

    def see(self, arrival: Arrival) -> Step:
        """The step that a frame makes."""
        frame = arrival.frame
        stab_from_raw, error = IDENTITY, ""
        try:
            stab_from_raw = self._track(frame)
        except Exception as failure:
            error = self._troubles.tell("tracking in this frame", failure)
        motion = None if error else self._targets.motion
        done = time.monotonic()
        self._done.append(done)
        step = Step(
            number=1 if self.newest is None else self.newest.number + 1,
            frame=frame,
            targets=self._targets.seen(),
            motion=motion,
            stab_from_raw=stab_from_raw,
            stabilize=self._targets.config.stabilize,
            arrived=arrival.arrived,
            done=done,
            fps=self._rate(),
            dropped=self._feed.dropped,
            playing=self.playing,
            recording=self._recordings.current,
            error=error,
        )
        self._recordings.write(step)
        return self._kept(step)

    def again(self) -> Step | None:
        """The newest step as things are now, on the frame that it had."""
        if self.newest is None:
            return None
        step = replace(
            self.newest,
            number=self.newest.number + 1,
            targets=self._targets.seen(),
            stabilize=self._targets.config.stabilize,
            playing=self.playing,
            recording=self._recordings.current,
        )
        return self._kept(step)

    def carry_out(self, command: Command) -> Any:
        """Do what is asked for; the answer to it.

        Raises
        ------
        SsiamError
            It cannot be done. Any other error is one of ours.
        """
        match command:
            case commands.Add(xywh, number, name):
                frames = [step.frame for step in self._past.since(number)]
                return self._targets.add(frames, xywh, name)
            case commands.Hold(number):
                self._past.hold(number)
            case commands.Remove(id):
                self._targets.remove(id)
            case commands.Rename(id, name):
                self._targets.rename(id, name)
            case commands.Steady(method):
                self._steady(StabilizerConfig(method))
            case commands.Pause(paused):
                self._pause(paused)
            case commands.Advance():
                self._pause(True)
                self._feed.advance()
            case commands.Restart():
                self._restart()
            case commands.Record(recording):
                return self._record(recording)
        return None

    def _steady(self, config: StabilizerConfig) -> None:
        if self.newest is None:
            raise CommandError("not-possible", "no frame has come yet: ask again when one has")
        self._targets.steady(config, self.newest.frame)
        self._stabilizer = Stabilizer(StabilizerConfig("paper"))

    def _pause(self, paused: bool) -> None:
        self._paused = paused
        self._feed.pause(paused)

    def _restart(self) -> None:
        if not self._feed.seekable:
            raise CommandError("not-possible", f"{self._feed.name} cannot be started again")
        self._feed.restart()
        self._begins = True
        self._past.forget()

    def _record(self, recording: bool) -> str:
        if recording and self.newest is None:
            raise CommandError("not-possible", "no frame has come yet: ask again when one has")
        rate = self._feed.fps or self._rate()
        return (
            self._recordings.begin(rate, self._feed.pixel_aspect)
            if recording
            else self._recordings.end()
        )

    def _is_afresh(self, frame: Frame) -> bool:
        """Whether frames of a new kind begin: the first one, a restart, another size."""
        size_wh = frame.image.shape[1], frame.image.shape[0]
        before, self._size_wh = self._size_wh, size_wh
        if before is not None and before != size_wh and len(self._targets):
            self._targets.remove(None)
            text = f"frames are {size_wh[0]}x{size_wh[1]} pixels now: draw the targets anew"
            self._note(Note("warning", text))
        return self._begins or before != size_wh

    def _track(self, frame: Frame) -> Transform:
        """Find the targets; the steadied view for people to look at."""
        if self._is_afresh(frame):
            self._past.forget()
            self._stabilizer = Stabilizer(StabilizerConfig("paper"))
            self._begins = True  # also of the next frame, should this one fail
            self._targets.begin(frame)
            self._begins = False
        else:
            self._targets.update(frame)
        motion = self._targets.motion
        return IDENTITY if motion is None else self._stabilizer.update(motion)

    def _kept(self, step: Step) -> Step:
        self.newest = step
        self._past.keep(step)
        return step

    def _rate(self) -> float:
        """Steps a second, of late."""
        first, last = self._done[0], self._done[-1]
        return (len(self._done) - 1) / (last - first) if last > first else 0.0
