"""Folders of images, and OpenCV captures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from helpers.video_clips import number_in, numbered_image, read_all, write_clip
from ssiam.errors import FrameSizeError, SourceError, StreamError
from ssiam.video import open_source
from ssiam.video.sources import open_capture


def _write_images(folder, names):
    folder.mkdir(exist_ok=True)
    for number, name in enumerate(names):
        cv2.imwrite(str(folder / name), numbered_image(number))


def test_natural_order_and_times(tmp_path):
    names = ["1.jpg", "2.jpg", "9.jpg", "10.jpg", "11.jpg", "100.jpg"]
    _write_images(tmp_path / "seq", names)
    with open_source(tmp_path / "seq") as source:
        assert source.length == 6
        assert source.fps == 30
        frames = list(source)
    assert [number_in(frame.image) for frame in frames] == list(range(6))
    assert [frame.time for frame in frames] == pytest.approx([i / 30 for i in range(6)])


@pytest.mark.parametrize("name", ["area2²{}.png", "1①{}.png", "٣{}.png", "{}१.png"])
def test_digits_of_other_scripts_are_letters(tmp_path, name):
    _write_images(tmp_path / "seq", [name.format(number) for number in range(3)])
    with open_source(tmp_path / "seq") as source:
        assert [number_in(frame.image) for frame in source] == [0, 1, 2]


def test_all_image_types_and_no_other_files(tmp_path):
    folder = tmp_path / "seq"
    _write_images(folder, ["1.JPG", "2.jpeg", "3.png", "4.bmp", "5.tif", "6.TIFF", "7.webp"])
    (folder / "groundtruth_rect.txt").write_text("1,2,3,4\n")
    (folder / "._1.jpg").write_bytes(b"resource fork")
    (folder / "thumbs.jpg").mkdir()
    with open_source(folder) as source:
        assert [number_in(frame.image) for frame in source] == list(range(7))


def test_unreadable_image_ends_the_source(tmp_path):
    folder = tmp_path / "seq"
    _write_images(folder, ["1.png", "2.png", "3.png", "4.png"])
    (folder / "3.png").write_bytes(b"not an image")
    with open_source(folder) as source:
        numbers, error = read_all(source)
    assert numbers == [0, 1]
    assert isinstance(error, StreamError)
    assert "after 2 of 4 frames: 3.png" in str(error)
    (folder / "1.png").write_bytes(b"")
    with pytest.raises(SourceError, match=r"1\.png: cannot be read as an image"):
        open_source(folder)


def test_frame_size_error_names_frame_and_size(tmp_path):
    folder = tmp_path / "seq"
    _write_images(folder, ["1.png", "2.png"])
    cv2.imwrite(str(folder / "3.png"), np.zeros((50, 70, 3), np.uint8))
    with open_source(folder) as source, pytest.raises(FrameSizeError, match=r"frame 2 .*70x50"):
        list(source)


def test_error_for_parent_folder_names_image_folder(tmp_path):
    _write_images(tmp_path / "img", ["1.jpg"])
    (tmp_path / "groundtruth_rect.txt").write_text("1,2,3,4\n")
    with pytest.raises(SourceError, match=r"did you mean .*img\?"):
        open_source(tmp_path)


def test_end_of_capture_is_a_stream_error(tmp_path):
    """A camera has no end; the end of a file simulates unplugging it."""
    path = write_clip(tmp_path / "camera.mp4", 8)
    times = []
    with open_capture("camera 0", cv2.VideoCapture(str(path))) as source:
        assert source.length is None
        assert float(source.fps) == pytest.approx(29.97, abs=0.01)
        with pytest.raises(StreamError, match="camera 0: broke off after 8 frames"):
            times.extend(frame.time for frame in source)
    exhausted = cv2.VideoCapture(str(path))
    while exhausted.read()[0]:
        pass
    with pytest.raises(SourceError, match="delivers no frame"):
        open_capture("camera 0", exhausted)
