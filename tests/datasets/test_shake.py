"""Shake: its paths measured, its pictures held to its truth, and what it refuses."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from on_disk import boxes, write_otb

from ssiam.datasets import (
    SHAKE_KINDS,
    Dataset,
    Sequence,
    Shake,
    camera_path,
    open_dataset,
    shaken,
    shaken_dataset,
)
from ssiam.errors import ArgumentError, FrameSizeError, SourceError
from ssiam.geometry import frame_centre, local_zoom, map_points, rigid_parameters

SIZE = (320, 240)
BLOB = (150.3, 108.6)  # where its light is, pixels
STRENGTH = 0.03


def sequence(folder, picture, count, truth, name="clip", **fields):
    """The same picture in every frame."""
    path = folder / f"{name}.png"
    cv2.imwrite(str(path), picture)
    return Sequence(name, (path,) * count, np.asarray(truth, dtype=np.float64), **fields)


def blob_picture():
    """A soft light on black: no border's mirror image brings a second one into view."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    light = 250 * np.exp(-((x - BLOB[0]) ** 2 + (y - BLOB[1]) ** 2) / (2 * 3.0**2))
    return np.repeat(np.rint(light).astype(np.uint8)[..., None], 3, axis=2)


def blob_clip(folder, count=12, polygon=False):
    x, y = BLOB
    box = [x - 10, y - 8, 20, 16]
    corners = [x - 10, y - 8, x + 10, y - 8, x + 10, y + 8, x - 10, y + 8]
    return sequence(folder, blob_picture(), count, [corners if polygon else box] * count)


def centroid(image):
    light = image[..., 0].astype(np.float64)
    y, x = np.mgrid[: light.shape[0], : light.shape[1]]
    return np.array([(x * light).sum(), (y * light).sum()]) / light.sum()


def shifts_angles_zooms(shake, count, size_wh=SIZE, name=""):
    """(N, 4): dx and dy in widths, angle, log zoom."""
    found = []
    for pose in camera_path(shake, count, size_wh, name):
        dx, dy, angle = rigid_parameters(pose, frame_centre(size_wh))
        zoom = local_zoom(pose, frame_centre(size_wh))
        found.append((dx / size_wh[0], dy / size_wh[0], angle, np.log(zoom)))
    return np.array(found)


DEGREE = np.deg2rad(1)
DEVIATIONS = [
    # kind, standard deviations of dx and dy in widths, angle, log zoom; at 3 %
    ("white", (0.03, 0.03, DEGREE, 0)),
    ("handheld", (0.03, 0.03, DEGREE, 0)),
    ("vibration", (0.03, 0.03, DEGREE, 0)),
    ("gusts", (0.03, 0.03, DEGREE, 0)),
    ("roll", (0, 0, 0.06, 0)),
    ("zoom", (0, 0, 0, 0.06)),
]


@pytest.mark.parametrize(("kind", "wanted"), DEVIATIONS, ids=[row[0] for row in DEVIATIONS])
def test_strength_is_the_standard_deviation(kind, wanted):
    found = [shifts_angles_zooms(Shake(STRENGTH, kind, seed), 4000) for seed in range(3)]
    found = np.concatenate(found).std(axis=0)
    assert found == pytest.approx(wanted, rel=0.1, abs=1e-9)


@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_a_path_repeats_and_scales_and_depends_on_seed_and_name(kind):
    path = shifts_angles_zooms(Shake(STRENGTH, kind, 4), 60, name="a")
    assert np.array_equal(path, shifts_angles_zooms(Shake(STRENGTH, kind, 4), 60, name="a"))
    assert 2 * path == pytest.approx(
        shifts_angles_zooms(Shake(2 * STRENGTH, kind, 4), 60, name="a"), abs=1e-9
    )
    assert path[:40] == pytest.approx(
        shifts_angles_zooms(Shake(STRENGTH, kind, 4), 40, name="a"), abs=1e-9
    )
    for other, name in ((Shake(STRENGTH, kind, 5), "a"), (Shake(STRENGTH, kind, 4), "b")):
        assert abs(path - shifts_angles_zooms(other, 60, name=name)).max() > 0.01


def test_a_path_is_the_same_in_another_process():
    """Python's own hash of a name is not."""
    code = (
        "from ssiam.datasets import Shake, camera_path;"
        "print(camera_path(Shake(0.03, 'gusts'), 5, (320, 240), 'walk').tobytes().hex())"
    )
    told = [
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    ]
    assert told[0] == told[1]


def test_kinds_are_told_apart_by_their_speed():
    """Steps from frame to frame, in standard deviations of the path."""

    def speed(kind):
        path = shifts_angles_zooms(Shake(STRENGTH, kind), 2000)[:, :2]
        return np.diff(path, axis=0).std() / path.std()

    assert speed("white") == pytest.approx(np.sqrt(2), rel=0.1)
    assert 0.15 < speed("handheld") < 0.35
    assert speed("vibration") > 0.9
    assert 0.3 < speed("gusts") < 0.6


def test_vibration_is_fast_and_handheld_is_slow():
    def share_above(kind, cycles):
        power = abs(np.fft.rfft(shifts_angles_zooms(Shake(STRENGTH, kind), 1024)[:, 0])) ** 2
        return power[np.fft.rfftfreq(1024) > cycles].sum() / power.sum()

    assert share_above("vibration", 0.12) > 0.95
    assert share_above("handheld", 0.12) < 0.1


@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_a_strength_of_0_changes_nothing(tmp_path, kind):
    folder = write_otb(tmp_path, "Walking", range(1, 5), boxes(4))
    raw = open_dataset(folder).sequences["Walking"]
    same = shaken(raw, Shake(0, kind, exposure=0.5, readout=0.5, border="crop"))
    assert np.array_equal(same.truth, raw.truth)
    assert np.array_equal(same.shaken_from_raw, [np.eye(3)] * 4)
    for start in (0, 2):
        images = list(same.images(start))
        assert len(images) == 4 - start
        assert all(map(np.array_equal, images, raw.images(start)))


SEEN = [
    # name, what is not as by default
    ("reflect", {}),
    ("crop", {"border": "crop"}),
    ("blur", {"exposure": 0.6}),
    ("rolling shutter", {"readout": 0.8}),
    ("all of them", {"border": "crop", "exposure": 0.4, "readout": 0.6}),
]


@pytest.mark.parametrize("polygon", [False, True], ids=["box", "polygon"])
@pytest.mark.parametrize("settings", [row[1] for row in SEEN], ids=[row[0] for row in SEEN])
@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_the_target_is_where_the_truth_says(tmp_path, kind, settings, polygon):
    clip = shaken(blob_clip(tmp_path, polygon=polygon), Shake(STRENGTH, kind, **settings))
    for image, row in zip(clip.images(), clip.truth, strict=True):
        assert image.shape[1::-1] == clip.size_wh
        centre = row.reshape(4, 2).mean(axis=0) if polygon else row[:2] + row[2:] / 2
        assert np.linalg.norm(centroid(image) - centre) < 0.2


def test_without_readout_the_truth_is_the_path(tmp_path):
    shake = Shake(STRENGTH, "zoom", exposure=0.5)
    clip = shaken(blob_clip(tmp_path), shake)
    path = camera_path(shake, len(clip), SIZE, clip.name)
    assert np.array_equal(clip.shaken_from_raw, path)
    for pose, (x, y, w, h) in zip(path, clip.truth, strict=True):
        assert map_points(pose, [BLOB])[0] == pytest.approx((x + w / 2, y + h / 2))
        assert (w, h) == pytest.approx(20 * local_zoom(pose, BLOB) * np.array([1, 0.8]))


def test_frames_from_the_middle_on_are_the_same(tmp_path):
    clip = shaken(blob_clip(tmp_path, count=5), Shake(STRENGTH, "gusts"))
    assert all(map(np.array_equal, list(clip.images())[3:], clip.images(3)))


def gradient():
    """Each pixel tells its place: blue is x, green is y."""
    y, x = np.mgrid[:180, :250]
    return np.stack([x, y, np.zeros_like(x)], axis=2).astype(np.uint8)


@pytest.mark.parametrize("readout", [0.0, 0.7], ids=["at once", "rolling"])
@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_cropping_shows_nothing_but_the_picture(tmp_path, kind, readout):
    raw = sequence(tmp_path, gradient(), 40, [[100, 80, 30, 20]] * 40)
    shake = Shake(0.04, kind, border="crop", readout=readout)
    clip = shaken(raw, shake)
    width, height = clip.size_wh
    for index, image in enumerate(clip.images()):
        rows = clip.camera._delays(np.arange(height, dtype=float))
        for row in (0, height // 2, height - 1):
            raw_from_shaken = np.linalg.inv(clip.camera.path.at(index + rows[row]))
            places = map_points(raw_from_shaken, [(x, row) for x in range(width)])
            assert places.min() > -1e-6
            assert (places.max(axis=0) < (249 + 1e-6, 179 + 1e-6)).all()
            assert abs(image[row, :, :2] - places).max() < 0.6


def test_the_window_is_the_same_for_every_seed_and_kept_small(tmp_path):
    raw = blob_clip(tmp_path)
    sizes = {shaken(raw, Shake(0.01, seed=n, border="crop")).size_wh for n in range(5)}
    assert len(sizes) == 1
    width, height = sizes.pop()
    assert (width, height) > (0.9 * SIZE[0], 0.85 * SIZE[1])


def spread(image):
    """Covariance (2, 2) of the light in x and y, pixels squared."""
    light = image[..., 0].astype(np.float64)
    y, x = np.mgrid[: light.shape[0], : light.shape[1]]
    return np.cov(x.ravel(), y.ravel(), aweights=light.ravel())


def test_an_exposure_blurs_along_the_way(tmp_path):
    clip = shaken(blob_clip(tmp_path), Shake(0.05, exposure=0.8))
    for index, image in enumerate(clip.images()):
        times = index + np.linspace(-0.4, 0.4, 200)
        way = np.array([map_points(pose, [BLOB])[0] for pose in clip.camera.path.at(times)])
        wanted = 3.0**2 * np.eye(2) + np.cov(way.T)
        assert spread(image) == pytest.approx(wanted, rel=0.06, abs=1.5)


def test_a_rolling_shutter_shears_what_is_upright(tmp_path):
    picture = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    picture[:, 158:163] = 255
    raw = sequence(tmp_path, picture, 20, [[150, 100, 20, 20]] * 20)
    for readout in (0.0, 0.5):
        clip = shaken(raw, Shake(STRENGTH, "handheld", readout=readout))
        columns = np.arange(SIZE[0])
        for index, image in enumerate(clip.images()):
            line = image[20:220, :, 0].astype(float)
            found = (line * columns).sum(axis=1) / line.sum(axis=1)
            ends = np.polyfit(np.arange(20, 220), found, 1)[0] * SIZE[1]
            start, end = clip.camera.path.at(index + np.array([-readout / 2, readout / 2]))
            angle = (start[0, 1] + end[0, 1]) / 2
            shift = map_points(end, [(160, 120)])[0, 0] - map_points(start, [(160, 120)])[0, 0]
            assert ends == pytest.approx(shift + angle * SIZE[1], abs=1.0)


def test_what_is_not_told_stays_untold(tmp_path):
    truth = np.tile([100.0, 80, 30, 20], (6, 1))
    truth[[1, 4]] = np.nan
    clip = shaken(sequence(tmp_path, blob_picture(), 6, truth), Shake(STRENGTH))
    assert np.isnan(clip.truth).all(axis=1).tolist() == [False, True, False, False, True, False]
    nothing = np.full((6, 8), np.nan)
    clip = shaken(replace(clip.raw, truth=nothing), Shake(STRENGTH, readout=0.5))
    assert np.isnan(clip.truth).all()
    assert clip.truth.shape == (6, 8)
    first_only = shaken(replace(clip.raw, truth=truth[:1]), Shake(STRENGTH))
    assert (len(first_only), len(first_only.truth)) == (6, 1)


@pytest.mark.parametrize("polygon", [False, True], ids=["box", "polygon"])
def test_a_target_that_has_left_the_picture_is_not_told(tmp_path, polygon):
    row = [0, 100, 4, 100, 4, 104, 0, 104] if polygon else [0, 100, 4, 4]
    raw = sequence(tmp_path, blob_picture(), 40, [row] * 40)
    clip = shaken(raw, Shake(STRENGTH))
    told = np.isfinite(clip.truth).all(axis=1)
    seen = map_points(np.eye(3), [map_points(pose, [(2, 102)])[0] for pose in clip.shaken_from_raw])
    assert 5 < told.sum() < 35
    assert (seen[told, 0] > -3.5).all()
    assert (seen[~told, 0] < -1.5).all()


def test_a_dataset_is_shaken_when_it_is_read(tmp_path):
    for name in ("Walking", "Running"):
        write_otb(tmp_path, name, range(1, 4), boxes(3))
    (tmp_path / "Running" / "img" / "0001.jpg").write_bytes(b"")
    raw = open_dataset(tmp_path)
    dataset = shaken_dataset(raw, Shake(STRENGTH))
    assert (dataset.name, dataset.kind) == (raw.name, raw.kind)
    assert list(dataset.sequences) == list(raw.sequences)
    walking = dataset.sequences["Walking"]
    assert (walking.name, walking.size_wh, len(walking)) == ("Walking", (12, 8), 3)
    assert not np.array_equal(walking.truth, raw.sequences["Walking"].truth)
    with pytest.raises(SourceError, match=r"0001\.jpg"):
        dataset.sequences["Running"]


def test_where_the_size_is_told_no_image_is_opened(tmp_path):
    raw = Sequence("s", (tmp_path / "absent.png",) * 3, boxes(3), size_wh=SIZE)
    dataset = shaken_dataset(Dataset("d", "pysot", {"s": raw}), Shake(STRENGTH))
    assert dataset.sequences["s"].truth.shape == (3, 4)


def test_frames_of_another_size_are_told(tmp_path):
    raw = replace(blob_clip(tmp_path, count=2), size_wh=(300, 240))
    with pytest.raises(FrameSizeError, match="clip: frame 0 is 320x240, not 300x240"):
        list(shaken(raw, Shake(STRENGTH)).images())


def test_a_shake_is_a_value():
    shake = Shake(0.03, "gusts", 2, exposure=0.5, border="crop")
    assert pickle.loads(pickle.dumps(shake)) == shake
    assert shake.label == "gusts-0.03-seed2-exposure=0.5-border=crop"
    assert Shake(0.01).label == "white-0.01-seed0"


REFUSED = [
    # name, fields, words of the message
    ("percent", {"strength": 3}, "strength of shake 3: give a share from 0 to 1"),
    ("negative", {"strength": -0.01}, "strength of shake -0.01"),
    ("nan", {"strength": float("nan")}, "strength of shake nan"),
    ("long exposure", {"strength": 0, "exposure": 1.5}, "exposure of shake 1.5"),
    ("negative readout", {"strength": 0, "readout": -1}, "readout of shake -1"),
    ("negative seed", {"strength": 0, "seed": -1}, "seed of shake -1"),
    ("unknown kind", {"strength": 0, "kind": "sway"}, "unknown kind of shake 'sway'"),
    ("unknown border", {"strength": 0, "border": "black"}, "unknown border of shake 'black'"),
]


@pytest.mark.parametrize(
    ("values", "message"), [row[1:] for row in REFUSED], ids=[row[0] for row in REFUSED]
)
def test_values_out_of_range_are_refused(values, message):
    with pytest.raises(ArgumentError, match=message):
        Shake(**values)


def test_a_window_that_would_be_nothing_is_refused():
    with pytest.raises(ArgumentError, match="leaves nothing of 320x240 pixels"):
        camera_path(Shake(0.2, border="crop"), 5, SIZE)
