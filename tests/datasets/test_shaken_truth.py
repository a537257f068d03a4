"""Ground truth of shaken clips, compared with their frames and with the path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.datasets_on_disk import boxes, write_otb
from helpers.shake_clips import BLOB, SIZE, STRENGTH, blob_clip, blob_image, sequence
from ssiam.datasets import (
    SHAKE_KINDS,
    Dataset,
    Shake,
    VideoSequence,
    camera_path,
    open_dataset,
    shaken,
    shaken_dataset,
)
from ssiam.errors import SourceError
from ssiam.geometry import local_zoom, map_points


def centroid(image):
    intensity = image[..., 0].astype(np.float64)
    y, x = np.mgrid[: intensity.shape[0], : intensity.shape[1]]
    return np.array([(x * intensity).sum(), (y * intensity).sum()]) / intensity.sum()


SETTINGS = [
    # name, values that are not the default
    ("reflect", {}),
    ("crop", {"border": "crop"}),
    ("blur", {"exposure": 0.6}),
    ("rolling shutter", {"readout": 0.8}),
    ("all of them", {"border": "crop", "exposure": 0.4, "readout": 0.6}),
]


@pytest.mark.parametrize("polygon", [False, True], ids=["box", "polygon"])
@pytest.mark.parametrize("settings", [row[1] for row in SETTINGS], ids=[row[0] for row in SETTINGS])
@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_the_ground_truth_is_the_position_of_the_target(tmp_path, kind, settings, polygon):
    clip = shaken(blob_clip(tmp_path, polygon=polygon), Shake(STRENGTH, kind, **settings))
    for image, row in zip(clip.images(), clip.truth, strict=True):
        assert image.shape[1::-1] == clip.size_wh
        center = row.reshape(4, 2).mean(axis=0) if polygon else row[:2] + row[2:] / 2
        assert np.linalg.norm(centroid(image) - center) < 0.2


def test_with_a_global_shutter_the_ground_truth_follows_the_path(tmp_path):
    shake = Shake(STRENGTH, "zoom", exposure=0.5)
    clip = shaken(blob_clip(tmp_path), shake)
    path = camera_path(shake, len(clip), SIZE, clip.name)
    assert np.array_equal(clip.shaken_from_raw, path)
    for pose, (x, y, w, h) in zip(path, clip.truth, strict=True):
        assert map_points(pose, [BLOB])[0] == pytest.approx((x + w / 2, y + h / 2))
        assert (w, h) == pytest.approx(20 * local_zoom(pose, BLOB) * np.array([1, 0.8]))


def test_unknown_boxes_stay_unknown(tmp_path):
    truth = np.tile([100.0, 80, 30, 20], (6, 1))
    truth[[1, 4]] = np.nan
    clip = shaken(sequence(tmp_path, blob_image(), 6, truth), Shake(STRENGTH))
    assert np.isnan(clip.truth).all(axis=1).tolist() == [False, True, False, False, True, False]
    unknown = np.full((6, 8), np.nan)
    clip = shaken(replace(clip.raw, truth=unknown), Shake(STRENGTH, readout=0.5))
    assert np.isnan(clip.truth).all()
    assert clip.truth.shape == (6, 8)
    first_only = shaken(replace(clip.raw, truth=truth[:1]), Shake(STRENGTH))
    assert (len(first_only), len(first_only.truth)) == (6, 1)


@pytest.mark.parametrize("polygon", [False, True], ids=["box", "polygon"])
def test_a_target_outside_of_the_frame_has_no_box(tmp_path, polygon):
    row = [0, 100, 4, 100, 4, 104, 0, 104] if polygon else [0, 100, 4, 4]
    raw = sequence(tmp_path, blob_image(), 40, [row] * 40)
    clip = shaken(raw, Shake(STRENGTH))
    known = np.isfinite(clip.truth).all(axis=1)
    positions = map_points(
        np.eye(3), [map_points(pose, [(2, 102)])[0] for pose in clip.shaken_from_raw]
    )
    assert 5 < known.sum() < 35
    assert (positions[known, 0] > -3.5).all()
    assert (positions[~known, 0] < -1.5).all()


def test_a_dataset_is_shaken_at_lookup(tmp_path):
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


def test_with_a_known_size_no_image_is_opened(tmp_path):
    raw = VideoSequence("s", (tmp_path / "missing.png",) * 3, boxes(3), size_wh=SIZE)
    dataset = shaken_dataset(Dataset("d", "pysot", {"s": raw}), Shake(STRENGTH))
    assert dataset.sequences["s"].truth.shape == (3, 4)
