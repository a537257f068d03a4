"""`predict` as Label Studio's ML backend calls it, on real clips."""

import copy
import json

import pytest

import ssiam
from helpers.tracked_clip import COUNT, SIZE, write_clip
from ssiam.errors import ArgumentError, SourceError
from ssiam.integrations import LabelStudioBackend


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip.mp4"
    return path, write_clip(path)


@pytest.fixture
def backend():
    return LabelStudioBackend(ssiam.load_tracker("kcf"))


def keyframe(frame, xywh, *, enabled=True):
    names = ("x", "y", "width", "height")
    percent = [100 * v / side for v, side in zip(xywh, (*SIZE, *SIZE), strict=True)]
    item = {"frame": frame + 1, "enabled": enabled, "rotation": 0, "time": (frame + 1) / 29.97}
    return item | dict(zip(names, percent, strict=True))


def region(*sequence, name="abc"):
    """As Label Studio sends one: https://labelstud.io/tags/videorectangle."""
    return {
        "id": name,
        "type": "videorectangle",
        "from_name": "box",
        "to_name": "video",
        "origin": "manual",
        "value": {"framesCount": 0, "duration": 0, "labels": ["boat"], "sequence": list(sequence)},
    }


def boxes(result):
    """Boxes of a result by frame, in pixels."""
    return {
        item["frame"] - 1: [
            item[name] / 100 * side
            for name, side in zip(("x", "y", "width", "height"), (*SIZE, *SIZE), strict=True)
        ]
        for item in result["value"]["sequence"]
    }


def task(clip, **more):
    return {"id": 7, "data": {"video": str(clip)}, **more}


def test_a_drawn_box_is_tracked_to_the_end(backend, clip):
    path, truth = clip
    drawn = region(keyframe(5, truth[5]))
    (prediction,) = backend.predict([task(path)], {"result": [drawn]}, extra=1)
    json.dumps(prediction, allow_nan=False)
    assert set(prediction) == {"model_version", "score", "result"}
    assert 0 < prediction["score"] <= 1
    (result,) = prediction["result"]
    kept = ("id", "type", "from_name", "to_name", "origin")
    assert {name: result[name] for name in kept} == {name: drawn[name] for name in kept}
    assert result["value"]["labels"] == ["boat"]
    assert result["value"]["framesCount"] == COUNT
    found = boxes(result)
    assert list(found) == list(range(5, COUNT))
    assert found[5] == pytest.approx(truth[5], abs=1e-3)
    for frame, box in found.items():
        assert box[:2] == pytest.approx(truth[frame][:2], abs=10)
    for item in result["value"]["sequence"]:
        assert item["enabled"] is True
        assert set(item) >= {"frame", "enabled", "x", "y", "width", "height", "rotation", "time"}


def test_only_what_was_changed_since_the_last_prediction_is_a_keyframe(backend, clip):
    path, truth = clip
    (first,) = backend.predict([task(path)], {"result": [region(keyframe(0, truth[0]))]})
    changed = copy.deepcopy(first["result"][0])
    large = (truth[20][0] - 6, truth[20][1] - 6, truth[20][2] + 12, truth[20][3] + 12)
    changed["value"]["sequence"][20] |= keyframe(20, large)
    (second,) = backend.predict([task(path)], {"result": [changed]})
    before, after = boxes(first["result"][0]), boxes(second["result"][0])
    assert after[19] == pytest.approx(before[19], abs=1e-3)
    assert after[20] == pytest.approx(large, abs=1e-3)
    assert after[30][2] > before[30][2] + 6  # tracked again with the new size


def test_a_target_that_ends_begins_again_at_its_next_keyframe(backend, clip):
    path, truth = clip
    drawn = region(keyframe(0, truth[0], enabled=False), keyframe(12, truth[12]))
    (prediction,) = backend.predict([task(path)], {"result": [drawn]})
    sequence = prediction["result"][0]["value"]["sequence"]
    assert [item["frame"] - 1 for item in sequence] == [0, *range(12, COUNT)]
    assert sequence[0]["enabled"] is False


def test_regions_of_the_last_annotation_without_a_context(backend, clip):
    path, truth = clip
    two = [region(keyframe(0, truth[0])), region(keyframe(8, truth[8]), name="def")]
    label = {"id": "x", "type": "labels", "value": {}}
    given = task(path, annotations=[{"result": []}, {"result": [label, *two]}])
    (prediction,) = backend.predict([given])
    assert [each["id"] for each in prediction["result"]] == ["abc", "def"]
    assert [min(boxes(each)) for each in prediction["result"]] == [0, 8]


def test_without_a_region_nothing_is_read(backend):
    (prediction,) = backend.predict([task("none.mp4")])
    assert prediction["result"] == []


def test_address_and_number_of_frames(clip):
    path, truth = clip
    seen = []

    def path_of(address, given):
        seen.append((address, given["id"]))
        return str(path)

    backend = LabelStudioBackend(
        ssiam.load_tracker("kcf"), path_of=path_of, video="clip", most_frames=10
    )
    given = {"id": 3, "data": {"clip": "s3://bucket/clip.mp4"}}
    (prediction,) = backend.predict([given], {"result": [region(keyframe(4, truth[4]))]})
    assert seen == [("s3://bucket/clip.mp4", 3)]
    assert list(boxes(prediction["result"][0])) == list(range(4, 14))


def test_errors_name_what_is_wrong(backend, clip):
    drawn = {"result": [region(keyframe(0, (1, 2, 30, 40)))]}
    with pytest.raises(ArgumentError, match="task 7 has no video"):
        backend.predict([{"id": 7, "data": {}}], drawn)
    with pytest.raises(SourceError, match=r"none\.mp4"):
        backend.predict([task("none.mp4")], drawn)
