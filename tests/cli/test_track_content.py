"""`ssiam track` with sound, streams, pixel aspect, 16 bits and variable frame rate."""

from __future__ import annotations

import json
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from helpers.odd_clips import (
    displayed_aspect,
    write_anamorphic,
    write_at_times,
    write_clip_with_sound,
    write_two_streams,
    write_undecodable,
    write_without_times,
)
from helpers.tracked_clip import rows_of
from ssiam.cli import main
from ssiam.video import open_source

BOX = ["--box", "60,40,30,30", "--tracker", "kcf"]


@pytest.fixture(autouse=True)
def in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_undecoded_frames_are_reported_with_exit_code_3(tmp_path, capsys):
    write_undecodable(tmp_path / "clip.mov", (10, 11, 25))
    assert main(["track", "clip.mov", *BOX]) == 3
    captured = capsys.readouterr()
    assert "source: 3 frames could not be decoded" in captured.out
    assert captured.err.count("\n") == 1
    assert "3 frames" in captured.err
    assert len(rows_of(tmp_path / "clip-tracked.csv")) == 37


def test_sound_is_copied(tmp_path, capsys):
    write_clip_with_sound(tmp_path / "clip.mp4")
    assert main(["track", "clip.mp4", *BOX]) == 0
    assert "sound" not in capsys.readouterr().out
    with av.open("clip-tracked.mp4") as container:
        assert float(container.streams.audio[0].duration) > 0


def test_omitted_sound_is_reported(tmp_path, capsys):
    write_clip_with_sound(tmp_path / "clip.mkv", "libopus")
    assert main(["track", "clip.mkv", *BOX, "--out", "o.mov"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "sound" in line]
    assert lines == [
        "  video: has no sound: .mov cannot hold opus as it is; .mkv holds most kinds",
    ]


def test_sound_is_ignored_without_a_video(tmp_path, capsys):
    write_clip_with_sound(tmp_path / "clip.mkv", "libopus")
    assert main(["track", "clip.mkv", *BOX, "--results", "r.csv"]) == 0
    assert "sound" not in capsys.readouterr().out


def test_pixel_aspect_is_kept(tmp_path):
    write_anamorphic(tmp_path / "dv.mp4", Fraction(16, 15))
    assert main(["track", "dv.mp4", *BOX, "--out", "o.mkv"]) == 0
    assert displayed_aspect("o.mkv") == displayed_aspect("dv.mp4")


def test_stream_option(tmp_path, capsys):
    write_two_streams(tmp_path / "two.mkv")
    for stream, size_wh in (([], (320, 192)), (["--stream", "0"], (128, 32))):
        box = ["--box", "10,5,20,20", "--tracker", "kcf"]
        assert main(["track", "two.mkv", *box, *stream, "--results", "r.csv", "--overwrite"]) == 0
        arguments = ["export", "r.csv", "--to", "coco", "--video", "two.mkv", *stream]
        assert main([*arguments, "--out", "o.json", "--overwrite"]) == 0
        image = json.loads((tmp_path / "o.json").read_text())["images"][0]
        assert (image["width"], image["height"]) == size_wh
    capsys.readouterr()
    assert main(["track", "two.mkv", *BOX, "--stream", "7"]) == 2
    assert "no video stream 7" in capsys.readouterr().err
    arguments = ["export", "r.csv", "--to", "coco", "--size", "9x9", "--fps", "9", "--stream", "1"]
    assert main([*arguments, "--out", "p.json"]) == 2
    assert "give --video too" in capsys.readouterr().err


def test_levels_option(tmp_path, capsys):
    (tmp_path / "thermal").mkdir()
    noise = np.random.default_rng(1).integers(0, 1500, (96, 160)).astype(np.uint16)
    for number in range(5):
        image = cv2.GaussianBlur(noise, (9, 9), 3) + 7000
        cv2.imwrite(f"thermal/{number}.png", np.roll(image, 2 * number, axis=1))
    assert main(["track", "thermal", *BOX, "--out", "o.mp4"]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "--levels" in line)
    given = line.split("--levels ")[1]
    with open_source("o.mp4") as source:
        assert next(source).image.std() > 20
    assert main(["track", "thermal", *BOX, "--out", "p.mp4", "--levels", given]) == 0
    assert "--levels" not in capsys.readouterr().out
    assert main(["track", "thermal", *BOX, "--out", "q.mp4", "--levels", "-9000,9000"]) == 0
    for bad in ("7000", "a,b", "9,1"):
        capsys.readouterr()
        assert main(["track", "thermal", *BOX, "--levels", bad]) == 2
        assert "levels" in capsys.readouterr().err


SECONDS = [*(0.04 * i for i in range(10)), *(0.36 + 0.16 * i for i in range(1, 11))]
SECONDS += [1.96 + 0.04 * i for i in range(1, 21)]


@pytest.mark.parametrize("name", ["v.mp4", "v.mkv"])
def test_label_studio_export_of_variable_rate(tmp_path, capsys, name):
    write_at_times(tmp_path / name, SECONDS)
    assert main(["track", name, *BOX, "--results", "v.csv"]) == 0
    capsys.readouterr()
    arguments = ["export", "v.csv", "--to", "labelstudio", "--video", name, "--out", "v.json"]
    assert main(arguments) == 0
    output = capsys.readouterr().out
    (task,) = json.loads((tmp_path / "v.json").read_text())
    value = task["predictions"][0]["result"][0]["value"]
    rate = value["framesCount"] / value["duration"]
    assert rate == pytest.approx(25)
    assert 'framerate="25"' in output or name == "v.mkv"  # which announces 25 itself
    assert value["duration"] == pytest.approx(SECONDS[-1] + 0.04, abs=0.05)
    for row, key in zip(rows_of(tmp_path / "v.csv"), value["sequence"], strict=True):
        seconds = (key["frame"] - 1) / rate
        assert seconds == pytest.approx(float(row["time"]), abs=0.005)


def test_variable_rate_to_avi(tmp_path):
    write_at_times(tmp_path / "v.mp4", SECONDS)
    arguments = ["track", "v.mp4", *BOX, "--out", "o.avi", "--results", "o.csv"]
    assert main(arguments) == 0
    with av.open("o.avi") as container:
        assert float(container.duration / av.time_base) == pytest.approx(2.8, abs=0.05)


def test_assumed_frame_rate_is_reported(tmp_path, capsys):
    write_without_times("clip.mjpeg")
    assert main(["track", "clip.mjpeg", *BOX, "--results", "r.csv"]) == 0
    assert "has no timestamps: assuming 25 frames per second" in capsys.readouterr().out
    assert {row["time"] for row in rows_of(tmp_path / "r.csv")} == {""}
