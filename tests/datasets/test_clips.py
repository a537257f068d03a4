"""User clips with a box file, and the frames of a `VideoSequence`."""

from __future__ import annotations

from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from helpers.datasets_on_disk import boxes, gray_image, number_in, text, write_images, write_otb
from ssiam.datasets import DatasetError, VideoSequence, open_dataset, read_image
from ssiam.errors import SourceError


def _write_video(path, count):
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=Fraction(25))
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(count):
            image = gray_image(number + 1).repeat(6, axis=0).repeat(8, axis=1)[:48, :64]
            frame = av.VideoFrame.from_ndarray(image, format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("rows", [1, 6], ids=["first box", "every box"])
def test_video(tmp_path, rows):
    video = _write_video(tmp_path / "my walk.mp4", 6)
    (tmp_path / "my walk.txt").write_text(text(boxes(rows), "\t"))
    for path in (video, tmp_path):
        dataset = open_dataset(path)
        assert (dataset.kind, list(dataset.sequences)) == ("clip", ["my walk"])
    sequence = dataset.sequences["my walk"]
    assert (len(sequence), len(sequence.truth)) == (6, rows)
    assert [number_in(image) for image in sequence.images(2)] == [3, 4, 5, 6]
    assert sequence.box(0) == (1, 10, 5, 6)


def test_a_video_with_too_few_frames_is_an_error(tmp_path):
    video = _write_video(tmp_path / "walk.mp4", 4)
    (tmp_path / "walk.txt").write_text(text(boxes(6)))
    sequence = open_dataset(video).sequences["walk"]
    with pytest.raises(SourceError, match=r"ends before frame 5 \(from 0\)"):
        list(sequence.images())


def test_part_of_a_video(tmp_path):
    video = _write_video(tmp_path / "walk.mp4", 8)
    sequence = VideoSequence("part", video, boxes(3), first=4)
    assert [number_in(image) for image in sequence.images()] == [5, 6, 7]
    assert [number_in(image) for image in sequence.images(1)] == [6, 7]


def test_a_video_without_boxes_is_an_error(tmp_path):
    with pytest.raises(DatasetError, match=r"write x,y,width,height into walk\.txt"):
        open_dataset(_write_video(tmp_path / "walk.mp4", 2))


@pytest.mark.parametrize("rows", [1, 4], ids=["first box", "every box"])
@pytest.mark.parametrize("location", ["inside", "beside"])
def test_folder_of_images(tmp_path, rows, location):
    folder = tmp_path / "mine"
    write_images(folder, range(1, 5), 3, ".png")
    target = folder / "my boxes.txt" if location == "inside" else tmp_path / "mine.txt"
    target.write_text(text(boxes(rows)))
    dataset = open_dataset(folder)
    assert dataset.kind == "clip"
    sequence = dataset.sequences["mine"]
    assert (len(sequence), len(sequence.truth)) == (4, rows)
    assert [number_in(image) for image in sequence.images()] == [1, 2, 3, 4]


def test_a_readme_beside_images_is_not_a_box_file(tmp_path):
    write_otb(tmp_path, "Walking", range(1, 4), boxes(3))
    write_images(tmp_path, [1], 1)
    (tmp_path / "README.txt").write_text("About these images")
    assert open_dataset(tmp_path).kind == "otb"


DAMAGED = [
    ("missing", None, "does not exist"),
    ("empty", b"", "not an image that can be read"),
    ("text", b"<html>", "not an image that can be read"),
    ("truncated", b"\xff\xd8\xff\xe0\x00\x10JFIF", "not an image that can be read"),
]


@pytest.mark.parametrize(
    ("content", "message"), [r[1:] for r in DAMAGED], ids=[r[0] for r in DAMAGED]
)
def test_a_damaged_image_is_an_error(tmp_path, content, message):
    write_images(tmp_path, range(1, 4), 4)
    frames = tuple(sorted(tmp_path.iterdir()))
    frames[1].unlink()
    if content is not None:
        frames[1].write_bytes(content)
    images = VideoSequence("s", frames, boxes(3)).images()
    assert number_in(next(images)) == 1
    with pytest.raises(SourceError, match=f"0002.jpg: .*{message}"):
        next(images)


def test_gray_images_are_returned_as_bgr(tmp_path):
    path = tmp_path / "größe.png"
    path.write_bytes(cv2.imencode(".png", np.full((4, 5), 7, np.uint8))[1].tobytes())
    assert read_image(path).tolist() == np.full((4, 5, 3), 7).tolist()


def _thermal(number):
    noise = np.random.default_rng(number).integers(0, 1300, (12, 16))
    return (7000 + noise).astype(np.uint16)


def test_16_bit_images_use_the_same_levels_from_any_start(tmp_path):
    for number in range(12):
        image = cv2.resize(_thermal(number), (64, 48), interpolation=cv2.INTER_NEAREST)
        image[40:, 50:] = 30000 if number >= 9 else image[40:, 50:]
        cv2.imwrite(str(tmp_path / f"{number:02}.png"), image)
    paths = tuple(sorted(tmp_path.glob("*.png")))
    sequence = VideoSequence("thermal", paths, np.zeros((12, 4)))
    whole = list(sequence.images())
    assert np.ptp(whole[0]) > 150
    for start in (1, 10):
        for image, repeated in zip(whole[start:], sequence.images(start), strict=True):
            assert np.array_equal(image, repeated)
    assert np.ptp(read_image(paths[0])) > 150


def test_a_frame_that_cannot_be_decoded_is_an_error(tmp_path):
    path = tmp_path / "walk.mov"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        for number in range(12):
            image = gray_image(number + 1).repeat(6, axis=0).repeat(8, axis=1)[:48, :64]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    with av.open(str(path)) as container:
        packet = [packet for packet in container.demux(video=0) if packet.size][5]
    data = bytearray(path.read_bytes())
    data[packet.pos : packet.pos + packet.size] = bytes(packet.size)
    path.write_bytes(data)
    sequence = VideoSequence("walk", path, np.zeros((11, 4)))
    with pytest.raises(SourceError, match=r"cannot be decoded, so that boxes and frames"):
        list(sequence.images())
