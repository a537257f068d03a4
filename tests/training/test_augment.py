import numpy as np

from ssiam.training.data.augment import NO_SHAKE, draw_shake, motion_blur, occlude, to_grayscale


def centroid(image):
    rows, columns = np.indices(image.shape[:2])
    weight = image[..., 0].astype(float)
    return (columns * weight).sum() / weight.sum(), (rows * weight).sum() / weight.sum()


def single_bright_pixel():
    crop = np.zeros((101, 101, 3), np.uint8)
    crop[50, 50] = 255
    return crop


def test_motion_blur_follows_the_trail_and_keeps_the_centroid():
    trail = np.linspace(-6, 6, 25)[:, None] * (1.0, 0.5)
    blurred = motion_blur(single_bright_pixel(), trail, np.eye(3))
    np.testing.assert_allclose(centroid(blurred), (50, 50), atol=0.05)
    rows, columns = np.nonzero(blurred[..., 0])
    assert columns.min() in range(43, 46)
    assert columns.max() in range(55, 58)
    # The trail goes down to the right.
    assert np.corrcoef(rows, columns)[0, 1] > 0.9


def test_an_asymmetric_trail_blurs_in_its_own_direction():
    trail = np.array([(-1.0, 0.0)] * 9 + [(9.0, 0.0)])
    blurred = motion_blur(single_bright_pixel(), trail, np.eye(3))
    assert np.nonzero(blurred[50, :, 0])[0].max() == 59


def test_no_shake_leaves_the_crop_unchanged():
    crop = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    assert motion_blur(crop, NO_SHAKE.trail, np.eye(3)) is crop


def test_shakes_have_plausible_magnitudes():
    rng = np.random.default_rng(0)
    shakes = [draw_shake((320.0, 240.0), (640, 480), rng) for _ in range(300)]
    steps = np.array([shake.step_xy for shake in shakes])
    assert 1 < np.median(np.abs(steps)) < 8
    assert np.abs(steps).max() < 120
    for shake in shakes:
        np.testing.assert_allclose(shake.trail.mean(axis=0), 0, atol=1e-9)


def test_an_occluder_covers_a_part_of_the_target():
    rng = np.random.default_rng(1)
    crop = rng.integers(0, 255, (255, 255, 3), dtype=np.uint8)
    target = np.array([10.0, -20.0, 80.0, 60.0])
    fractions = []
    for _ in range(100):
        _, occluded = occlude(crop, target, rng)
        inside = occluded[127 - 50 : 127 + 10, 127 - 30 : 127 + 50]
        fractions.append(inside.mean())
    assert max(fractions) < 0.6
    assert np.mean(fractions) > 0.08


def test_grayscale_has_three_equal_channels():
    crop = np.random.default_rng(2).integers(0, 255, (9, 9, 3), dtype=np.uint8)
    gray = to_grayscale(crop)
    assert (gray == gray[..., :1]).all()
