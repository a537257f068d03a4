"""``--static-area`` of `ssiam track` and `ssiam live`: what moves with the camera."""

import os
import re
import shlex
import struct
import zlib

import cv2
import numpy as np
import pytest

from helpers.own_vehicle import HOOD, HOOD_XYWH, SHIFT, SIZE, frames
from helpers.tracked_clip import box_of, rows_of
from ssiam.cli import main
from ssiam.video import VideoSink, open_source

BOX = ("--box", "280,60,40,40", "--tracker", "kcf")
AREA = ("--static-area", box_of(HOOD_XYWH))
COUNT = 4


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("hood") / "clip.mp4"
    with VideoSink(path, 30) as sink:
        for frame in frames(COUNT):
            sink.write(frame)
    os.utime(path, (0, 0))  # written long ago, for live --headless
    return str(path)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with images of areas and files that are none."""
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("hood.png", np.where(HOOD, 7, 0).astype(np.uint8))
    cv2.imwrite("color.png", np.where(HOOD[..., None], [9, 0, 0], 0).astype(np.uint8))
    cv2.imwrite("small.png", np.zeros((180, 320), np.uint8))
    cv2.imwrite("white.png", np.full(SIZE[::-1], 255, np.uint8))
    (tmp_path / "text.png").write_text("not an image")
    (tmp_path / "bomb.png").write_bytes(bomb())
    return tmp_path


def bomb():
    """The head of a PNG of 100,000 x 100,000 pixels."""
    data = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 0, 0, 0, 0)
    check = struct.pack(">I", zlib.crc32(b"IHDR" + data))
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", len(data)) + b"IHDR" + data + check


def shifts(path):
    """Camera motion to the right in each frame after the first one."""
    return [float(row["dx"]) for row in rows_of(path)[1:]]


EVERY = pytest.approx([SHIFT, -SHIFT, SHIFT], abs=0.5)


@pytest.mark.parametrize(
    "area",
    [
        pytest.param(AREA, id="box"),
        pytest.param(("--static-area", "@hood.png"), id="image"),
        pytest.param(("--static-area", "@color.png"), id="color image"),
        pytest.param(
            ("--static-area", "-5,150,300,210", "--static-area", "290,150,999,999.5"), id="two"
        ),
        pytest.param(
            ("--static-area", "40,150,300,210", "--static-area", "@hood.png"), id="box and image"
        ),
        pytest.param((*AREA, "--stabilize", "paper", "--keypoints", "gftt"), id="keypoints"),
    ],
)
def test_areas_are_left_out_of_the_motion(clip, folder, area):
    assert main(["track", clip, *BOX, *area, "--results", "r.csv", "-q"]) == 0
    assert shifts(folder / "r.csv") == EVERY


def test_without_it_the_hood_is_taken_for_the_scene(clip, folder):
    assert main(["track", clip, *BOX, "--results", "r.csv", "-q"]) == 0
    assert shifts(folder / "r.csv") != EVERY


def test_backward_and_the_video_leave_the_areas_out_too(clip, folder, capsys):
    view = ("--view", "stabilized", "--crop", "none", "--out", "o.mp4")
    for area in (AREA, ()):
        done = main(
            ["track", clip, *BOX, *area, *view, "--backward", "--results", "r.csv", "--overwrite"]
        )
        assert done == 0
        assert (shifts(folder / "r.csv") == EVERY) == bool(area)
        shake = re.search(r"the raw frame by ([\d.]+) px", capsys.readouterr().out)[1]
        assert (float(shake) > SHIFT / 2) == bool(area)


def test_live_leaves_the_areas_out(clip, folder):
    live = ("live", clip, "--headless", "--pace", "fast", *BOX, "--results", "r.csv")
    assert main([*live, *AREA]) == 0
    assert shifts(folder / "r.csv")[-1] == pytest.approx(SHIFT, abs=0.5)


def test_pick_proposes_nothing_there_and_prints_the_areas(clip, capsys):
    assert main(["track", clip, "--pick", *AREA]) == 0
    lines = [line.split("#")[0] for line in capsys.readouterr().out.splitlines() if "  # " in line]
    for line in lines:
        words = shlex.split(line)
        assert words[3:5] == list(AREA)
        x, y, w, h = map(float, words[-1].split(","))
        assert not HOOD[round(y + h / 2), round(x + w / 2)]


REFUSALS = [
    pytest.param("1,2,3", "'1,2,3' is not an area: give x,y,width,height", id="three numbers"),
    pytest.param("hood.png", "'hood.png' is not an area", id="file without @"),
    pytest.param("1,2,0,9", "'1,2,0,9' is empty", id="zero width"),
    pytest.param("1,2,nan,9", "'1,2,nan,9' is empty or not finite", id="nan"),
    pytest.param("1e308,2,1e308,9", "is empty or not finite", id="endless"),
    pytest.param("640,0,9,9", "640,0,9,9 is outside of the frame of 640x360 pixels", id="outside"),
    pytest.param("-9,0,9,9", "-9,0,9,9 is outside", id="outside on the left"),
    pytest.param("0,0,1e300,9e300", "covers the whole frame", id="whole frame"),
    pytest.param("@white.png", "covers the whole frame", id="white image"),
    pytest.param(
        "@small.png", "@small.png: has 320x180 pixels: give an image of 640x360", id="other size"
    ),
    pytest.param("@text.png", "@text.png: is not an image", id="text"),
    pytest.param("@missing.png", "@missing.png: is not an image", id="missing"),
    pytest.param("@.", "@.: is not an image", id="folder"),
    pytest.param("@bomb.png", "@bomb.png: has 100000x100000 pixels, more than", id="bomb"),
    pytest.param("@pipe", "@pipe: is not an image", id="pipe"),
]


@pytest.mark.parametrize(("area", "named"), REFUSALS)
@pytest.mark.parametrize("command", ["track", "live"])
def test_other_areas_are_refused(clip, folder, command, area, named, capsys):
    os.mkfifo("pipe")
    before = sorted(folder.iterdir())
    ends = {"track": ("-q",), "live": ("--headless",)}[command]
    words = [command, clip, *BOX, "--static-area", area, "--results", "r.csv", *ends]
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("ssiam: --static-area ")
    assert named in captured.err
    assert captured.err.count("\n") == 1
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("more", [("--pick",), ("--backward", *BOX), ()])
def test_every_way_of_tracking_refuses_them(clip, more, capsys):
    assert main(["track", clip, *more, "--static-area", "@small.png"]) == 2
    assert "@small.png: has 320x180 pixels" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["track", "live"])
def test_an_area_is_no_output(clip, folder, command, capsys):
    ends = {"track": ("-q",), "live": ("--headless",)}[command]
    (folder / "area.csv").write_bytes((folder / "hood.png").read_bytes())
    words = [command, clip, *BOX, "--static-area", "@area.csv", "--results", "area.csv"]
    assert main([*words, "--overwrite", *ends]) == 2
    assert "area.csv" in capsys.readouterr().err
    assert len(list(open_source(clip))) == COUNT
