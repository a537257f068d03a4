from __future__ import annotations

import numpy as np
import pytest

from ssiam.render.banded import BandedLeastSquares
from ssiam.render.limits import Limit, StepLimit, solve_within


def _differences(frames: int, channels: int, order: int) -> np.ndarray:
    matrix = np.diff(np.eye(frames), order, axis=0) if order else np.eye(frames)
    return np.kron(matrix, np.eye(channels))


@pytest.mark.parametrize(("frames", "channels"), [(3, 2), (7, 1), (40, 2), (100, 1)])
def test_solution_is_that_of_dense_least_squares(frames: int, channels: int) -> None:
    rng = np.random.default_rng(0)
    weight, target = rng.random((2, frames, channels)) + 0.1
    rows, row_weight = rng.normal(size=(frames, channels)), rng.random(frames)
    row_target = rng.normal(size=frames)
    problem = BandedLeastSquares(frames, channels)
    problem.add_difference(0, weight, target)
    problem.add_difference(1, 2.0, 0.3)
    problem.add_difference(3, 5.0)
    problem.add_terms(rows, row_weight, row_target)

    by_frame = np.zeros((frames, frames * channels))
    for frame in range(frames):
        by_frame[frame, frame * channels : (frame + 1) * channels] = rows[frame]
    first, third = (_differences(frames, channels, order) for order in (1, 3))
    matrix = np.vstack(
        [
            np.sqrt(weight).ravel()[:, None] * np.eye(frames * channels),
            np.sqrt(2.0) * first,
            np.sqrt(5.0) * third,
            np.sqrt(row_weight)[:, None] * by_frame,
        ]
    )
    values = np.concatenate(
        [
            (np.sqrt(weight) * target).ravel(),
            np.sqrt(2.0) * np.full(len(first), 0.3),
            np.zeros(len(third)),
            np.sqrt(row_weight) * row_target,
        ]
    )
    dense = np.linalg.lstsq(matrix, values, rcond=None)[0]
    np.testing.assert_allclose(problem.solve().ravel(), dense, atol=1e-8)

    change = rng.normal(size=(frames, channels))
    before, after = (
        np.sum((matrix @ unknowns - values) ** 2) for unknowns in (dense, dense + change.ravel())
    )
    assert problem.increase(change) == pytest.approx(after - before)


def test_copy_is_independent() -> None:
    problem = BandedLeastSquares(5, 1)
    problem.add_difference(0, 1.0, 2.0)
    problem.copy().add_difference(0, 1.0, 100.0)
    np.testing.assert_allclose(problem.solve(), 2.0)


def test_limits_hold_and_change_nothing_elsewhere() -> None:
    wanted = np.stack([np.linspace(0, 99, 100), np.zeros(100)], axis=1)
    problem = BandedLeastSquares(100, 2)
    problem.add_difference(0, 1.0, wanted)
    along_x = np.tile([1.0, 0.0], (100, 1))
    limit = Limit(along_x, np.full(100, 10.0), np.full(100, 50.0), np.full(100, 1e9))
    solution = solve_within(problem, [limit])
    np.testing.assert_allclose(solution[:, 0], np.clip(wanted[:, 0], 10, 50), atol=1e-6)
    np.testing.assert_allclose(solution[:, 1], 0, atol=1e-9)


def test_step_limits_hold() -> None:
    jump = np.where(np.arange(60) < 30, 0.0, 100.0)[:, None]
    problem = BandedLeastSquares(60, 1)
    problem.add_difference(0, 1.0, jump)
    solution = solve_within(problem, [StepLimit(1, 10.0, 1e8), StepLimit(2, 2.0, 1e8)])
    assert np.abs(np.diff(solution, axis=0)).max() <= 10.01
    assert np.abs(np.diff(solution, 2, axis=0)).max() <= 2.01
    assert solution[-1] - solution[0] > 80
