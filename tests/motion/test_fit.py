import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.synthetic import generator
from ssiam.geometry import map_points, rigid
from ssiam.motion.fit import _consensus, _pairs, fit_motion


def pairs(cur_from_prev, count=120, moving=0.0, noise=0.0, seed=1):
    """Point pairs of a camera motion; a share `moving` of them has another motion."""
    r = generator(seed)
    prev_xy = r.uniform((0, 0), (640, 360), (count, 2))
    cur_xy = map_points(cur_from_prev, prev_xy) + r.normal(0, noise or 1e-12, (count, 2))
    cur_xy[: int(moving * count)] += (25.0, -14.0)
    return prev_xy, cur_xy


def corner_error(a_from_b, c_from_d):
    corners = [[0, 0], [640, 0], [640, 360], [0, 360]]
    return np.abs(map_points(a_from_b, corners) - map_points(c_from_d, corners)).max()


@settings(max_examples=50, deadline=None)
@given(st.floats(-60, 60), st.floats(-60, 60), st.floats(-0.3, 0.3))
def test_both_fits_recover_an_exact_motion(dx, dy, angle):
    truth = rigid(dx, dy, angle, (320, 180))
    for method in ("robust", "least_squares"):
        found, inliers = fit_motion(*pairs(truth), method, tolerance=1.5)
        assert corner_error(found, truth) < 1e-6
        assert inliers == 1


@pytest.mark.parametrize("moving", [0.05, 0.3, 0.45])
def test_moving_points_bias_least_squares_only(moving):
    truth = rigid(12, -5, 0.02, (320, 180))
    points = pairs(truth, moving=moving, noise=0.2)
    robust, inliers = fit_motion(*points, "robust", tolerance=1.5)
    least_squares, _ = fit_motion(*points, "least_squares", tolerance=1.5)
    assert corner_error(robust, truth) < 0.3
    assert corner_error(least_squares, truth) > 1
    assert inliers == pytest.approx(1 - moving, abs=0.02)


def test_results_are_reproducible():
    points = pairs(rigid(3, 4, 0.01), moving=0.4, noise=1.0)
    first, second = (fit_motion(*points, "robust", tolerance=1.5)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("method", ["robust", "least_squares"])
def test_coincident_points_give_a_shift_without_rotation(method):
    prev_xy = np.full((3, 2), 7.0)
    found, _ = fit_motion(prev_xy, prev_xy + 2, method, tolerance=1.5)
    np.testing.assert_allclose(found, rigid(2, 2, 0), atol=1e-12)


def test_the_similarity_model_recovers_zoom():
    truth = rigid(5, -3, 0.02, (320, 180)) @ np.diag([1.03, 1.03, 1.0])
    points = pairs(truth, moving=0.3, noise=0.1)
    zoomed, inliers = fit_motion(*points, "robust", tolerance=1.5, model="similarity")
    rigid_fit, _ = fit_motion(*points, "robust", tolerance=1.5)
    assert corner_error(zoomed, truth) < 0.2
    assert corner_error(rigid_fit, truth) > 3
    assert inliers == pytest.approx(0.7, abs=0.02)


TRANSFORMS = {
    "affine": np.array([[1.02, 0.03, 4.0], [-0.01, 0.97, -6.0], [0, 0, 1]]),
    "homography": np.array([[1.01, 0.02, 4.0], [-0.02, 0.98, -6.0], [3e-5, -2e-5, 1]]),
}


@pytest.mark.parametrize("method", ["robust", "least_squares"])
@pytest.mark.parametrize("model", TRANSFORMS)
def test_larger_models_recover_their_transforms(model, method):
    truth = TRANSFORMS[model]
    moving = 0.3 if method == "robust" else 0.0
    found, _ = fit_motion(*pairs(truth, moving=moving), method, tolerance=1.5, model=model)
    assert corner_error(found, truth) < 0.05


# Where three corners of the frame are mapped to: the robust fit, and least squares.
RECORDED = {
    "rigid": (
        [15.5125667, -11.0045529, 655.392682, 1.38244527, 648.424996, 361.31501],
        [15.5402724, -10.7710073, 655.441229, 0.487997682, 649.108039, 360.432286],
    ),
    "similarity": (
        [15.3222447, -11.1079398, 655.575647, 1.32559496, 648.581784, 361.468134],
        [15.8905797, -10.5843953, 655.072744, 0.661962555, 648.746667, 360.20193],
    ),
    "affine": (
        [15.5395176, -11.7458662, 655.101568, 1.49890939, 648.412357, 362.092973],
        [14.4271725, -11.2421855, 653.916663, 1.44943595, 650.531838, 360.870729],
    ),
    "homography": (
        [15.652835, -11.6073652, 654.236117, 1.86805909, 648.957059, 361.891209],
        [15.1334597, -10.5277948, 656.706244, -0.295910716, 650.777781, 362.138226],
    ),
}


@pytest.mark.parametrize("model", RECORDED)
def test_fits_are_those_of_earlier_versions(model):
    """60 pairs with noise of .8 px, of which 18 do not follow the camera."""
    random = generator(8)
    prev_xy = random.uniform((0, 0), (640, 360), (60, 2))
    cur_xy = map_points(rigid(12, -5, 0.02, (320, 180)), prev_xy)
    cur_xy += random.normal(0, 0.8, (60, 2))
    cur_xy[:18] += random.uniform(-25, 25, (18, 2))
    for method, expected in zip(("robust", "least_squares"), RECORDED[model], strict=True):
        found, _ = fit_motion(prev_xy, cur_xy, method, 1.5, model=model)
        corners = map_points(found, [(0, 0), (640, 0), (640, 360)])
        np.testing.assert_allclose(corners.ravel(), expected, atol=1e-5)


def test_the_two_points_of_a_hypothesis_differ():
    for count in (2, 3, 50):
        first, second = _pairs(count)
        assert len(first) == len(second) == 100
        assert (first != second).all()
        assert max(first.max(), second.max()) == count - 1
        assert min(first.min(), second.min()) == 0


@pytest.mark.parametrize(("zoom", "kept"), [(1.19, True), (0.81, True), (1.3, False), (0.7, False)])
def test_large_changes_of_scale_are_no_hypothesis(zoom, kept):
    prev_xy = generator(2).uniform(-100, 100, (30, 2))
    p = prev_xy @ (1, 1j)
    rotation, _ = _consensus(p, zoom * p, 1.0, "similarity")
    assert abs(rotation) == pytest.approx(zoom if kept else 1)
    assert abs(_consensus(p, zoom * p, 1.0, "rigid")[0]) == pytest.approx(1)


def test_inliers_have_an_error_of_at_most_the_tolerance():
    prev_xy = np.array([[0.0, 0], [100, 0], [0, 100], [100, 100]])
    cur_xy = prev_xy + np.array([[-2, 0], [2, 0], [-2, 0], [2, 0]])
    for tolerance, share in ((2.0, 1.0), (1.999, 0.0)):
        _, inliers = fit_motion(prev_xy, cur_xy, "least_squares", tolerance)
        assert inliers == share
