"""What the paper leaves open: the judge, the order of eq. 6, the meaning of THa."""

import numpy as np
import pytest

from helpers.synthetic import generator, poses
from ssiam import Motion, Stabilizer, StabilizerConfig
from ssiam.evaluation.paper.judged import needs_stabilization
from ssiam.geometry import frame_center, rigid_parameters
from ssiam.stabilize import PaperConfig

SIZE = (640, 360)
CENTER = frame_center(SIZE)
PAPER = StabilizerConfig("paper")


def motions(steps):
    """The exact motion to every frame, for camera poses (dx, dy, angle)."""
    frames = poses(steps, SIZE)
    previous = [frames[0], *frames[:-1]]
    return [
        Motion(cur @ np.linalg.inv(prev), 1.0, True, SIZE)
        for cur, prev in zip(frames, previous, strict=True)
    ]


def noise(deviation, count=90, seed=5):
    """A still camera whose motion is estimated with an error of `deviation` px."""
    return motions(generator(seed).normal(0, (deviation, deviation, 0), (count, 3)))


def corrections(found, **options):
    """(dx, dy, angle) of every stabilized frame."""
    stabilizer = Stabilizer(PAPER.with_options(**options))
    return np.array([rigid_parameters(stabilizer.update(each), CENTER) for each in found])


def jump(dx=0.0, angle=0.0):
    """A camera that is still for 60 frames, and then jumps."""
    steps = np.zeros((80, 3))
    steps[60:] = dx, 0.0, angle
    return motions(steps)


def test_the_judge_of_the_window_leaves_every_frame_of_a_still_camera():
    still = noise(0.15)
    assert not corrections(still, judge="window").any()
    assert corrections(still, judge="frame").any(axis=1).mean() > 0.5


def test_the_judge_of_the_window_stabilizes_a_shaking_camera():
    shaking = noise(4.0)
    np.testing.assert_array_equal(
        corrections(shaking, judge="window")[1:], corrections(shaking, judge="frame")[1:]
    )


def test_the_judge_of_the_window_remembers_a_shake_for_the_window():
    found = noise(0.1, 30) + noise(4.0, 30) + noise(0.1, 90)
    stabilized = corrections(found, judge="window").any(axis=1)
    assert not stabilized[:30].any()
    assert stabilized[33:60].all()
    assert not stabilized[-25:].any()


def test_the_threshold_is_a_root_mean_square():
    """The distances from the path's mean are .5, .75, .83... of a jump by one pixel."""
    steps = np.zeros((2, 3))
    steps[1, 0] = 4.0
    rms = np.sqrt((0 + 2.0**2) / 2)  # the mean of 0 and 4 is 2 px away
    assert corrections(motions(steps), judge="window", shake=rms - 0.01)[1].any()
    assert not corrections(motions(steps), judge="window", shake=rms + 0.01)[1].any()


@pytest.mark.parametrize(("deviation", "expected"), [(0.15, False), (4.0, True)])
def test_the_second_column_of_table_4(deviation, expected):
    assert needs_stabilization(noise(deviation)) is expected


def test_a_frame_judge_of_a_tenth_of_a_pixel_never_says_no():
    assert needs_stabilization(noise(0.15), PaperConfig())


def test_exclusive_cases_reach_the_limit_in_one_frame():
    found = jump(dx=-300.0)
    assert corrections(found, limits="exclusive")[60, 0] == pytest.approx(80)  # N + THx1
    assert corrections(found, limits="nested")[60, 0] == pytest.approx(20)  # THx2
    found = jump(dx=300.0)
    assert corrections(found, limits="exclusive")[60, 0] == pytest.approx(-80)


def test_below_the_limit_both_orders_are_the_same():
    found = jump(dx=70.0)
    np.testing.assert_array_equal(
        corrections(found, limits="exclusive"), corrections(found, limits="nested")
    )
    assert corrections(found)[60:64, 0] == pytest.approx([-20, -40, -60, -70 * 26 / 30])


def test_tha_may_limit_the_change():
    found = corrections(jump(angle=0.25), tha=0.1, tha_limits="change")
    np.testing.assert_allclose(found[59:63, 2], [0, -0.1, -0.2, -0.25 * 27 / 30], atol=1e-9)
    assert corrections(jump(angle=0.25), tha=0.1)[60:63, 2] == pytest.approx([-0.1] * 3)


@pytest.mark.parametrize("limits", ["angle", "change"])
def test_tha_may_be_in_degrees(limits):
    degrees = corrections(jump(angle=0.25), tha=2.0, tha_unit="deg", tha_limits=limits)
    radians = corrections(jump(angle=0.25), tha=np.deg2rad(2.0), tha_limits=limits)
    np.testing.assert_array_equal(degrees, radians)
    assert degrees[60, 2] == pytest.approx(-np.deg2rad(2.0))


@pytest.mark.parametrize("limits", ["angle", "change"])
def test_the_rows_of_table_3_differ_in_degrees(limits):
    """A hand-held roll of half a degree; in radians it is far below each row's limit."""
    rolling = motions(generator(3).normal(0, (2, 2, np.deg2rad(0.5)), (90, 3)))
    rows = {
        unit: [
            corrections(rolling, tha=tha, tha_limits=limits, tha_unit=unit)
            for tha in (0.1, 0.3, 0.5, 1.0)
        ]
        for unit in ("deg", "rad")
    }
    for previous, row in zip(rows["deg"], rows["deg"][1:], strict=False):
        assert np.abs(row - previous).max() > 1e-3
    for row in rows["rad"]:
        np.testing.assert_array_equal(row, rows["rad"][0])
