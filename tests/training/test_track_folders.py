"""Folders of tracks cut out of videos: other objects of the video are mapped into their crops."""

import json
import logging

import cv2
import numpy as np
import pytest

from helpers.sets_on_disk import opened, scene, write_image
from ssiam.datasets import DatasetError
from ssiam.errors import ArgumentError
from ssiam.training import SourceSettings
from ssiam.training.choosing import Chooser
from ssiam.training.track_folders import list_videos

# Bright rectangles of 20 x 30 in frames of 320 x 240: where each is in a frame of its video.
SIZE = (20, 30)


def place(number, frame):
    return 40 + 60 * number + frame, 80 + 10 * number


def write_track(root, name, number, windows, *, video="park", category="person", **meta):
    """A folder of the object `number`; `windows` (x0, y0, x1, y1, scale) by frame."""
    folder = root / name
    lines = []
    for index, (frame, (left, top, right, bottom, scale)) in enumerate(windows.items(), 1):
        drawn = [(*place(each, frame), *SIZE) for each in range(4)]
        picture = scene(*drawn)[top:bottom, left:right]
        picture = picture.repeat(scale, axis=0).repeat(scale, axis=1)
        write_image(folder / f"{index:08}.png", picture)
        x, y = place(number, frame)
        box = (x - left, y - top, *SIZE)
        lines.append(",".join(f"{value * scale:.2f}" for value in box) + "\n")
    (folder / "groundtruth.txt").write_text("".join(lines))
    (folder / "absence.label").write_text("0\n" * len(windows))
    content = {
        "video": video,
        "track_id": number,
        "category": category,
        "frames": list(windows),
        "crop_windows_x0y0x1y1_scale": [list(window) for window in windows.values()],
    }
    (folder / "meta.json").write_text(json.dumps(content | meta))
    return folder


WHOLE = (0, 0, 320, 240, 1)
RIGHT = (90, 60, 250, 180, 2)


@pytest.fixture
def pack(tmp_path):
    sets = tmp_path / "walkers"
    write_track(sets, "park_id000_s0", 0, {0: WHOLE, 10: WHOLE, 20: WHOLE})
    write_track(sets, "park_id001_s0", 1, {0: RIGHT, 10: (60, 60, 200, 150, 1)})
    write_track(sets, "park_id001_s1", 1, {20: WHOLE, 40: WHOLE})
    write_track(sets, "park_id002_s0", 2, {0: WHOLE, 20: RIGHT})
    write_track(sets, "street_id000_s0", 0, {0: WHOLE}, video="street")
    write_track(sets, "park_id003_s0", 3, {0: WHOLE}, category="bag")
    return tmp_path


def track_of(source, name):
    return next(i for i in range(len(source)) if source.track(i).folder.name == name)


def boxes_beside(source, i):
    """Boxes by frame of each track beside one."""
    tracks = [source.track(j) for j in source.beside(i)]
    return [[track.box(t) for t in range(track.frames)] for track in tracks]


def test_len_counts_the_folders_and_their_distractors_come_behind(pack):
    source = opened("tracks", pack)
    assert len(source) == 6
    beside = [source.beside(i) for i in range(len(source))]
    assert sorted(j for own in beside for j in own) == list(range(6, 6 + sum(map(len, beside))))
    assert source.track(0) is source.track(0)


def test_other_objects_are_mapped_through_the_windows(pack):
    source = opened("tracks", pack)
    i = track_of(source, "park_id001_s0")
    # Object 0 is at x 40 in frame 0, outside of the window; in frame 10 at 50 .. 70, half inside.
    # Object 2 is at 160, 100 in frame 0, of which the window shows twice the size.
    assert boxes_beside(source, i) == [
        [None, (-10, 20, 20, 30)],
        [((160 - 90) * 2, (100 - 60) * 2, 40, 60), None],
    ]
    for j in source.beside(i):
        assert source.track(j).shows == source.track(i).shows
        np.testing.assert_array_equal(source.track(j).image(1), source.track(i).image(1))


def test_mapped_boxes_lie_on_the_objects(pack):
    source = opened("tracks", pack, interpolate=20)
    count = 0
    for i in range(len(source)):
        for j in source.beside(i):
            track = source.track(j)
            for t in range(track.frames):
                if track.box(t) is not None:
                    x, y, w, h = map(round, track.box(t))
                    inside = track.image(t)[max(y, 0) : y + h, max(x, 0) : x + w]
                    assert inside.min() > 60
                    count += 1
    assert count >= 12


def test_the_same_object_in_another_folder_is_no_distractor_of_itself(pack):
    source = opened("tracks", pack)
    i = track_of(source, "park_id001_s1")
    assert len(source.beside(i)) == 2  # objects 0 and 2; not its own first folder, nor the bag
    first = source.track(track_of(source, "park_id001_s0"))
    assert set(first.shows) & set(source.track(i).shows)


def test_categories_and_videos_are_kept_apart(pack):
    source = opened("tracks", pack)
    assert not source.beside(track_of(source, "park_id003_s0"))
    assert not source.beside(track_of(source, "street_id000_s0"))
    street = source.track(track_of(source, "street_id000_s0"))
    assert not set(street.shows) & set(source.track(0).shows)


def test_boxes_between_two_annotations_are_interpolated_where_asked(pack):
    i = track_of(opened("tracks", pack), "park_id000_s0")
    # Object 2 is annotated in frames 0 and 20, 20 px apart: less than its size of 24.5.
    plain, filled, short = (
        boxes_beside(opened("tracks", pack, interpolate=n), i)[1] for n in (0, 20, 19)
    )
    assert plain[1] is None
    assert filled[1] == (*place(2, 10), *SIZE)
    assert short == plain
    # Object 1 moves 20 px from frame 20 to 40, and by more than its size between 10 and 40.
    write_track(pack / "walkers", "park_id004_s0", 0, {35: WHOLE}, track_id=4)
    boxes = boxes_beside(opened("tracks", pack, interpolate=20), 5)
    assert (*place(1, 35), *SIZE) in [box for own in boxes for box in own]
    (pack / "walkers/park_id001_s1/absence.label").write_text("1\n0\n")
    boxes = boxes_beside(opened("tracks", pack, interpolate=30), 5)
    assert (*place(1, 35), *SIZE) not in [box for own in boxes for box in own]


def test_a_distractor_knows_the_target_and_the_others(pack):
    source = opened("tracks", pack)
    i = track_of(source, "park_id000_s0")
    first, second = source.beside(i)
    assert list(source.beside(first)) == [i, second]


def test_a_target_is_never_taken_for_another_of_its_scene(pack):
    source = opened("tracks", pack, without=("*/street",))
    chooser, rng = Chooser([source], reach=100), np.random.default_rng(0)
    shot = chooser.first(rng)
    assert chooser.another(shot, rng) is None
    beside = [chooser.beside(shot, rng) for _ in range(50)]
    assert all(each is None or each.xywh != shot.xywh for each in beside)


def test_two_parts_of_one_clip_are_one_scene(tmp_path):
    write_track(tmp_path / "crowdht21", "a", 0, {0: WHOLE}, video="ht21-12")
    write_track(tmp_path / "crowdht21", "b", 1, {0: WHOLE}, video="ht21-12b", track_id=0)
    write_track(tmp_path / "posetrack", "c", 0, {0: WHOLE}, video="060470979_body")
    write_track(tmp_path / "posetrack", "d", 0, {0: WHOLE}, video="060470979_head", category="head")
    source = opened("tracks", tmp_path)
    assert [len(source.beside(i)) for i in range(4)] == [1, 1, 0, 0]
    body, head = (set(source.track(i).shows) for i in (2, 3))
    assert body & head


def test_videos_are_named_with_their_set(pack):
    assert list_videos(pack) == list_videos(pack / "walkers") == ("walkers/park", "walkers/street")
    assert len(opened("tracks", pack, without=("walkers/park",))) == 1
    assert len(opened("tracks", pack, only=("walkers/p*",))) == 5
    assert len(opened("tracks", pack / "walkers", only=("walkers/street",))) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("{", "is not JSON"),
        ("[]", "does not name the video"),
        ({"frames": [0]}, "3 pictures, but not as many frames"),
        ({"frames": [0, 1, "2"]}, "frames are not whole numbers"),
        ({"crop_windows_x0y0x1y1_scale": [[0, 0, 9, 9]] * 3}, "is not a window"),
        ({"crop_windows_x0y0x1y1_scale": [[0, 0, 0, 9, 1]] * 3}, "without area"),
        ({"crop_windows_x0y0x1y1_scale": [[0, 0, 9, 9, float("nan")]] * 3}, "without area"),
    ],
    ids=["no json", "a list", "few frames", "words", "few numbers", "no area", "nan"],
)
def test_damaged_folders_are_told(tmp_path, change, said, caplog):
    sets = tmp_path / "walkers"
    meta = write_track(sets, "bad", 0, dict.fromkeys(range(3), WHOLE)) / "meta.json"
    content = json.loads(meta.read_text())
    meta.write_text(change if isinstance(change, str) else json.dumps(content | change))
    with pytest.raises(DatasetError, match=rf"meta\.json.*{said}"):
        opened("tracks", tmp_path)
    for number in range(10):
        write_track(sets, f"good{number}", 0, {0: WHOLE})
    with caplog.at_level(logging.WARNING):
        assert len(opened("tracks", tmp_path)) == 10
    assert "1 of 11" in caplog.text


def test_only_tracks_are_interpolated():
    for layout, frames in (("got10k", 5), ("tracks", -1), ("tracks", 5000)):
        with pytest.raises(ArgumentError, match="interpolate"):
            SourceSettings(layout, "x", interpolate=frames)


def test_the_shared_pack(shared):
    folder = shared("data/training/tracks")
    assert len(list_videos(folder)) == 154
    plain, filled = (opened("tracks", folder, interpolate=n) for n in (0, 20))
    assert len(plain) == len(filled) == 575
    counts = [
        sum(box is not None for i in range(575) for own in boxes_beside(s, i) for box in own)
        for s in (plain, filled)
    ]
    assert counts[0] > 5000
    assert counts[1] > 2 * counts[0]


def test_a_mapped_box_shows_what_the_pictures_of_its_own_folder_show(shared):
    source = opened("tracks", shared("data/training/tracks"), only=("mot17mini/MOT17-02",))
    frames = [
        json.loads((source.track(i).folder / "meta.json").read_text())["frames"]
        for i in range(len(source))
    ]
    likeness = {0.0: [], 0.5: []}  # by a shift, in widths
    for i, own in enumerate(frames):
        looks = [
            look(source.track(j).image(t), source.track(j).box(t))
            for j, known in enumerate(frames)
            for t, frame in enumerate(known)
            if j != i and frame == own[0]
        ]
        for mapped in map(source.track, source.beside(i)):
            if mapped.box(0) is not None:
                x, y, w, h = mapped.box(0)
                for shift, found in likeness.items():
                    mine = look(mapped.image(0), (x + shift * w, y, w, h))
                    found.append(max(float((mine * other).mean()) for other in looks))
    assert len(likeness[0]) > 100
    assert np.median(likeness[0]) > 0.9
    assert np.median(likeness[0.5]) < 0.8


def look(image, xywh):
    """What is in a box: 12 x 24 pixels, of mean 0 and deviation 1."""
    x, y, w, h = xywh
    image_from_look = np.array([[w / 12, 0, x], [0, h / 24, y]])
    pixels = cv2.warpAffine(
        image, image_from_look, (12, 24), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    ).astype(float)
    return (pixels - pixels.mean()) / max(pixels.std(), 1e-9)
