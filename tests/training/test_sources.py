"""Copy-paste scenes, random patches, and the settings of sources."""

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.sets_on_disk import open_set, scene, write_cutouts, write_image
from ssiam.datasets import DatasetError
from ssiam.errors import ArgumentError
from ssiam.training import LAYOUTS, SourceSettings


def open_copy_paste(root, **options):
    return open_set("stamps", root / "stamps", backgrounds=(str(root / "grounds"),), **options)


def test_copy_paste_scenes_have_exact_masks(tmp_path):
    source = open_copy_paste(write_cutouts(tmp_path))
    track = source.track(1)
    first = track.image(0)
    assert track.frames == 3
    x, y, w, h = map(int, track.box(0))
    assert track.mask(0).sum() > 0.6 * w * h
    assert track.mask(0)[y : y + h, x : x + w].sum() == track.mask(0).sum()
    inner = cv2.erode(track.mask(0).astype(np.uint8), np.ones((5, 5))) > 0
    # The objects have one color, the backgrounds are noise.
    assert first[inner].std(axis=0).max() < 3
    assert (track.image(1) != first).any()
    np.testing.assert_array_equal(source.track(1).image(0), first)


def test_distractors_are_beside_the_target_and_may_occlude_it(tmp_path):
    source = open_copy_paste(write_cutouts(tmp_path, count=8), rivals=1.0)
    occluded = 0
    for track in map(source.track, range(20)):
        assert 0 < len(track.distractors) <= 3
        alone = replace(track, distractors=())
        for t in range(track.frames):
            mask, whole = track.mask(t), alone.mask(t)
            assert not (mask & ~whole).any()
            inner = cv2.erode(mask.astype(np.uint8), np.ones((11, 11))) > 0
            np.testing.assert_array_equal(track.image(t)[inner], alone.image(t)[inner])
            changed = (track.image(t) != alone.image(t)).any(axis=-1)
            occluded += (whole & ~mask & changed).any()
            x, y, w, h = alone.box(t)
            rows, columns = changed.nonzero()
            distance = np.hypot(columns - x - w / 2, rows - y - h / 2).max(initial=0)
            assert distance < 3 * np.hypot(w, h)
    assert 3 < occluded < 30


@pytest.mark.parametrize(("tumbling", "least", "most"), [(0.0, 0, 25), (1.0, 40, 90)])
def test_targets_may_tumble(tmp_path, tumbling, least, most):
    """Median rotation of an ellipse between two frames, degrees."""
    source = open_copy_paste(write_cutouts(tmp_path), tumbling=tumbling)
    turns = []
    for track in map(source.track, range(40)):
        outlines = [cv2.findContours(track.mask(t).astype(np.uint8), 0, 1)[0] for t in range(2)]
        if all(len(found) == 1 and len(found[0]) > 20 for found in outlines):
            one, other = (cv2.fitEllipse(found[0])[2] for found in outlines)
            turns.append(abs((one - other + 90) % 180 - 90))
    assert len(turns) > 20
    assert least <= np.median(turns) <= most


def test_random_patches_have_texture(tmp_path):
    image = np.full((240, 320, 3), 90, np.uint8)
    image[60:180, 160:280] = scene(seed=5)[60:180, 160:280] * 4
    write_image(tmp_path / "half.png", image)
    source = open_set("regions", tmp_path)
    boxes = [source.track(i).box(0) for i in range(len(source))]
    found = [box for box in boxes if box is not None]
    assert found
    for x, y, w, h in found:
        assert image[int(y) : int(y + h), int(x) : int(x + w)].std() > 10


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"layout": "imagenet"}, "unknown layout"),
        ({"layout": "voc", "weight": -1}, "weight -1"),
        ({"layout": "stamps"}, "need backgrounds"),
        ({"layout": "stamps", "backgrounds": ("grounds",), "rivals": 1.5}, "rivals 1.5"),
        ({"layout": "voc", "rivals": 0.5}, "rivals 0.5"),
        ({"layout": "regions", "tumbling": 0.5}, "tumbling 0.5"),
    ],
)
def test_invalid_settings_are_rejected(options, message):
    with pytest.raises(ArgumentError, match=message):
        SourceSettings(**{"path": "somewhere", **options})


@pytest.mark.parametrize("layout", ["voc", "yolo", "davis", "youtube_vos", "masks", "regions"])
def test_an_empty_folder_is_rejected(tmp_path, layout):
    with pytest.raises(DatasetError, match=str(tmp_path)):
        open_set(layout, tmp_path)


def test_layouts_are_unique():
    assert len(set(LAYOUTS)) == len(LAYOUTS)


def test_the_data_does_not_need_pytorch():
    code = "import sys, ssiam.training; sys.exit('torch' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
