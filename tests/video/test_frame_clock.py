"""Frame rates and times of written frames."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import pytest

from helpers.video_clips import NTSC
from ssiam.video.sinks import _exact_rate, _FrameClock

RATES = [
    ("fraction", NTSC, NTSC),
    ("float", 29.97002997002997, NTSC),
    ("whole", 30, Fraction(30)),
    ("decimal", 12.5, Fraction(25, 2)),
    ("odd fraction", Fraction(456000, 15217), Fraction(456000, 15217)),
]


@pytest.mark.parametrize(("given", "exact"), [r[1:] for r in RATES], ids=[r[0] for r in RATES])
def test_rates_are_exact(given, exact):
    assert _exact_rate(given) == exact
    clock = _FrameClock(_exact_rate(given))
    assert [clock.next_ticks() * clock.time_base for _ in range(4)] == [i / exact for i in range(4)]
    assert clock.time_base <= Fraction(1, 10_000)


CLOCKS = [
    # name of the case, times, expected seconds at 25 frames per second
    ("origin", [5.0, 5.04, 5.2], [0, 0.04, 0.2]),
    ("jump back continues", [5.0, 5.04, 1.0, 1.1], [0, 0.04, 0.08, 0.18]),
    ("jump ahead is a pause", [0, 0.04, 60.0], [0, 0.04, 60.0]),
    ("unknown time follows", [0, None, None, 0.5], [0, 0.04, 0.08, 0.5]),
]


@pytest.mark.parametrize(("times", "seconds"), [c[1:] for c in CLOCKS], ids=[c[0] for c in CLOCKS])
def test_clock_converts_times(times, seconds):
    clock = _FrameClock(Fraction(25))
    seconds_in_file = [float(clock.next_ticks(time) * clock.time_base) for time in times]
    assert seconds_in_file == pytest.approx(seconds, abs=1e-4)


def test_clock_is_strictly_increasing_and_does_not_drift():
    clock = _FrameClock(Fraction(25), whole_frames=True)
    jittered = [i / 25 + (0.019 if i % 3 else -0.019) for i in range(1, 500)]
    ticks = [clock.next_ticks(time) for time in jittered]
    assert all(later > earlier for earlier, later in pairwise(ticks))
    assert abs(ticks[-1] - 498) <= 1
