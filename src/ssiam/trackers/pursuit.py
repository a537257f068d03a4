"""`Pursuit`: a tracker on predicted views, which finds a lost target again."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from ssiam.geometry import XYWH, Image, map_box
from ssiam.motion import Motion
from ssiam.stabilize import FrameView, StabilizerConfig, TargetPredictor
from ssiam.track import Track
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.watch import Watch, Whereabouts

_SURE: Final = 0.5  # score from which the target is where the box is
_CERTAIN: Final = 0.75  # score with which a target is believed to be where it could not get to
_LIKELY: Final = 0.25  # score from which the box is remembered as the target's place
# Where a search looks in turn, in units of its reach.
_ROUND: Final = ((0, 0), (1, 0), (0, 0), (-1, 0), (0, 0), (0, 1), (0, 0), (0, -1))
_REACH: Final = (1.0, 4.0)  # target sizes: at first, and at most
_GROWTH: Final = 0.1  # target sizes per frame
_ELSEWHERE: Final = 0.7  # target sizes between two things that are not one
_PATIENCE: Final = 25  # frames for which a target that seems lost is only followed


class Pursuit:
    """Follows one target with a `ViewTracker` on predicted views.

    Parameters
    ----------
    tracker : ViewTracker
        Knows its target, and where it is.
    config : StabilizerConfig
    xywh : (x, y, w, h)
        There, raw-frame pixels.
    watch : Watch
        Whether it is lost.
    """

    def __init__(
        self, tracker: ViewTracker, config: StabilizerConfig, xywh: XYWH, watch: Watch
    ) -> None:
        self._tracker, self._config = tracker, config
        self._prediction = TargetPredictor(config.predict, xywh)
        self._watch = watch
        self._place = xywh  # where the target was last likely, carried along with the scene
        self._held = xywh  # the same, as it was when the scene was last cut
        self._whereabouts = Whereabouts(xywh)
        self._seen_again = False
        self._travelled: tuple[float, float] | None = None  # by the target in frames not seen, px
        self._astray = False  # whether the tracker was left elsewhere than its last box

    def expect(self, motion: Motion | None) -> XYWH:
        """Take the motion to the next frame; where the target will be in it, raw-frame pixels."""
        assert motion is not None
        self._motion = motion
        self._carry(motion)
        self._expected = self._prediction.update(motion)
        return self._expected

    def look(self, frame: Image) -> Track:
        """The target in that frame, raw-frame pixels."""
        stab_from_raw = self._prediction.stab_from_raw
        view = FrameView(frame, stab_from_raw, self._config.border)
        if self._searching and not self._seen_again:
            track, guess = self._sought(view)
        else:
            track = self._followed(view)
            if self._travelled is not None and self._tracker.doubt is not None:
                track = self._compared(view, track, self._travelled)
            guess = track.box
        self._judge(track, guess)
        if self._watch.lost:
            track = Track(guess, track.score, lost=True, evidence=track.evidence)
        return replace(track, motion=self._motion, stab_from_raw=stab_from_raw)

    @property
    def is_blind(self) -> bool:
        """Whether the camera's motion to that frame is not known."""
        return not self._motion.reliable

    @property
    def sought_xywh(self) -> XYWH:
        """The box in that frame around which the tracker looks, raw-frame pixels."""
        return self._expected

    def hold(self) -> Track:
        """The target in that frame, which shows nothing: the tracker is not asked.

        Nothing is learnt, and the next frame is looked at where the target was.
        """
        if self._config.predict.find:
            self._watch.wait()
        box = self._prediction.hold()
        self._travelled = self._prediction.traveled
        return Track(
            box,
            0.0,
            self._watch.lost,
            motion=self._motion,
            stab_from_raw=self._prediction.stab_from_raw,
        )

    @property
    def _searching(self) -> bool:
        return self._watch.frames >= _PATIENCE and self._tracker.doubt is not None

    def _carry(self, motion: Motion) -> None:
        """Take the places along with the scene; a cut may come back to where it was."""
        self._whereabouts.carry(motion)
        if motion.reliable:
            self._place = map_box(motion.cur_from_prev, self._place)
        elif not self._watch.lost:
            self._held = self._place

    def _followed(self, view: FrameView) -> Track:
        """What the tracker sees, with a second look if that is next to nothing."""
        if self._astray:
            first = self._seek(view, self._expected)
        else:
            first = self._tracker.track(view).mapped(view.raw_from_stab, view.size_wh)
        self._astray = False
        doubt = self._tracker.doubt
        if doubt is None or first.score > doubt or not self._config.predict.find:
            return first
        second = self._seek(view, self._expected)
        self._astray = second.score <= first.score
        return first if self._astray else second

    def _compared(self, view: FrameView, track: Track, traveled: tuple[float, float]) -> Track:
        """What the tracker sees after a gap, compared with where a moving target would be by now.

        If something like the target is in both places nobody knows which is it: the score is 0.
        """
        (x, y, w, h), size = self._expected, math.sqrt(track.box[2] * track.box[3])
        if not self._watch.lost or math.hypot(*traveled) < _ELSEWHERE * size:
            self._travelled = None
            return track
        other = self._seek(view, (x + traveled[0], y + traveled[1], w, h))
        (u, v), (p, q) = track.box[:2], other.box[:2]
        if math.hypot(u - p, v - q) < _ELSEWHERE * size or min(track.score, other.score) < _LIKELY:
            self._astray = track.score >= other.score
            return track if self._astray else other
        self._astray = True
        return replace(track, score=0.0)

    def _sought(self, view: FrameView) -> tuple[Track, XYWH]:
        """What the tracker sees where it was going, or else where a lost target may be.

        And its box where it was going: the guess, should the other place not hold.
        """
        own = self._seek(view, self._expected)
        if own.score > _LIKELY and self._is_credible(own):
            return own, own.box
        other = self._seek(view, self._candidate(self._watch.frames))
        return (other if other.score > max(own.score, _CERTAIN) else own), own.box

    def _seek(self, view: FrameView, xywh: XYWH) -> Track:
        stab_xywh = map_box(view.stab_from_raw, xywh)
        return self._tracker.seek(view, stab_xywh).mapped(view.raw_from_stab, view.size_wh)

    def _judge(self, track: Track, guess: XYWH) -> None:
        credible = self._is_credible(track)
        if self._config.predict.find:
            self._watch.update(track.score if credible else 0.0)
        if track.score > _LIKELY and not self._watch.lost:
            self._whereabouts.see(track.box)
        sure = track.score > _SURE
        self._seen_again = sure and credible
        if self._searching:
            self._prediction.move_to(track.box if sure else guess)
            return
        if track.score > _LIKELY:
            self._place = track.box
        self._prediction.observe(track.box, track.score)

    def _is_credible(self, track: Track) -> bool:
        """Whether the target can be in a box, or the tracker is certain enough that it is."""
        return track.score > _CERTAIN or self._whereabouts.explains(track.box)

    def _candidate(self, step: int) -> XYWH:
        """Where to look in this step of a search."""
        x, y, w, h = self._held if step % 4 == 2 else self._place
        reach = min(_REACH[0] + _GROWTH * step, _REACH[1]) * math.sqrt(w * h)
        dx, dy = _ROUND[step % len(_ROUND)]
        return x + dx * reach, y + dy * reach, w, h
