"""`PickSession`: shows frames of a source, and collects the targets that a person chooses in them.

Threads: decoding, proposals and previews run on the session's thread, which alone changes the
targets. `submit` only queues. The results (`chosen`, `seen`) are events, so that the main
thread can wait for them and still receive Ctrl-C. `report` and `finish` are called on the main
thread and change the state under its lock; listeners are called on the thread that changes it.
"""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from ssiam.errors import SsiamError, one_line
from ssiam.exchange.annotations import Annotation
from ssiam.exchange.blending import Keyframe
from ssiam.geometry import IDENTITY, XYWH, check_box
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker
from ssiam.video import Frame, Source
from ssiam.web.events import Listeners
from ssiam.web.picking.commands import (
    AddBox,
    Adjust,
    Click,
    Correct,
    Discard,
    Finish,
    MarkAbsent,
    PickCommand,
    PickedTarget,
    PickState,
    Preview,
    Progress,
    Seek,
    TrackAll,
    Undo,
    WrittenFile,
)
from ssiam.web.picking.frames import FrameReader
from ssiam.web.targets import Targets, target_color
from ssiam.web.types import CommandError, SessionLimits, Step, Target

_log = logging.getLogger(__name__)

_PREVIEW_SECONDS: Final = 1.0  # of the clip
_PREVIEW_RATES: Final = (5.0, 60.0)  # frames per second, lowest and highest at which it is shown
_PASSING_INTERVAL: Final = 0.2  # seconds between two frames shown on the way to a far one
_MAX_UNDO: Final = 200  # changes that can be taken back
_MAX_WAITING: Final = 256  # commands of all clients that wait; more are refused
_CLOSE_TIMEOUT: Final = 5.0  # seconds for the current frame or proposal

Propose = Callable[[Any, tuple[float, float]], XYWH]
"""From an image and a point to a box; `BoxProposer.propose`."""


class PickSession:
    """One source, one frame that is shown, and the targets chosen so far; for all clients alike.

    Parameters
    ----------
    open_frames : callable
        Opens the source at its first frame, any number of times.
    tracker : StabilizedTracker
        Prototype of the trackers of a preview.
    name : str
        Name of the tracker.
    propose : callable
        Called on the session's thread.
    is_selectable : callable
        Whether a frame is in the part that is tracked: targets have boxes only in such frames, and
        the first of them is shown at the start.
    no_keyframes : str, optional
        Why a target can have a box in one frame only: how a second one is refused.
    no_second_run : str, optional
        Why the targets cannot be corrected after all was written.
    limits : SessionLimits, optional

    Attributes
    ----------
    first_index : int
        The first frame of the part that is tracked, once a frame is shown.

    Raises
    ------
    SsiamError
        The source cannot be opened.
    """

    def __init__(
        self,
        open_frames: Callable[[], Source],
        tracker: StabilizedTracker,
        name: str,
        propose: Propose,
        is_selectable: Callable[[Frame], bool] = lambda frame: True,
        no_keyframes: str | None = None,
        no_second_run: str | None = None,
        limits: SessionLimits | None = None,
    ) -> None:
        self.limits = limits or SessionLimits()
        self.tracker_name = name
        self.chosen, self.seen = threading.Event(), threading.Event()
        # Of the last run, by frame and target's id
        self._tracked: dict[tuple[int, int], Track] = {}
        self._tracker, self._propose = tracker, propose
        self._is_selectable, self._no_keyframes = is_selectable, no_keyframes
        self._no_second_run = no_second_run
        self.first_index = 0
        self._reader = FrameReader(open_frames)
        self.source, self.size_wh = self._reader.name, self._reader.size_wh
        self.fps = self._reader.fps
        self._steps, self._states = Listeners[Step](), Listeners[PickState]()
        self.newest: Step | None = None
        self._lock = threading.RLock()  # of the state and its notification
        self._state = PickState(length=self._reader.length)
        self._undo: deque[tuple[PickedTarget, ...]] = deque(maxlen=_MAX_UNDO)
        self._last_id = 0
        self._passed_at = 0.0
        self._waiting: deque[tuple[PickCommand, Future[Any]]] = deque()
        self._arrived = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="ssiam-picking", daemon=True)

    @property
    def state(self) -> PickState:
        """The current state."""
        return self._state

    def keyframes(self) -> list[tuple[Keyframe, ...]]:
        """Those of each target, in the order in which the targets are numbered."""
        return [each.keyframes for each in self._state.targets]

    def listen(
        self, on_step: Callable[[Step], object], on_state: Callable[[PickState], object]
    ) -> list[Callable[[], None]]:
        """Call `on_step` with each frame shown, `on_state` with each state; functions to end it."""
        return [self._steps.add(on_step), self._states.add(on_state)]

    def submit(self, command: PickCommand) -> Future[Any]:
        """Queue a command; its result, or the `SsiamError` that refuses it."""
        answer: Future[Any] = Future()
        with self._arrived:
            if self._closing or len(self._waiting) >= _MAX_WAITING:
                text = "the page has ended" if self._closing else "too many commands are waiting"
                answer.set_exception(CommandError("not-possible", text))
            else:
                self._waiting.append((command, answer))
                self._arrived.notify_all()
        return answer

    def start(self) -> None:
        """Show the first frame. May be called once."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and refuse what waits. May be called twice."""
        with self._arrived:
            self._closing = True
            waiting, self._waiting = list(self._waiting), deque()
            self._arrived.notify_all()
        for _, answer in waiting:
            _settle(answer, CommandError("not-possible", "the page has ended"))
        if self._thread.is_alive():
            self._thread.join(_CLOSE_TIMEOUT)

    def report(self, progress: Progress) -> None:
        """Show how far the run is."""
        self._change(progress=progress)

    def finish(
        self,
        files: tuple[WrittenFile, ...],
        notes: tuple[str, ...],
        rows: Iterable[Annotation] = (),
    ) -> None:
        """Show what was written; `rows` are the tracked boxes, a guide for corrections."""
        targets = self._state.targets
        self._tracked = {
            (row.frame, targets[row.target - 1].id): Track(row.xywh, row.score)
            for row in rows
            if row.visible and row.target <= len(targets)
        }
        self._change(phase="written", files=files, notes=notes)

    def _run(self) -> None:
        try:
            try:
                first = self._reader.read(sys.maxsize, lambda each: not self._is_selectable(each))
                self.first_index = first.index
                self._show(first)
            except Exception:
                # Nothing is shown, and no target can be chosen; a person sees why on the terminal.
                _log.exception("the first frame of %s", self.source)
            while True:
                with self._arrived:
                    self._arrived.wait_for(lambda: self._waiting or self._closing)
                    if self._closing:
                        return
                    command, answer = self._waiting.popleft()
                self._answer(command, answer)
        finally:
            self._reader.close()

    def _answer(self, command: PickCommand, answer: Future[Any]) -> None:
        if not answer.set_running_or_notify_cancel():
            return
        try:
            result = self._execute(command)
        except SsiamError as error:
            _settle(answer, error)
        except Exception as error:
            _log.exception("a command of the page")
            _settle(answer, CommandError("failed", one_line(error)))
        else:
            with suppress(InvalidStateError):
                answer.set_result(result)

    def _execute(self, command: PickCommand) -> int | None:
        if isinstance(command, Finish | Correct):
            self._check_phase("written", "nothing is written yet: choose the targets first")
            if isinstance(command, Correct):
                if self._no_second_run is not None:
                    raise CommandError("not-possible", self._no_second_run)
                self.chosen.clear()
                undo = bool(self._undo)
                self._change(phase="picking", progress=None, can_undo=undo)
                self._repeat()
            self.seen.set()
            return None
        self._check_phase("picking", "the clip is being tracked: the targets cannot be changed")
        match command:
            case Seek(index):
                frame = self._reader.read(index, self._is_wanted)
                self._show(frame)
                return frame.index
            case AddBox(frame_index, xywh, id):
                return self._add(self._frame(frame_index), xywh, id)
            case Click(frame_index, point_xy, id):
                return self._click(self._frame(frame_index), point_xy, id)
            case MarkAbsent(frame_index, id):
                self._mark_absent(self._frame(frame_index), id)
            case Adjust(id, xywh, at):
                self._adjust(id, xywh, at)
            case Discard(id, at):
                target = self._find(id)
                keyframe = None if at is None else self._keyframe(target, at)
                self._set_keyframes(target, target.others(keyframe.frame) if keyframe else [])
            case Undo():
                self._take_back()
            case Preview(id):
                self._preview(id)
            case TrackAll():
                if not self._state.targets:
                    raise CommandError("not-possible", "no target yet: click one in the frame")
                self._change(phase="tracking", can_undo=False)
                self.chosen.set()
        return None

    def _check_phase(self, phase: str, advice: str) -> None:
        if self._state.phase != phase:
            raise CommandError("not-possible", advice)

    def _frame(self, index: int) -> Frame:
        """The frame in which a person has drawn or clicked: the one that is shown."""
        shown = None if self.newest is None else self.newest.frame
        if shown is None or shown.index != index:
            raise CommandError("too-old", f"frame {index} is not shown any more: try again")
        if not self._is_selectable(shown):
            text = f"frame {index} is outside of the part that is tracked: choose another one"
            raise CommandError("not-possible", text)
        return shown

    def _click(self, frame: Frame, point_xy: tuple[float, float], id: int | None) -> int:
        width, height = self.size_wh
        if not (0 <= point_xy[0] <= width and 0 <= point_xy[1] <= height):
            x, y = point_xy
            raise CommandError("bad-box", f"point {x:g}, {y:g} is outside of the frame")
        return self._add(frame, self._propose(frame.image, point_xy), id)

    def _add(self, frame: Frame, xywh: XYWH, id: int | None) -> int:
        if id is not None:
            self._add_keyframe(self._find(id), Keyframe(frame.index, self._checked(xywh)))
            return id
        targets = self._state.targets
        if len(targets) >= self.limits.targets:
            text = f"{self.limits.targets} targets are chosen already: remove one first"
            raise CommandError("too-many-targets", text)
        keyframe = Keyframe(frame.index, self._checked(xywh))
        added = PickedTarget(self._last_id + 1, (keyframe,))
        self._last_id = added.id
        self._set_targets([*targets, added])
        return added.id

    def _mark_absent(self, frame: Frame, id: int) -> None:
        target = self._find(id)
        if all(each.xywh is None for each in target.others(frame.index)):
            text = f"frame {frame.index} has the only box of this target: give another one first"
            raise CommandError("not-possible", text)
        self._add_keyframe(target, Keyframe(frame.index, None))

    def _adjust(self, id: int, xywh: XYWH, at: int | None) -> None:
        target = self._find(id)
        frame = self._keyframe(target, target.frame if at is None else at).frame
        self._add_keyframe(target, Keyframe(frame, self._checked(xywh)))

    def _keyframe(self, target: PickedTarget, at: int) -> Keyframe:
        found = target.keyframe(at)
        if found is None:
            text = f"frame {at} has no keyframe of target {target.id}"
            raise CommandError("no-such-target", text)
        return found

    def _add_keyframe(self, target: PickedTarget, keyframe: Keyframe) -> None:
        """Add a keyframe, or replace that in its frame."""
        others = target.others(keyframe.frame)
        if others and self._no_keyframes is not None:
            raise CommandError("not-possible", self._no_keyframes)
        self._set_keyframes(target, [*others, keyframe])

    def _set_keyframes(self, target: PickedTarget, keyframes: list[Keyframe]) -> None:
        """Change the keyframes of a target; if none has a box, remove it."""
        ordered = tuple(sorted(keyframes, key=lambda each: each.frame))
        is_kept = any(each.xywh is not None for each in ordered)
        changed = [replace(target, keyframes=ordered)] if is_kept else []
        targets = self._state.targets
        number = targets.index(target)
        self._set_targets([*targets[:number], *changed, *targets[number + 1 :]])

    def _checked(self, xywh: XYWH) -> XYWH:
        try:
            return check_box(xywh, self.size_wh)
        except SsiamError as error:
            raise CommandError("bad-box", str(error)) from error

    def _find(self, id: int) -> PickedTarget:
        for each in self._state.targets:
            if each.id == id:
                return each
        raise CommandError("no-such-target", f"there is no target {id}")

    def _set_targets(self, targets: list[PickedTarget]) -> None:
        self._undo.append(self._state.targets)
        self._change(targets=tuple(targets), can_undo=True)
        self._repeat()

    def _take_back(self) -> None:
        if not self._undo:
            raise CommandError("not-possible", "nothing to take back")
        targets = self._undo.pop()
        self._change(targets=targets, can_undo=bool(self._undo))
        self._repeat()

    def _preview(self, id: int | None) -> None:
        targets = self._state.targets
        if not targets:
            raise CommandError("not-possible", "no target yet: click one in the frame")
        first = self._preview_start(targets, id)
        rate = min(max(self.fps, _PREVIEW_RATES[0]), _PREVIEW_RATES[1])
        count = max(2, round(_PREVIEW_SECONDS * self.fps))
        self._change(phase="preview")
        try:
            self._track(targets, first, count, rate)
        finally:
            self._change(phase="picking")

    def _preview_start(self, targets: tuple[PickedTarget, ...], id: int | None) -> int:
        if id is None:
            return min(each.frame for each in targets)
        target = self._find(id)
        shown = None if self.newest is None else target.keyframe(self.newest.frame.index)
        return target.frame if shown is None or shown.xywh is None else shown.frame

    def _track(self, picked: tuple[PickedTarget, ...], first: int, count: int, rate: float) -> None:
        """Track `count` frames from `first` on, and show them at `rate`, unless a command comes."""
        tracked = Targets(self._tracker, len(picked), lambda context, error: one_line(error))
        numbers: dict[int, int] = {}  # of the picked targets, by their ids in `tracked`
        due = time.monotonic()
        for index in range(first, first + count):
            frame = self._reader.read(index, lambda frame: not self._is_interrupted())
            if frame.index != index:
                return  # the end of the clip
            if index == first:
                tracked.begin(frame)
            else:
                tracked.update(frame)
            for number, each in enumerate(picked):
                keyframe = each.keyframe(index)
                if keyframe is None:
                    continue
                for id in [id for id, running in numbers.items() if running == number]:
                    tracked.remove(id)
                    del numbers[id]
                if keyframe.xywh is not None:
                    numbers[tracked.add([frame], keyframe.xywh, None)] = number
            shown = [
                replace(target, id=picked[n].id, name=target_name(n), color=target_color(n))
                for target in tracked.snapshot()
                for n in [numbers[target.id]]
            ]
            self._show(frame, tuple(sorted(shown, key=lambda target: target.id)))
            due += 1 / rate
            with self._arrived:
                wait = due - time.monotonic()
                if self._arrived.wait_for(self._is_interrupted, max(0.0, wait)):
                    return

    def _is_interrupted(self) -> bool:
        return bool(self._waiting) or self._closing

    def _is_wanted(self, passing: Frame) -> bool:
        """Show some of the frames that are decoded on the way to another one."""
        now = time.monotonic()
        if now - self._passed_at >= _PASSING_INTERVAL:
            self._passed_at = now
            self._show(passing)
        return not self._is_interrupted()

    def _repeat(self) -> None:
        """Show the same frame with the current targets."""
        if self.newest is not None:
            self._show(self.newest.frame)

    def _show(self, frame: Frame, tracked: tuple[Target, ...] | None = None) -> None:
        """Show a frame, by default with the targets that have a box in it, given or tracked."""
        if self._reader.length != self._state.length:
            self._change(length=self._reader.length)
        targets = tracked
        if targets is None:
            tracks = [self._known_track(each, frame.index) for each in self._state.targets]
            targets = tuple(
                Target(each.id, target_name(number), target_color(number), track)
                for number, (each, track) in enumerate(
                    zip(self._state.targets, tracks, strict=True)
                )
                if track is not None
            )
        now = time.monotonic()
        self._passed_at = now
        self.newest = Step(
            number=1 if self.newest is None else self.newest.number + 1,
            frame=frame,
            targets=targets,
            motion=None,
            stab_from_raw=IDENTITY,
            stabilize=self._tracker.config.stabilize,
            arrived=now,
            done=now,
            fps=self.fps,
            dropped=0,
            playback="paused" if tracked is None else "playing",
        )
        self._steps.notify(self.newest)

    def _known_track(self, target: PickedTarget, index: int) -> Track | None:
        """A target's keyframe in a frame, or else what the last run has found there."""
        keyframe = target.keyframe(index)
        if keyframe is None:
            return self._tracked.get((index, target.id))
        return None if keyframe.xywh is None else Track(keyframe.xywh)

    def _change(self, **fields: Any) -> None:
        with self._lock:
            self._state = replace(self._state, **fields)
            self._states.notify(self._state)


def target_name(number: int) -> str:
    """Name of a target by its number among the chosen ones, as the run numbers them."""
    return f"target {number + 1}"


def _settle(answer: Future[Any], error: SsiamError) -> None:
    with suppress(InvalidStateError):
        answer.set_exception(error)
