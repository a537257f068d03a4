"""`ssiam train --pack`: what is read from a pack is what its sources show."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers import toy_training as toy  # noqa: E402
from helpers.sets_on_disk import BOX, OTHER, write_coco, write_davis  # noqa: E402
from helpers.shaky_dataset import write_dataset  # noqa: E402
from helpers.track_sets import write_walkers  # noqa: E402
from ssiam.cli import main  # noqa: E402
from ssiam.errors import ArgumentError  # noqa: E402
from ssiam.geometry import iou  # noqa: E402
from ssiam.training import PairSampler, PairSettings, SourceSettings  # noqa: E402
from ssiam.training.checkpoints import read_checkpoint  # noqa: E402
from ssiam.training.config import config_text, read_config  # noqa: E402
from ssiam.training.data.registry import open_training_source  # noqa: E402
from ssiam.training.pack import write_pack  # noqa: E402
from ssiam.training.settings import HeldOut, NetworkSettings, ValidationSettings  # noqa: E402
from ssiam.training.validation import held_out_sequences  # noqa: E402

MEGABYTES = 8.0


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sets")
    square = {"segmentation": [[60, 50, 100, 50, 100, 80, 60, 80]]}
    annotations = [
        {"image_id": number, "bbox": list(box), **more}
        for number in (1, 2)
        for box, more in ((BOX, square), (OTHER, {}))
    ]
    write_davis(folder / "davis", frames=4)
    write_davis(folder / "davis", "cow", hidden=(1,))
    sources = (
        SourceSettings("davis", str(folder / "davis")),
        SourceSettings("coco", str(write_coco(folder / "coco", annotations, count=2)), 0.5),
        SourceSettings("tracks", str(write_walkers(folder / "tracks")), 3.0, alike=True),
    )
    held_out = HeldOut(str(write_dataset(folder / "held_out", 2, 6)), name="clips")
    return toy.settings(
        toy.weights_file(folder),
        sources=sources,
        steps=1,
        workers=0,
        pairs=PairSettings(reach=2),
        validation=ValidationSettings((held_out,), every=1, frames=4),
    )


@pytest.fixture(scope="module")
def pack(settings, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pack")
    write_pack(settings, folder, MEGABYTES)
    return folder


def packed_sources(pack):
    packed = read_config(pack / "config.toml").located(pack)
    return {each.layout: open_training_source(each) for each in packed.sources}


def bright_box(image, xywh):
    """The bounding box of the bright pixels in and around a box."""
    x, y, w, h = xywh
    x0, y0 = max(round(x - w / 4), 0), max(round(y - h / 4), 0)
    x1, y1 = round(x + 1.25 * w), round(y + 1.25 * h)
    bright = cv2.cvtColor(image[y0:y1, x0:x1], cv2.COLOR_BGR2GRAY) > 95
    left, top, width, height = cv2.boundingRect(bright.astype(np.uint8))
    return x0 + left, y0 + top, width, height


def test_all_data_of_small_sets_is_packed(pack):
    sources = packed_sources(pack)
    assert {layout: len(each) for layout, each in sources.items()} == {
        "youtube_vos": 2,
        "coco": 4,
        "tracks": 6,
    }
    assert {each.track(0).frames for each in sources.values()} >= {1, 4}
    assert [each.weight for each in sources.values()] == [1.0, 0.5, 3.0]
    assert [each.alike for each in sources.values()] == [False, False, True]


@pytest.mark.parametrize("layout", ["youtube_vos", "coco", "tracks"])
def test_boxes_and_masks_are_on_the_objects(pack, layout):
    source = packed_sources(pack)[layout]
    indices = set(range(len(source)))
    indices |= {j for i in indices for j in source.distractors(i)}
    seen = masks = 0
    for track in map(source.track, indices):
        for t in range(track.frames):
            box, image = track.box(t), track.image(t)
            if box is None or min(box[:2]) < 0:
                continue  # hidden, or cut off by the edge of the crop
            if box[0] + box[2] > image.shape[1] or box[1] + box[3] > image.shape[0]:
                continue
            assert iou(box, bright_box(image, box)) > 0.8
            seen += 1
            mask = track.mask(t)
            if mask is not None:
                masks += 1
                assert image[mask].mean() > 150
    assert seen > 1
    assert (masks > 0) == (layout != "tracks")


def test_other_objects_stay_distractors(pack, settings):
    sources = packed_sources(pack)
    original = open_training_source(settings.sources[2])
    folders = sorted((pack / "source02_boxes/tracks").iterdir())
    assert len(folders) == len(original)
    for i, folder in enumerate(folders):
        index = json.loads((folder / "meta.json").read_text())["track_id"]
        ours, theirs = (
            len(source.distractors(j)) for source, j in ((sources["tracks"], i), (original, index))
        )
        assert (theirs > 0) <= ours <= theirs  # some are outside of the smaller crops
    assert all(len(sources["coco"].distractors(i)) == 1 for i in range(4))


def test_tracks_of_a_video_stay_one_scene(pack):
    tracks = packed_sources(pack)["tracks"]
    scenes = [tracks.track(i).scene_ids[-1] for i in range(len(tracks))]
    assert sorted(map(scenes.count, set(scenes))) == [1, 5]


def test_pairs_are_those_of_the_sources(pack, settings):
    packed = read_config(pack / "config.toml").located(pack)
    sizes = []
    for each in (settings, packed):
        sources = [open_training_source(source) for source in each.sources]
        batch = PairSampler(sources, each.pairs, 0).batch(0, 60)
        assert 0.7 < batch.present.mean() <= 1
        sizes.append(np.median(np.sqrt(np.prod(batch.box[batch.present, 2:], axis=1))))
    assert sizes[1] == pytest.approx(sizes[0], rel=0.1)


def test_held_out_sequences_keep_their_motion(pack, settings):
    (table,) = read_config(pack / "config.toml").located(pack).validation.held_out
    assert table.name == "clips"
    ours = {each.name: each for each in held_out_sequences(table)}
    for theirs in held_out_sequences(settings.validation.held_out[0]):
        own = ours.pop(theirs.name)
        assert len(own) == 4
        moved, expected = (np.array(each.box(3)) - each.box(0) for each in (own, theirs))
        np.testing.assert_allclose(moved, expected, atol=0.1)
    assert not ours


@pytest.mark.parametrize("more", [0.05, 0.1, 0.3])
def test_the_limit_is_kept(settings, tmp_path, more):
    least = settings.network.begin_path.stat().st_size / 1e6
    done = write_pack(settings, tmp_path / "pack", least + more)
    size = sum(path.stat().st_size for path in (tmp_path / "pack").rglob("*") if path.is_file())
    assert size == done.size <= (least + more) * 1e6
    assert done.crops


@pytest.mark.parametrize(
    ("megabytes", "message"),
    [(0, "give more than 0"), (float("nan"), "give more than 0"), (0.1, "weights alone")],
)
def test_a_limit_that_is_too_small(settings, tmp_path, megabytes, message):
    with pytest.raises(ArgumentError, match=message) as caught:
        write_pack(settings, tmp_path / "pack", megabytes)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "pack").exists()


def test_a_folder_with_files_is_refused(settings, pack):
    with pytest.raises(ArgumentError, match="is not empty"):
        write_pack(settings, pack, MEGABYTES)


def test_the_mask_network_has_no_pack(settings, tmp_path):
    mask = replace(settings, network=NetworkSettings("mask"))
    with pytest.raises(ArgumentError, match="kind"):
        write_pack(mask, tmp_path / "pack", MEGABYTES)


def test_a_config_is_written_and_read(settings, tmp_path, request):
    shipped = request.config.rootpath / "configs/lite_shipped/tracker.toml"
    for each in (settings, read_config(shipped)):
        (tmp_path / "config.toml").write_text(config_text(each))
        assert read_config(tmp_path / "config.toml") == each


def test_a_pack_trains_anywhere(settings, tmp_path, monkeypatch, capsys):
    (tmp_path / "config.toml").write_text(config_text(settings))
    here, there = tmp_path / "here", tmp_path / "there"
    arguments = ["train", str(tmp_path / "config.toml"), "--pack", str(here)]
    assert main([*arguments, "--megabytes", str(MEGABYTES)]) == 0
    assert "2 held-out sequences" in capsys.readouterr().out
    here.rename(there)
    monkeypatch.chdir(tmp_path.parent)
    assert main(["train", str(there / "config.toml"), "--out", str(tmp_path / "run")]) == 0
    assert "clips success" in capsys.readouterr().out
    there.rename(here)  # the run is the same one wherever the pack is
    assert read_checkpoint(tmp_path / "run", read_config(here / "config.toml"))["step"] == 1
