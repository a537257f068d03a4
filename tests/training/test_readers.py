"""Training sources of sequences, stamps and regions, and those that cannot be opened."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.sets_on_disk import BOX, opened, scene, write_image, write_stamps
from ssiam.datasets import DatasetError
from ssiam.errors import ArgumentError
from ssiam.training import SourceSettings


def test_sequences_of_tracking_datasets(tmp_path):
    folder = tmp_path / "train/GOT-10k_Train_000001"
    for t in range(3):
        write_image(folder / f"{t + 1:08}.jpg", scene(BOX))
    (folder / "groundtruth.txt").write_text("1,2,30,40\n2,2,30,40\n3,2,30,40\n")
    (folder / "absence.label").write_text("0\n1\n0\n")
    track = opened("got10k", tmp_path, split="train").track(0)
    assert [track.box(t) for t in range(3)] == [(1, 2, 30, 40), None, (3, 2, 30, 40)]


def test_stamps_are_pasted_with_their_masks(tmp_path):
    write_stamps(tmp_path)
    source = opened("stamps", tmp_path / "stamps", backgrounds=(str(tmp_path / "grounds"),))
    track = source.track(1)
    first = track.image(0)
    assert track.frames == 3
    x, y, w, h = map(int, track.box(0))
    assert track.mask(0).sum() > 0.6 * w * h
    assert track.mask(0)[y : y + h, x : x + w].sum() == track.mask(0).sum()
    inner = cv2.erode(track.mask(0).astype(np.uint8), np.ones((5, 5))) > 0
    # The stamps are of one colour, which noise is not.
    assert first[inner].std(axis=0).max() < 3
    assert (track.image(1) != first).any()
    np.testing.assert_array_equal(source.track(1).image(0), first)


def test_rivals_go_beside_the_target_and_may_hide_it(tmp_path):
    write_stamps(tmp_path, count=8)
    grounds = (str(tmp_path / "grounds"),)
    source = opened("stamps", tmp_path / "stamps", backgrounds=grounds, rivals=1.0)
    hidden = 0
    for track in map(source.track, range(20)):
        assert 0 < len(track.rivals) <= 3
        alone = replace(track, rivals=())
        for t in range(track.frames):
            mask, whole = track.mask(t), alone.mask(t)
            assert not (mask & ~whole).any()
            inner = cv2.erode(mask.astype(np.uint8), np.ones((11, 11))) > 0
            np.testing.assert_array_equal(track.image(t)[inner], alone.image(t)[inner])
            changed = (track.image(t) != alone.image(t)).any(axis=-1)
            hidden += (whole & ~mask & changed).any()
            x, y, w, h = alone.box(t)
            rows, columns = changed.nonzero()
            away = np.hypot(columns - x - w / 2, rows - y - h / 2).max(initial=0)
            assert away < 3 * np.hypot(w, h)
    assert 3 < hidden < 30


@pytest.mark.parametrize(("tumbling", "least", "most"), [(0.0, 0, 25), (1.0, 40, 90)])
def test_stamps_may_tumble(tmp_path, tumbling, least, most):
    """By how many degrees an ellipse turns from the first frame to the next, at its median."""
    write_stamps(tmp_path)
    grounds = (str(tmp_path / "grounds"),)
    source = opened("stamps", tmp_path / "stamps", backgrounds=grounds, tumbling=tumbling)
    turns = []
    for track in map(source.track, range(40)):
        outlines = [cv2.findContours(track.mask(t).astype(np.uint8), 0, 1)[0] for t in range(2)]
        if all(len(found) == 1 and len(found[0]) > 20 for found in outlines):
            one, other = (cv2.fitEllipse(found[0])[2] for found in outlines)
            turns.append(abs((one - other + 90) % 180 - 90))
    assert len(turns) > 20
    assert least <= np.median(turns) <= most


def test_regions_have_texture(tmp_path):
    image = np.full((240, 320, 3), 90, np.uint8)
    image[60:180, 160:280] = scene(seed=5)[60:180, 160:280] * 4
    write_image(tmp_path / "half.png", image)
    source = opened("regions", tmp_path)
    boxes = [source.track(i).box(0) for i in range(len(source))]
    found = [box for box in boxes if box is not None]
    assert found
    for x, y, w, h in found:
        assert image[int(y) : int(y + h), int(x) : int(x + w)].std() > 10


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"layout": "imagenet"}, "unknown layout"),
        ({"layout": "voc", "weight": -1}, "weight -1"),
        ({"layout": "stamps"}, "need backgrounds"),
        ({"layout": "stamps", "backgrounds": ("grounds",), "rivals": 1.5}, "rivals 1.5"),
        ({"layout": "voc", "rivals": 0.5}, "rivals 0.5"),
        ({"layout": "regions", "tumbling": 0.5}, "tumbling 0.5"),
    ],
)
def test_wrong_settings_are_told(options, said):
    with pytest.raises(ArgumentError, match=said):
        SourceSettings(**{"path": "somewhere", **options})


@pytest.mark.parametrize("layout", ["voc", "yolo", "davis", "youtube_vos", "masks", "regions"])
def test_an_empty_folder_is_told(tmp_path, layout):
    with pytest.raises(DatasetError, match=str(tmp_path)):
        opened(layout, tmp_path)
