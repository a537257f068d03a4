"""`Engine`: turns the frames and commands of a live session into steps, on one thread."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from ssiam.geometry import IDENTITY, XYWH, Transform
from ssiam.motion import Motion
from ssiam.render import LockedCamera, StabilizedCamera
from ssiam.stabilize import StabilizerConfig
from ssiam.video import Frame
from ssiam.web.feeds.base import Arrival, Feed
from ssiam.web.history import StepHistory
from ssiam.web.monitoring import ErrorReporter
from ssiam.web.recording import Recordings
from ssiam.web.targets import Targets
from ssiam.web.types import (
    Add,
    Advance,
    CameraName,
    Command,
    CommandError,
    Hold,
    Note,
    Pause,
    Playback,
    Record,
    Remove,
    Rename,
    Restart,
    Stabilize,
    Step,
    SwitchCamera,
)

_RATE_STEPS: Final = 30  # steps over which the rate is averaged
_USUAL_FPS: Final = 30.0  # of a source that states no rate, for the virtual camera


class Engine:
    """Tracks the targets in the frames of a feed, and executes commands between frames.

    All methods must be called on the same thread. An error in a frame is reported and does not
    affect the next frame.

    Parameters
    ----------
    feed : Feed
    targets : Targets
    recordings : Recordings
    errors : ErrorReporter
    notify : callable
        Receives notes that are not errors.
    """

    def __init__(
        self,
        feed: Feed,
        targets: Targets,
        recordings: Recordings,
        errors: ErrorReporter,
        notify: Callable[[Note], None],
    ) -> None:
        self._feed, self._targets, self._recordings = feed, targets, recordings
        self._errors, self._notify = errors, notify
        self._camera_name: CameraName = "stabilized"
        self._camera: StabilizedCamera | LockedCamera | None = None
        self._history = StepHistory()
        self._done_times: deque[float] = deque(maxlen=_RATE_STEPS)
        self._is_paused = feed.paused
        self._size_wh: tuple[int, int] | None = None
        self._is_start = True  # whether the next frame is the first one of its source
        self._first_index = 0  # of the source, before which no target begins
        self.newest: Step | None = None

    @property
    def playback(self) -> Playback:
        """State of the source."""
        if self._feed.state == "playing" and self._is_paused:
            return "paused"
        return self._feed.state

    def process(self, arrival: Arrival) -> Step:
        """Track the targets in a frame."""
        frame = arrival.frame
        stab_from_raw, error = IDENTITY, ""
        try:
            stab_from_raw = self._track(frame)
        except Exception as failure:
            error = self._errors.report("tracking in this frame", failure)
        motion = None if error else self._targets.motion
        done = time.monotonic()
        self._done_times.append(done)
        step = Step(
            number=1 if self.newest is None else self.newest.number + 1,
            frame=frame,
            targets=self._targets.snapshot(),
            waiting=self._targets.waiting(),
            motion=motion,
            stab_from_raw=stab_from_raw,
            stabilize=self._targets.config.stabilize,
            arrived=arrival.arrived,
            done=done,
            fps=self._rate(),
            dropped=self._feed.dropped,
            playback=self.playback,
            recording=self._recordings.current,
            error=error,
            camera=self._camera_name,
        )
        self._recordings.write(step)
        return self._remember(step)

    def repeat(self) -> Step | None:
        """Repeat the newest step, if any, with the current targets and settings."""
        if self.newest is None:
            return None
        step = replace(
            self.newest,
            number=self.newest.number + 1,
            targets=self._targets.snapshot(),
            waiting=self._targets.waiting(),
            stabilize=self._targets.config.stabilize,
            playback=self.playback,
            recording=self._recordings.current,
            camera=self._camera_name,
        )
        return self._remember(step)

    def execute(self, command: Command) -> Any:
        """Execute a command; return its result.

        Raises
        ------
        SsiamError
            The command cannot be executed. Any other exception is a bug.
        """
        match command:
            case Add(xywh, number, name):
                frames = [step.frame for step in self._history.since(number)]
                return self._targets.add(frames, xywh, name)
            case Hold(number):
                self._history.hold(number)
            case Remove(id):
                self._targets.remove(id)
            case Rename(id, name):
                self._targets.rename(id, name)
            case Stabilize(method):
                self._stabilize(StabilizerConfig(method))
            case SwitchCamera(camera):
                self._camera_name = camera
                self._camera = None if self._size_wh is None else self._new_camera(self._size_wh)
            case Pause(paused):
                self._pause(paused)
            case Advance():
                self._pause(True)
                self._feed.advance()
            case Restart(index):
                self._restart(index)
            case Record(recording):
                return self._record(recording)
        return None

    def _stabilize(self, config: StabilizerConfig) -> None:
        self._targets.switch(config, self._newest_step().frame)

    def _pause(self, paused: bool) -> None:
        self._is_paused = paused
        self._feed.pause(paused)

    def _restart(self, index: int) -> None:
        if not self._feed.seekable:
            raise CommandError("not-possible", f"{self._feed.name} cannot be restarted")
        if index > 0 and self._feed.length is not None and index >= self._feed.length:
            text = f"frame {index} does not exist: {self._feed.name} has {self._feed.length}"
            raise CommandError("not-possible", text)
        self._feed.restart(index)
        self._is_start, self._first_index = True, index
        self._history.clear()

    def _record(self, recording: bool) -> str:
        if not recording:
            return self._recordings.end()
        self._newest_step()
        return self._recordings.begin(self._feed.fps or self._rate(), self._feed.pixel_aspect)

    def _newest_step(self) -> Step:
        if self.newest is None:
            raise CommandError("not-possible", "no frame has arrived yet: try again later")
        return self.newest

    def _track(self, frame: Frame) -> Transform:
        """Update the targets; return the transform to the view beside the raw frame."""
        size_wh = frame.image.shape[1], frame.image.shape[0]
        if size_wh != self._size_wh:
            self._change_size(size_wh)
        if self._is_start:
            self._history.clear()
            self._camera = self._new_camera(size_wh)
            # If this fails, the next frame starts the sequence.
            self._targets.begin(frame, self._first_index)
            self._is_start = False
        else:
            self._targets.update(frame)
        motion = self._targets.motion
        if motion is None or self._camera is None:
            return IDENTITY
        return self._view(self._camera, motion)

    def _new_camera(self, size_wh: tuple[int, int]) -> StabilizedCamera | LockedCamera:
        fps = self._feed.fps or _USUAL_FPS
        if self._camera_name == "locked":
            return LockedCamera(size_wh, rate=fps)
        return StabilizedCamera(size_wh, fps)

    def _view(self, camera: StabilizedCamera | LockedCamera, motion: Motion) -> Transform:
        if isinstance(camera, StabilizedCamera):
            return camera.update(motion).out_from_raw
        first = next(iter(self._targets.snapshot()), None)
        box: XYWH | None = None if first is None or first.track.lost else first.track.box
        return camera.update(motion, box)

    def _change_size(self, size_wh: tuple[int, int]) -> None:
        """Start a new sequence with frames of this size; targets of the old size are removed."""
        if self._size_wh is not None and len(self._targets):
            self._targets.remove(None)
            text = f"the frame size is now {size_wh[0]}x{size_wh[1]} pixels: draw the targets again"
            self._notify(Note("warning", text))
        self._size_wh = size_wh
        self._is_start = True

    def _remember(self, step: Step) -> Step:
        self.newest = step
        self._history.append(step)
        return step

    def _rate(self) -> float:
        """Recent steps per second."""
        first, last = self._done_times[0], self._done_times[-1]
        return (len(self._done_times) - 1) / (last - first) if last > first else 0.0
