"""Folders of tracks cropped from videos: other objects of the video are mapped into the crops."""

import json
import logging

import cv2
import numpy as np
import pytest

from helpers.sets_on_disk import open_set
from helpers.track_sets import SIZE, WHOLE, position, write_track, write_walkers
from ssiam.datasets import DatasetError
from ssiam.errors import ArgumentError
from ssiam.training import SourceSettings
from ssiam.training.data.sampling import TargetSampler
from ssiam.training.data.track_folders import list_videos


@pytest.fixture
def folders(tmp_path):
    return write_walkers(tmp_path)


def track_of(source, name):
    return next(i for i in range(len(source)) if source.track(i).folder.name == name)


def distractor_boxes(source, i):
    """Boxes by frame of each distractor of a track."""
    tracks = [source.track(j) for j in source.distractors(i)]
    return [[track.box(t) for t in range(track.frames)] for track in tracks]


def test_distractors_have_the_indices_after_the_folders(folders):
    source = open_set("tracks", folders)
    assert len(source) == 6
    found = [source.distractors(i) for i in range(len(source))]
    assert sorted(j for own in found for j in own) == list(range(6, 6 + sum(map(len, found))))
    assert source.track(0) is source.track(0)


def test_other_objects_are_mapped_through_the_regions(folders):
    source = open_set("tracks", folders)
    i = track_of(source, "park_id001_s0")
    # Object 0 is at x 40 in frame 0, outside the region, and at 50 to 70 in frame 10, half inside.
    # Object 2 is at 160, 100 in frame 0, which the region shows at twice the size.
    assert distractor_boxes(source, i) == [
        [None, (-10, 20, 20, 30)],
        [((160 - 90) * 2, (100 - 60) * 2, 40, 60), None],
    ]
    for j in source.distractors(i):
        assert source.track(j).scene_ids == source.track(i).scene_ids
        np.testing.assert_array_equal(source.track(j).image(1), source.track(i).image(1))


def test_mapped_boxes_are_on_the_objects(folders):
    source = open_set("tracks", folders, interpolate=20)
    count = 0
    for i in range(len(source)):
        for j in source.distractors(i):
            track = source.track(j)
            for t in range(track.frames):
                if track.box(t) is not None:
                    x, y, w, h = map(round, track.box(t))
                    inside = track.image(t)[max(y, 0) : y + h, max(x, 0) : x + w]
                    assert inside.min() > 60
                    count += 1
    assert count >= 12


def test_the_same_object_in_another_folder_is_not_a_distractor(folders):
    source = open_set("tracks", folders)
    i = track_of(source, "park_id001_s1")
    assert len(source.distractors(i)) == 2  # objects 0 and 2, but not the bag
    first = source.track(track_of(source, "park_id001_s0"))
    assert set(first.scene_ids) & set(source.track(i).scene_ids)


def test_distractors_are_of_the_same_category_and_video(folders):
    source = open_set("tracks", folders)
    assert not source.distractors(track_of(source, "park_id003_s0"))
    assert not source.distractors(track_of(source, "street_id000_s0"))
    street = source.track(track_of(source, "street_id000_s0"))
    assert not set(street.scene_ids) & set(source.track(0).scene_ids)


def test_boxes_between_two_annotations_are_interpolated(folders):
    i = track_of(open_set("tracks", folders), "park_id000_s0")
    # Object 2 is annotated in frames 0 and 20, 20 px apart: less than its size of 24.5.
    plain, filled, short = (
        distractor_boxes(open_set("tracks", folders, interpolate=n), i)[1] for n in (0, 20, 19)
    )
    assert plain[1] is None
    assert filled[1] == (*position(2, 10), *SIZE)
    assert short == plain
    # Object 1 moves 20 px from frame 20 to 40, and by more than its size between 10 and 40.
    write_track(folders / "walkers", "park_id004_s0", 0, {35: WHOLE}, track_id=4)
    boxes = distractor_boxes(open_set("tracks", folders, interpolate=20), 5)
    assert (*position(1, 35), *SIZE) in [box for own in boxes for box in own]
    (folders / "walkers/park_id001_s1/absence.label").write_text("1\n0\n")
    boxes = distractor_boxes(open_set("tracks", folders, interpolate=30), 5)
    assert (*position(1, 35), *SIZE) not in [box for own in boxes for box in own]


def test_distractors_of_a_distractor_are_the_target_and_the_others(folders):
    source = open_set("tracks", folders)
    i = track_of(source, "park_id000_s0")
    first, second = source.distractors(i)
    assert list(source.distractors(first)) == [i, second]


def test_negatives_are_not_from_the_same_scene(folders):
    source = open_set("tracks", folders, without=("*/street",))
    sampler, rng = TargetSampler([source], reach=100), np.random.default_rng(0)
    target = sampler.draw(rng)
    assert sampler.draw_other(target, rng) is None
    found = [sampler.draw_distractor(target, rng) for _ in range(50)]
    assert all(each is None or each.xywh != target.xywh for each in found)


def test_two_parts_of_one_clip_are_one_scene(tmp_path):
    write_track(tmp_path / "crowdht21", "a", 0, {0: WHOLE}, video="ht21-12")
    write_track(tmp_path / "crowdht21", "b", 1, {0: WHOLE}, video="ht21-12b", track_id=0)
    write_track(tmp_path / "posetrack", "c", 0, {0: WHOLE}, video="060470979_body")
    write_track(tmp_path / "posetrack", "d", 0, {0: WHOLE}, video="060470979_head", category="head")
    source = open_set("tracks", tmp_path)
    assert [len(source.distractors(i)) for i in range(4)] == [1, 1, 0, 0]
    body, head = (set(source.track(i).scene_ids) for i in (2, 3))
    assert body & head


def test_videos_are_named_with_their_set(folders):
    names = ("walkers/park", "walkers/street")
    assert list_videos(folders) == list_videos(folders / "walkers") == names
    assert len(open_set("tracks", folders, without=("walkers/park",))) == 1
    assert len(open_set("tracks", folders, only=("walkers/p*",))) == 5
    assert len(open_set("tracks", folders / "walkers", only=("walkers/street",))) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("{", "is not valid JSON"),
        ("[]", "does not name the video"),
        ({"frames": [0]}, "3 images, but not as many frames"),
        ({"frames": [0, 1, "2"]}, "frames are not whole numbers"),
        ({"crop_windows_x0y0x1y1_scale": [[0, 0, 9, 9]] * 3}, "is not a region"),
        ({"crop_windows_x0y0x1y1_scale": [[0, 0, 0, 9, 1]] * 3}, "without area"),
        ({"crop_windows_x0y0x1y1_scale": [[0, 0, 9, 9, float("nan")]] * 3}, "without area"),
        ({"distractors": [[None, [1, 2, 3, 0], None]]}, "not lists of boxes"),
        ({"distractors": [[None, "word", None]]}, "not lists of boxes"),
        ({"distractors": [[None, None]]}, "not as many boxes of a distractor"),
    ],
    ids=[
        *("no json", "a list", "few frames", "words", "few numbers", "no area", "nan"),
        *("no size", "no box", "few boxes"),
    ],
)
def test_damaged_folders_are_reported(tmp_path, change, message, caplog):
    sets = tmp_path / "walkers"
    meta = write_track(sets, "bad", 0, dict.fromkeys(range(3), WHOLE)) / "meta.json"
    content = json.loads(meta.read_text())
    meta.write_text(change if isinstance(change, str) else json.dumps(content | change))
    with pytest.raises(DatasetError, match=rf"meta\.json.*{message}"):
        open_set("tracks", tmp_path)
    for number in range(10):
        write_track(sets, f"good{number}", 0, {0: WHOLE})
    with caplog.at_level(logging.WARNING):
        assert len(open_set("tracks", tmp_path)) == 10
    assert "1 of 11" in caplog.text


def test_only_tracks_are_interpolated():
    for layout, frames in (("got10k", 5), ("tracks", -1), ("tracks", 5000)):
        with pytest.raises(ArgumentError, match="interpolate"):
            SourceSettings(layout, "x", interpolate=frames)


def test_the_shared_tracks(shared):
    folder = shared("data/training/tracks")
    assert len(list_videos(folder)) == 154
    plain, filled = (open_set("tracks", folder, interpolate=n) for n in (0, 20))
    assert len(plain) == len(filled) == 575
    counts = [
        sum(box is not None for i in range(575) for own in distractor_boxes(s, i) for box in own)
        for s in (plain, filled)
    ]
    assert counts[0] > 5000
    assert counts[1] > 2 * counts[0]


def test_mapped_boxes_show_the_same_object_as_its_own_folder(shared):
    source = open_set("tracks", shared("data/training/tracks"), only=("mot17mini/MOT17-02",))
    frames = [
        json.loads((source.track(i).folder / "meta.json").read_text())["frames"]
        for i in range(len(source))
    ]
    correlations = {0.0: [], 0.5: []}  # by shift, in widths
    for i, own in enumerate(frames):
        own_patches = [
            patch(source.track(j).image(t), source.track(j).box(t))
            for j, known in enumerate(frames)
            for t, frame in enumerate(known)
            if j != i and frame == own[0]
        ]
        for mapped in map(source.track, source.distractors(i)):
            if mapped.box(0) is not None:
                x, y, w, h = mapped.box(0)
                for shift, found in correlations.items():
                    mapped_patch = patch(mapped.image(0), (x + shift * w, y, w, h))
                    found.append(max(float((mapped_patch * each).mean()) for each in own_patches))
    assert len(correlations[0]) > 100
    assert np.median(correlations[0]) > 0.9
    assert np.median(correlations[0.5]) < 0.8


def patch(image, xywh):
    """The content of a box: 12 x 24 px with mean 0 and standard deviation 1."""
    x, y, w, h = xywh
    image_from_patch = np.array([[w / 12, 0, x], [0, h / 24, y]])
    pixels = cv2.warpAffine(
        image, image_from_patch, (12, 24), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    ).astype(float)
    return (pixels - pixels.mean()) / max(pixels.std(), 1e-9)


def test_given_boxes_of_distractors_replace_mapped_ones(folders):
    meta = folders / "walkers/park_id001_s0/meta.json"
    content = json.loads(meta.read_text()) | {"distractors": [[[1, 2, 3, 4], None]]}
    meta.write_text(json.dumps(content))
    source = open_set("tracks", folders)
    i = track_of(source, "park_id001_s0")
    assert distractor_boxes(source, i) == [[(1, 2, 3, 4), None]]
    assert source.track(source.distractors(i)[0]).scene_ids == source.track(i).scene_ids
