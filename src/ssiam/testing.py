"""Checks of the contract of a tracker, for any class.

On the command line: ``ssiam check-tracker package.module:Class``. In a test of pytest::

    @pytest.mark.parametrize("check", ssiam.testing.CHECKS, ids=str)
    def test_contract(check):
        check(MyTracker)

Each check makes trackers by calling its argument, and runs them on views of a generated clip. It
raises `ContractError`, or returns whether it applies: `seek` is only checked if there is one, and
`respond` for a `CompleteTracker` with `has_responses`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, TypeAlias

import cv2
import numpy as np

from ssiam.errors import ArgumentError, ContractError, SsiamError, one_line
from ssiam.geometry import IDENTITY, XYWH, Image, frame_center, map_box, rigid
from ssiam.stabilize import METHODS, FrameView, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker, ViewTracker
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.foreign import ForeignTracker

__all__ = ["CHECKS", "Check", "Outcome", "run_checks"]

Make: TypeAlias = Callable[[], ViewTracker]

_SIZE: Final = (320, 240)
_FRAMES: Final = 10
_TARGET: Final = (120.0, 90.0, 44.0, 40.0)  # in the first frame
_OTHER: Final = (220.0, 150.0, 36.0, 44.0)
_STEP: Final = (3.0, 2.0)  # px per frame
_NEAR: Final = 0.5  # target sizes: a box is on the target if its center is nearer
_VIEWS: Final = (
    IDENTITY,
    rigid(25, -18, 0.0),
    rigid(-14.3, 7.9, 0.12, frame_center(_SIZE)),
)
_BORDER: Final = 20  # px
_AT_THE_BORDER: Final = (
    (-15.0, -12.0, 44.0, 40.0),
    (300.0, 100.0, 44.0, 40.0),
    (-43.0, 239.0, 44.0, 40.0),
    (-50.0, -40.0, 420.0, 320.0),
)
_TINY: Final = ((150.0, 110.0, 6.0, 5.0), (150.4, 110.2, 2.0, 2.0), (10.0, 10.0, 1.0, 1.0))
_TINY_FRAME: Final = (24, 16)


@dataclass(frozen=True)
class Check:
    """One check of the contract.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
        What a tracker that passes does.
    run : callable
        Raises `ContractError`; returns False if it does not apply.
    """

    name: str
    run: Callable[[Make], bool]

    def __call__(self, make: Make) -> bool:
        """Check the trackers that `make` makes.

        Parameters
        ----------
        make : callable
            Makes a tracker without a target: a class, or a function without arguments.

        Returns
        -------
        bool
            False if the check does not apply.

        Raises
        ------
        ContractError
            The tracker does not pass; the text says what was expected.
        """
        try:
            return self.run(make)
        except ContractError:
            raise
        except SsiamError as error:
            raise ContractError(str(error)) from error
        except Exception as error:
            raise ContractError(f"the tracker cannot be made: {one_line(error)}") from error

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Outcome:
    """The outcome of one check.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
    problem : str
        Empty if the tracker passes.
    applies : bool
    """

    name: str
    problem: str = ""
    applies: bool = True


def run_checks(make: Make) -> Iterator[Outcome]:
    """Run all checks; `make` is as for `Check`."""
    for check in CHECKS:
        try:
            applies = check(make)
        except ContractError as error:
            yield Outcome(check.name, str(error))
        else:
            yield Outcome(check.name, applies=applies)


class _UnreadableError(Exception):
    """What an unreadable view raises."""


class _UnreadableView(FrameView):
    """A view that raises whatever is asked of its pixels."""

    def __getattribute__(self, name: str) -> Any:
        if name in ("raw", "crop", "crop_square", "render", "size_wh"):
            raise _UnreadableError("this view cannot be read")
        return super().__getattribute__(name)


def _tracker(make: Make) -> ForeignTracker:
    """A tracker whose errors and results are checked, whatever its class."""
    tracker = make()
    return tracker if isinstance(tracker, ForeignTracker) else ForeignTracker(tracker, make)


def _started(make: Make, view: FrameView, xywh: XYWH) -> ForeignTracker | None:
    """A tracker with this target; None if it refuses the box with an `ArgumentError`."""
    tracker = _tracker(make)
    try:
        tracker.init(view, xywh)
    except ArgumentError:
        return None
    return tracker


@cache
def _texture(seed: int, size_wh: tuple[int, int], blocks: int) -> Image:
    """A random pattern with details of several sizes."""
    random = np.random.default_rng(seed)
    coarse = random.integers(0, 256, (blocks, blocks, 3)).astype(np.uint8)
    return cv2.resize(coarse, size_wh, interpolation=cv2.INTER_CUBIC).astype(np.uint8)


def _frame(
    *targets: tuple[int, XYWH], size_wh: tuple[int, int] = _SIZE, background: int = 1
) -> Image:
    """A frame with targets: the seed of each one's pattern, and its box."""
    frame = _texture(background, size_wh, 24).copy()
    frame //= 2
    for seed, (x, y, w, h) in targets:
        pattern = _texture(seed, (max(round(w), 1), max(round(h), 1)), 6)
        shift = np.array([[1.0, 0, x], [0, 1, y]])
        mask = np.full(pattern.shape[:2], 255, np.uint8)
        where = cv2.warpAffine(mask, shift, size_wh) > 127
        frame[where] = cv2.warpAffine(pattern, shift, size_wh)[where]
    return frame


def _clip() -> tuple[list[Image], list[XYWH]]:
    """Frames with a moving target, and its boxes."""
    x, y, w, h = _TARGET
    boxes = [(x + t * _STEP[0], y + t * _STEP[1], w, h) for t in range(_FRAMES)]
    return [_frame((7, box)) for box in boxes], boxes


def _distance(box: XYWH, truth: XYWH) -> float:
    """Distance of the centers, in target sizes."""
    (x, y, w, h), (u, v, p, q) = box, truth
    return float(np.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2) / np.sqrt(p * q))


def _check_near(track: Track, truth: XYWH, where: str) -> None:
    distance = _distance(track.box, truth)
    if distance > _NEAR:
        box, there = (tuple(round(number) for number in each) for each in (track.box, truth))
        raise ContractError(f"{where} the box is {box}, the target {there}")


def _tracks(tracker: ForeignTracker, frames: list[Image]) -> list[Track]:
    return [tracker.update(FrameView(frame)) for frame in frames]


def _numbers(tracks: list[Track]) -> list[tuple[float, ...]]:
    return [(*track.box, track.score) for track in tracks]


def _gives_tracks(make: Make) -> bool:
    frames, boxes = _clip()
    tracker = _tracker(make)
    tracker.init(FrameView(frames[0]), boxes[0])
    for track in _tracks(tracker, frames[1:]):
        _ = track.mask, track.corners  # computed and checked when they are read
    return True


def _follows(make: Make) -> bool:
    frames, boxes = _clip()
    tracker = _tracker(make)
    tracker.init(FrameView(frames[0]), boxes[0])
    for index, track in enumerate(_tracks(tracker, frames[1:]), start=1):
        _check_near(track, boxes[index], f"in frame {index}")
    return True


def _leaves_frames(make: Make) -> bool:
    frames, boxes = _clip()
    tracker = _tracker(make)
    for index, frame in enumerate(frames[:4]):
        before = frame.copy()
        for view in (FrameView(frame), FrameView(frame, _VIEWS[1], _BORDER)):
            if index == 0:
                tracker.init(view, map_box(view.stab_from_raw, boxes[0]))
            else:
                tracker.update(view)
            if not np.array_equal(frame, before):
                step = "init" if index == 0 else "update"
                raise ContractError(f"{step} changed pixels of the frame: copy before writing")
    return True


def _repeats(make: Make) -> bool:
    frames, boxes = _clip()
    runs = []
    for _ in range(2):
        tracker = _tracker(make)
        tracker.init(FrameView(frames[0]), boxes[0])
        runs.append(_numbers(_tracks(tracker, frames[1:])))
    if runs[0] != runs[1]:
        index = next(i for i, pair in enumerate(zip(*runs, strict=True)) if pair[0] != pair[1])
        raise ContractError(f"two runs differ from frame {index + 1} on: seed what is random")
    return True


def _starts_anew(make: Make) -> bool:
    frames, boxes = _clip()
    used, new = _tracker(make), _tracker(make)
    used.init(FrameView(_frame((9, _OTHER))), _OTHER)
    used.update(FrameView(_frame((9, _OTHER))))
    runs = []
    for tracker in (used, new):
        tracker.init(FrameView(frames[0]), boxes[0])
        runs.append(_numbers(_tracks(tracker, frames[1:])))
    if runs[0] != runs[1]:
        raise ContractError("a second init does not drop everything of the earlier target")
    return True


def _works_on_stabilized_views(make: Make) -> bool:
    frames, boxes = _clip()
    for stab_from_raw in _VIEWS:
        tracker = _tracker(make)
        view = FrameView(frames[0], stab_from_raw, _BORDER)
        tracker.init(view, map_box(stab_from_raw, boxes[0]))
        for index, frame in enumerate(frames[1:], start=1):
            track = tracker.update(FrameView(frame, stab_from_raw, _BORDER))
            truth = map_box(stab_from_raw, boxes[index])
            _check_near(track, truth, f"in pixels of a stabilized view, frame {index},")
    return True


def _runs_stabilized(make: Make) -> bool:
    frames, boxes = _clip()
    for method in METHODS:
        tracker = StabilizedTracker(_tracker(make), StabilizerConfig(method))
        tracker.init(frames[0], boxes[0])
        for frame in frames[1:]:
            tracker.update(frame)
    return True


def _bears_borders(make: Make) -> bool:
    for box in _AT_THE_BORDER:
        tracker = _started(make, FrameView(_frame((7, box)), border=_BORDER), box)
        if tracker is None:
            continue
        for step in range(4):
            x, y, w, h = box
            frame = _frame((7, (x - 20 * step, y - 15 * step, w, h)))
            tracker.update(FrameView(frame, border=_BORDER))
            tracker.update(FrameView(frame, _VIEWS[2], _BORDER))
            tracker.update(FrameView(frame, rigid(400, 300, 0.3), _BORDER))
    return True


def _bears_tiny_targets(make: Make) -> bool:
    for box in _TINY:
        view = FrameView(_frame((7, box)))
        tracker = _started(make, view, box)
        if tracker is None:
            continue
        for _ in range(3):
            tracker.update(view)
            tracker.update(FrameView(view.raw, _VIEWS[2], _BORDER))
    return True


def _bears_tiny_frames(make: Make) -> bool:
    box = (8.0, 5.0, 8.0, 6.0)
    view = FrameView(_frame((7, box), size_wh=_TINY_FRAME))
    tracker = _started(make, view, box)
    if tracker is not None:
        for _ in range(3):
            tracker.update(view)
    return True


def _bears_flat_frames(make: Make) -> bool:
    frames, boxes = _clip()
    tracker = _tracker(make)
    tracker.init(FrameView(frames[0]), boxes[0])
    for level in (0, 128, 255):
        tracker.update(FrameView(np.full_like(frames[0], level)))
    return True


def _seeks(make: Make) -> bool:
    if not _tracker(make).can_seek:
        return False
    x, y, w, h = _OTHER
    far, near = _OTHER, (x + 0.25 * w, y - 0.2 * h, w, h)
    for stab_from_raw in _VIEWS:
        tracker = _tracker(make)
        tracker.init(FrameView(_frame((7, (40.0, 40.0, w, h))), border=_BORDER), (40.0, 40.0, w, h))
        view = FrameView(_frame((7, far)), stab_from_raw, _BORDER)
        truth = map_box(stab_from_raw, far)
        found = tracker.seek(view, map_box(stab_from_raw, near))
        _check_near(found, truth, "after seek near the target")
        _check_near(tracker.update(view), truth, "in the update after seek")
    return True


def _lists_candidates(make: Make) -> bool:
    tracker, plain = make(), make()
    if not isinstance(tracker, CompleteTracker) or not tracker.has_responses:
        return False
    frames, boxes = _clip()
    for each in (tracker, plain):
        each.init(FrameView(frames[0]), boxes[0])
    for index, frame in enumerate(frames[1:], start=1):
        view = FrameView(frame)
        tracker.respond(view)
        response = tracker.respond(view)
        track = tracker.accept(view, response, response.best)
        if _numbers([track]) != _numbers([plain.update(view)]):
            raise ContractError(
                f"in frame {index} the best candidate is not the result of update, or respond "
                "changes the tracker"
            )
        _check_near(
            Track(response.xywh(response.best)), track.box, f"of a candidate, frame {index},"
        )
    x, y, w, h = boxes[-1]
    tracker.move_to((x + 0.2 * w, y - 0.2 * h, w, h))
    response = tracker.respond(FrameView(frames[-1]))
    _check_near(Track(response.xywh(response.best)), boxes[-1], "after move_to near the target")
    return True


def _are_independent(make: Make) -> bool:
    frames, boxes = _clip()
    first = _tracker(make)
    first.init(FrameView(frames[0]), boxes[0])
    alone = _numbers(_tracks(first, frames[1:]))
    first.init(FrameView(frames[0]), boxes[0])
    second: Any = first.clone()
    other = FrameView(_frame((9, _OTHER)))
    second.init(other, _OTHER)
    beside = []
    for frame in frames[1:]:
        beside.append(first.update(FrameView(frame)))
        second.update(other)
    if _numbers(beside) != alone:
        raise ContractError("a second tracker changes the results of the first: they share state")
    return True


def _lets_exceptions_through(make: Make) -> bool:
    frames, boxes = _clip()
    tracker = _tracker(make)
    tracker.init(FrameView(frames[0]), boxes[0])
    try:
        tracker.update(_UnreadableView(frames[1]))
    except SsiamError:
        return True
    raise ContractError(
        "update returned a track of a view that cannot be read: do not catch exceptions of the view"
    )


CHECKS: Final = (
    Check("init and update give a valid Track", _gives_tracks),
    Check("the target is followed", _follows),
    Check("boxes are in pixels of the stabilized view", _works_on_stabilized_views),
    Check("every stabilization runs", _runs_stabilized),
    Check("frames are not written to", _leaves_frames),
    Check("results repeat", _repeats),
    Check("init drops the earlier target", _starts_anew),
    Check("targets at the border and beyond", _bears_borders),
    Check("tiny targets", _bears_tiny_targets),
    Check("tiny frames", _bears_tiny_frames),
    Check("frames of one color", _bears_flat_frames),
    Check("seek finds the target near a given box", _seeks),
    Check("the best candidate is the result of update", _lists_candidates),
    Check("several trackers are independent", _are_independent),
    Check("exceptions are not swallowed", _lets_exceptions_through),
)
"""All checks, in the order in which a new tracker should pass them."""
