"""`PredictiveFollower`: the target's box is predicted, and a lost target is searched for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, Image, iou, map_box
from ssiam.motion import Motion
from ssiam.stabilize import FrameView, StabilizerConfig, TargetPredictor
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.followers import Decision, FrameResponse, FrameStep
from ssiam.trackers.global_search import GlobalSearch
from ssiam.trackers.lost import LossDetector, ReachableBox
from ssiam.trackers.position_prior import near_prediction
from ssiam.trackers.recognition import Evidence, TargetRecognition
from ssiam.trackers.responses import Response
from ssiam.trackers.scenes import SceneMemory

_CONFIDENT: Final = 0.5  # score above which the target is assumed to be in the box
_CERTAIN: Final = 0.75  # score above which a box is accepted even if it is not reachable
_LIKELY: Final = 0.25  # score above which the box is stored as the target's last one
# Offsets of the successive search positions, in units of the search's reach.
_SEARCH_PATTERN: Final = ((0, 0), (1, 0), (0, 0), (-1, 0), (0, 0), (0, 1), (0, 0), (0, -1))
_SEARCH_REACH: Final = (1.0, 4.0)  # target sizes: minimum and maximum
_SEARCH_GROWTH: Final = 0.5  # target sizes per search
_DISTINCT: Final = 0.7  # target sizes, minimum distance of two different objects
# The search of a lost target: which of `_TURNS` successive frames search what.
_TURNS: Final = 8
_PREDICTED_TURNS: Final = (0, 2, 4, 6)  # at the prediction
_LAST_TURNS: Final = (1, 5)  # where it was in this scene, or around the last positions
_GLOBAL_TURNS: Final = (3, 4, 7)  # in the whole frame
_UNSEEN: Final = 4  # frames without a likely box after which a box may be on another object
_TAKEN: Final = 0.4  # IoU with another target from which an object is that target
_SEARCH_DELAY: Final = 25  # frames from the loss of the target to the start of the search
# Likeness that is neutral evidence for the target, from docs/decisions/0014.
_NEAR_LIKENESS: Final = 0.12  # where the target can be
_LATER_LIKENESS: Final = 0.21  # the same after a cut, or while it is searched for
_FAR_LIKENESS: Final = 0.27  # elsewhere
_PER_OCTAVE: Final = 0.1  # added for each factor of 2 of the size, beyond a factor of 1.4
_GIVEN_UP: Final = -0.5  # evidence below which a candidate is dropped


class PredictiveFollower:
    """A tracker on predicted views, with search and re-detection of a lost target.

    Parameters
    ----------
    tracker : CompleteTracker
        A tracker that has a target.
    config : StabilizerConfig
    xywh : (x, y, w, h)
        The target, raw-frame pixels.
    loss : LossDetector
    """

    def __init__(
        self, tracker: CompleteTracker, config: StabilizerConfig, xywh: XYWH, loss: LossDetector
    ) -> None:
        self._tracker, self._config = tracker, config
        self._prediction = TargetPredictor(config.predict, xywh)
        self._loss = loss
        self._last_xywh = xywh  # the last likely box, moved along with the scene
        self._before_cut_xywh = xywh  # the same before the last cut
        self._reachable = ReachableBox(xywh)
        self._is_redetected = False  # the last frame had a confident and plausible track
        # Expected displacement over the preceding blank frames of a target of known speed.
        self._gap_shift_xy: tuple[float, float] | None = None
        self._tracker_is_elsewhere = False  # the tracker's last box is not the reported one
        self._scenes = SceneMemory()
        self._recognition = TargetRecognition()
        self._global_search = GlobalSearch()
        self._must_be_recognized = False  # the box may be on another object
        self._is_cut = False  # a motion was not reliable since the target was tracked
        self._evidence = Evidence()  # that it is on the target
        self._candidate_xywh: XYWH | None = None  # found by the search, to be compared again
        self._recognized_xywh: XYWH | None = None  # the target's box in this frame, if compared
        self._looks = 0  # number of searches around the last positions
        self._is_promising = False  # the last search found something at the prediction

    def advance(self, motion: Motion | None) -> FrameStep:
        """Move on to the next frame, and predict the target's box in it.

        Raises
        ------
        ArgumentError
            `motion` is None.
        """
        if motion is None:
            raise ArgumentError('no motion given: stabilize="predict" needs that of each frame')
        self._reachable.advance(motion)
        self._recognized_xywh = None
        self._evidence.advance(motion)
        is_unsure = self._loss.lost or self._must_be_recognized
        self._is_cut = (self._is_cut and is_unsure) or not motion.reliable
        if not motion.reliable or self._reachable.frames_unseen >= _UNSEEN:
            self._must_be_recognized = True
        if motion.reliable:
            self._last_xywh = motion.map_box(self._last_xywh)
            if self._candidate_xywh is not None:
                self._candidate_xywh = motion.map_box(self._candidate_xywh)
        elif not self._loss.lost:  # a cut: the video may return to this scene later
            self._before_cut_xywh = self._last_xywh
        predicted = self._prediction.update(motion)
        return FrameStep(motion, self._prediction.stab_from_raw, predicted, predicted)

    def locate(self, frame: Image, step: FrameStep, taken: Sequence[XYWH] = ()) -> Track:
        """The target in `frame`, raw-frame pixels."""
        view = FrameView(frame, step.stab_from_raw, self._config.border)
        if self._is_searching and not self._is_redetected:
            track, fallback_xywh = self._search(view, step.search_xywh, taken)
        else:
            if not self._loss.lost:
                self._looks = 0
                self._global_search.restart()
                if not self._must_be_recognized:
                    self._evidence.restart()
            track = self._track(view, step.search_xywh)
            if self._gap_shift_xy is not None and self._tracker.can_seek:
                track = self._after_gap(view, track, step.search_xywh, self._gap_shift_xy)
            fallback_xywh = track.box
        self._update(view, track, fallback_xywh)
        self._observe(view, track)
        if self._loss.lost:
            track = Track(fallback_xywh, track.score, lost=True, evidence=track.evidence)
        return track.with_changes(motion=step.motion, stab_from_raw=step.stab_from_raw)

    def respond(self, frame: Image, step: FrameStep) -> FrameResponse | None:
        """The candidates in `frame`; None while a lost target is searched for, and after gaps."""
        is_simple = not (
            self._is_searching or self._tracker_is_elsewhere or self._gap_shift_xy is not None
        )
        if not (is_simple and self._tracker.has_responses and self._config.predict.find):
            return None
        view = FrameView(frame, step.stab_from_raw, self._config.border)
        return FrameResponse(view, self._response(view, step.search_xywh))

    def decide(self, step: FrameStep, decision: Decision) -> Track:
        """The target by a decision among the candidates; raw-frame pixels."""
        view = decision.found.view
        if decision.index < 0:
            track = self._hidden(view, decision.assumed_xywh)
        else:
            track = self._tracker.accept(view, decision.found.response, decision.index)
            track = track.mapped(view.raw_from_stab, view.size_wh)
            if not decision.is_clear:
                track = Track(decision.assumed_xywh, track.score, evidence=track.evidence)
                self._tracker.move_to(map_box(view.stab_from_raw, decision.assumed_xywh))
            self._update(view, track, track.box)
            if decision.is_clear:
                self._observe(view, track)
            if self._loss.lost:
                track = Track(track.box, track.score, lost=True, evidence=track.evidence)
        return track.with_changes(motion=step.motion, stab_from_raw=step.stab_from_raw)

    def _hidden(self, view: FrameView, xywh: XYWH) -> Track:
        """A target that is hidden by another one, and assumed to be in `xywh`."""
        self._tracker.move_to(map_box(view.stab_from_raw, xywh))
        self._loss.update(0.0)
        self._reachable.move_to(xywh)
        self._prediction.coast(xywh)
        self._last_xywh, self._is_redetected = xywh, False
        return Track(xywh, 0.0, lost=self._loss.lost)

    def hold(self, step: FrameStep) -> Track:
        """The target in a blank frame, at its position in the scene.

        The next frame is searched around that position.
        """
        if self._config.predict.find:
            self._loss.skip_blank()
        xywh = self._prediction.hold()
        self._gap_shift_xy = self._prediction.traveled
        return Track(
            xywh,
            0.0,
            self._loss.lost,
            motion=step.motion,
            stab_from_raw=self._prediction.stab_from_raw,
        )

    @property
    def _is_searching(self) -> bool:
        return self._loss.frames_lost >= _SEARCH_DELAY and self._tracker.can_seek

    def _track(self, view: FrameView, search_xywh: XYWH) -> Track:
        """The tracker's result, or a second search's if that has the higher score.

        The second search is only made if the first score is very low.
        """
        if self._tracker_is_elsewhere:
            first = self._seek(view, search_xywh)
        else:
            first = self._updated(view, search_xywh).mapped(view.raw_from_stab, view.size_wh)
        self._tracker_is_elsewhere = False
        tracker = self._tracker
        if (
            not tracker.can_seek
            or first.score > tracker.reseek_below
            or not self._config.predict.find
        ):
            return first
        second = self._seek(view, search_xywh)
        self._tracker_is_elsewhere = second.score <= first.score
        return first if self._tracker_is_elsewhere else second

    def _updated(self, view: FrameView, search_xywh: XYWH) -> Track:
        """The tracker's result in the view."""
        if not self._tracker.has_responses:
            return self._tracker.update(view)
        response = self._response(view, search_xywh)
        return self._tracker.accept(view, response, response.best)

    def _response(self, view: FrameView, search_xywh: XYWH) -> Response:
        """The tracker's candidates, ranked also by their distance from the prediction."""
        response = self._tracker.respond(view)
        if not (self._config.predict.prefer and self._tracker.prefers_prediction):
            return response
        stab_xywh = map_box(view.stab_from_raw, search_xywh)
        return near_prediction(response, stab_xywh, self._prediction.error)

    def _after_gap(
        self, view: FrameView, track: Track, search_xywh: XYWH, shift_xy: tuple[float, float]
    ) -> Track:
        """The better of `track` and a search at the position of a target that kept its speed.

        The gap is a sequence of blank frames. If there are similar objects at both positions, the
        result is ambiguous and the score is 0.
        """
        (x, y, w, h), size = search_xywh, math.sqrt(track.box[2] * track.box[3])
        if not self._loss.lost or math.hypot(*shift_xy) < _DISTINCT * size:
            self._gap_shift_xy = None
            return track
        moved = self._seek(view, (x + shift_xy[0], y + shift_xy[1], w, h))
        (u, v), (p, q) = track.box[:2], moved.box[:2]
        same_object = math.hypot(u - p, v - q) < _DISTINCT * size
        if same_object or min(track.score, moved.score) < _LIKELY:
            self._tracker_is_elsewhere = track.score >= moved.score
            return track if self._tracker_is_elsewhere else moved
        self._tracker_is_elsewhere = True
        return track.with_changes(score=0.0)

    def _search(
        self, view: FrameView, predicted_xywh: XYWH, taken: Sequence[XYWH]
    ) -> tuple[Track, XYWH]:
        """Search a lost target at the prediction, around its last positions, and everywhere.

        One place is searched in a frame, and in every eighth frame two. Returns the chosen track,
        and the box around the prediction, which is reported while the target is lost.
        """
        if self._candidate_xywh is not None:
            return self._compared_again(view, self._candidate_xywh, predicted_xywh, taken)
        turn = self._loss.frames_lost % _TURNS
        found, fallback_xywh = Track(predicted_xywh, 0.0), predicted_xywh
        if turn in _PREDICTED_TURNS or self._is_promising:
            predicted = self._seek(view, predicted_xywh)
            fallback_xywh = predicted.box
            self._is_promising = predicted.score > _LIKELY and self._is_plausible(predicted)
            is_free = self._is_promising and not _is_taken(predicted, taken)
            if is_free and self._is_target(view, predicted):
                return predicted, fallback_xywh
            found = Track(fallback_xywh, 0.0) if self._is_promising else predicted
        if turn in _LAST_TURNS:
            self._looks += 1
            window = self._scenes.find(view.raw) or self._search_box(self._looks)
        elif turn in _GLOBAL_TURNS:
            window = self._global_search.window(view.raw, self._last_xywh[2:])
        else:
            return found, fallback_xywh
        other = self._seek(view, window)
        if other.score > _CERTAIN and not _is_taken(other, taken):
            if self._is_target(view, other):
                self._loss.doubt()
                return other, fallback_xywh
            if self._evidence.value > 0:
                self._candidate_xywh = other.box
        return found, fallback_xywh

    def _compared_again(
        self, view: FrameView, xywh: XYWH, predicted_xywh: XYWH, taken: Sequence[XYWH]
    ) -> tuple[Track, XYWH]:
        """Follow a candidate of the search until it is recognized, or given up."""
        track = self._seek(view, xywh)
        is_free = track.score > _CERTAIN and not _is_taken(track, taken)
        is_target = is_free and self._is_target(view, track)
        is_open = is_free and self._evidence.value > _GIVEN_UP
        self._candidate_xywh = None if is_target or not is_open else track.box
        if is_target:
            self._loss.doubt()
            return track, predicted_xywh
        return Track(predicted_xywh, 0.0), predicted_xywh

    def _is_target(self, view: FrameView, track: Track) -> bool:
        """Whether what was found is recognized as the target."""
        if not self._recognition.is_ready:
            self._must_be_recognized = False
            return True
        stab_xywh = map_box(view.stab_from_raw, track.box)
        likeness = self._recognition.likeness(self._tracker, view, stab_xywh)
        limit = self._neutral_likeness(track.box)
        limit += _PER_OCTAVE * max(self._octaves(track.box) - 0.5, 0.0)
        if not self._evidence.add(track.box, likeness, limit):
            return False
        self._must_be_recognized, self._recognized_xywh = False, track.box
        self._reachable.take(track.box)
        return True

    def _neutral_likeness(self, xywh: XYWH) -> float:
        """The likeness that is neutral evidence for an object at this place."""
        if not self._reachable.contains(xywh):
            return _FAR_LIKENESS
        if self._is_searching or self._is_cut:
            return _LATER_LIKENESS
        return _NEAR_LIKENESS

    def _octaves(self, xywh: XYWH) -> float:
        """By how many factors of 2 a box's size differs from the target's last one."""
        (_, _, w, h), (_, _, last_w, last_h) = xywh, self._last_xywh
        return abs(math.log2(w * h / (last_w * last_h))) / 2

    def _observe(self, view: FrameView, track: Track) -> None:
        """Remember the scene and the look of a target that is tracked."""
        if self._loss.lost or track.score < _LIKELY or not self._tracker.can_seek:
            return
        self._scenes.observe(view.raw, track.box)
        if track.score > _CONFIDENT:
            self._global_search.observe(view.raw, track.box)
        stab_xywh = map_box(view.stab_from_raw, track.box)
        self._recognition.observe(self._tracker, view, stab_xywh, track.score)

    def _seek(self, view: FrameView, xywh: XYWH) -> Track:
        stab_xywh = map_box(view.stab_from_raw, xywh)
        return self._tracker.seek(view, stab_xywh).mapped(view.raw_from_stab, view.size_wh)

    def _update(self, view: FrameView, track: Track, fallback_xywh: XYWH) -> None:
        plausible = self._is_plausible(track)
        if plausible and not self._reachable.contains(track.box):
            self._must_be_recognized = True
        is_doubtful = self._must_be_recognized or self._loss.lost
        if plausible and is_doubtful and track.score > _LIKELY:
            must_be_recognized = self._must_be_recognized
            recognized = track.box == self._recognized_xywh or self._is_target(view, track)
            plausible = recognized or not must_be_recognized
        if self._config.predict.find:
            self._loss.update(track.score if plausible else 0.0)
            is_recognized = track.box == self._recognized_xywh and track.score > _CONFIDENT
            if is_recognized and self._evidence.is_sure:
                self._loss.confirm()
        confident = track.score > _CONFIDENT
        if plausible and track.score > _LIKELY and not self._loss.lost:
            self._reachable.observe(track.box)
        self._is_redetected = confident and plausible
        if self._is_searching:
            self._prediction.move_to(track.box if confident else fallback_xywh)
            return
        if track.score > _LIKELY:
            self._last_xywh = track.box
        self._prediction.observe(track.box, track.score)

    def _is_plausible(self, track: Track) -> bool:
        """Whether the target can have this box, or the score is high enough to accept any box."""
        return track.score > _CERTAIN or self._reachable.contains(track.box)

    def _search_box(self, looks: int) -> XYWH:
        """The box of a search around the last positions, by the number of those before it."""
        x, y, w, h = self._before_cut_xywh if looks % 4 == 2 else self._last_xywh
        min_reach, max_reach = _SEARCH_REACH
        reach = min(min_reach + _SEARCH_GROWTH * looks, max_reach) * math.sqrt(w * h)
        dx, dy = _SEARCH_PATTERN[looks % len(_SEARCH_PATTERN)]
        return x + dx * reach, y + dy * reach, w, h


def _is_taken(track: Track, taken: Sequence[XYWH]) -> bool:
    """Whether what was found is another target, by the boxes of the others."""
    return any(float(iou(track.box, each)) > _TAKEN for each in taken)
