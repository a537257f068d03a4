"""`timeline`: frame numbers at a constant rate, from frame times."""

from __future__ import annotations

from fractions import Fraction

import pytest

from ssiam.exchange import Annotation, Annotations, timeline

BOX = (1.0, 2.0, 30.0, 40.0)
NTSC = Fraction(30000, 1001)


def _annotations(times, fps, *, frames=None, length=0):
    frames = range(len(times)) if frames is None else frames
    rows = tuple(Annotation(frame, time, 1, BOX) for frame, time in zip(frames, times, strict=True))
    return Annotations((160, 96), fps, ("boat",), rows, length)


CONSTANT = [
    ("exact", [i / 25 for i in range(50)], 25),
    ("milliseconds", [round(i / float(NTSC), 3) for i in range(500)], NTSC),
    ("no times", [None] * 9, 25),
    ("some times", [0.0, 0.1, None, 0.9], 25),
    ("backwards", [0.0, 0.1, 5.0, 0.2], 25),
]


@pytest.mark.parametrize(("times", "fps"), [c[1:] for c in CONSTANT], ids=[c[0] for c in CONSTANT])
def test_constant_rate_counts_frames(times, fps):
    line = timeline(_annotations(times, fps))
    assert (line.fps, line.count) == (fps, len(times))
    assert line.numbers == {frame: frame for frame in range(len(times))}


VARIABLE = [
    ("a phone in the dark", [0, 0.04, 0.08, 0.24, 0.4, 0.56, 0.6, 0.64], Fraction(1000, 91), 25),
    ("announced rate is wrong", [i / 5 for i in range(30)], 25, 25),
    ("slightly slower than announced", [i / 24.2 for i in range(90)], 25, 24.2),
    ("times of arrival", [0, 0.21, 0.39, 0.63, 0.8, 0.997, 1.23], 25, 25),
    ("very short gap", [0, 0.5, 0.5004, 1.0], 25, 1000),
]


@pytest.mark.parametrize(
    ("times", "fps", "expected"), [v[1:] for v in VARIABLE], ids=[v[0] for v in VARIABLE]
)
def test_variable_rate_numbers_frames_by_time(times, fps, expected):
    line = timeline(_annotations(times, fps))
    assert float(line.fps) == pytest.approx(expected, rel=1e-3)
    numbers = [line.numbers[frame] for frame in range(len(times))]
    assert len(set(numbers)) == len(numbers)
    shown = [float(number / line.fps) for number in numbers]
    for index, (time, at) in enumerate(zip(times, shown, strict=True)):
        nearest = min(range(len(times)), key=lambda i: abs(times[i] - at))
        assert nearest == index or abs(time - at) <= 0.001
    assert line.count > numbers[-1]


def test_frames_without_annotations_are_counted():
    line = timeline(_annotations([0.4, 0.8], 25, frames=(2, 4), length=10))
    assert line.numbers == {2: 10, 4: 20}
    assert line.count == round((0.8 + 6 / 25) * 25)


def test_no_annotations():
    assert timeline(Annotations((9, 9), 25, (), (), 4)).count == 4
