"""`ssiam track --pick`: an image with numbered proposals, and commands that work as printed."""

import shlex
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.tracked_clip import rows_of
from ssiam.cli import main
from ssiam.geometry import iou

EXAMPLE = Path(__file__).parents[2] / "examples" / "shaky-walker.mp4"
TRUTH = [
    tuple(map(float, line.split(",")))
    for line in EXAMPLE.with_suffix(".txt").read_text().splitlines()
]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(EXAMPLE, "my clip.mp4")
    return tmp_path


def commands(output):
    """The words of each printed command, by the number of its proposal."""
    lines = [line.split("#") for line in output.splitlines() if "  # " in line]
    return {int(number): shlex.split(line) for line, number in lines}


def box_of(words):
    return tuple(map(float, words[words.index("--box") + 1].split(",")))


def overlap(box, truth):
    return float(np.ravel(iou(box, truth))[0])


def test_the_printed_line_tracks_the_walker(folder, capsys):
    assert main(["track", "my clip.mp4", "--pick"]) == 0
    output = capsys.readouterr().out
    assert output.startswith("my clip-pick.png: frame 0 with 9 proposals")
    assert [path.name for path in folder.iterdir() if path.suffix != ".mp4"] == ["my clip-pick.png"]
    image = cv2.imread("my clip-pick.png")
    assert image.shape == (360, 640, 3)
    by_number = commands(output)
    assert list(by_number) == list(range(1, 10))
    words = max(by_number.values(), key=lambda words: overlap(box_of(words), TRUTH[0]))
    assert words[:3] == ["ssiam", "track", "my clip.mp4"]
    assert main([*words[1:], "--results", "r.csv", "--end", "30"]) == 0
    last = rows_of(folder / "r.csv")[-1]
    assert overlap([float(last[key]) for key in "xywh"], TRUTH[30]) > 0.3


def test_boxes_of_a_later_frame_are_tracked_from_there(folder, capsys):
    assert main(["track", "my clip.mp4", "--pick", "--start", "0:01.2"]) == 0
    output = capsys.readouterr().out
    assert "frame 30 with" in output
    words = max(commands(output).values(), key=lambda words: overlap(box_of(words), TRUTH[30]))
    assert overlap(box_of(words), TRUTH[30]) > 0.6
    assert words[3:5] == ["--start", "0:01.2"]
    assert main([*words[1:], "--results", "r.csv", "--end", "35"]) == 0
    assert rows_of(folder / "r.csv")[0]["frame"] == "30"


def test_images_are_numbered_and_never_replaced(folder, capsys):
    (folder / "my clip-pick.png").write_text("mine")
    assert main(["track", "my clip.mp4", "--pick", "--start", "110"]) == 0
    assert (folder / "my clip-pick.png").read_text() == "mine"
    assert cv2.imread("my clip-pick-2.png") is not None


def test_a_frame_in_which_nothing_stands_out(folder, capsys):
    (folder / "gray").mkdir()
    cv2.imwrite("gray/1.png", np.full((48, 64, 3), 90, np.uint8))
    assert main(["track", "gray", "--pick"]) == 0
    output = capsys.readouterr().out
    assert "nothing stands out" in output
    assert output.splitlines()[-1] == "  ssiam track gray --box x,y,width,height"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("missing.mp4", "--pick"), "missing.mp4", id="no source"),
        pytest.param(("my clip.mp4", "--pick", "--start", "999"), "117 frames", id="late"),
        pytest.param(("my clip.mp4", "--pick", "--box", "1,2,3,4"), "--pick", id="and a box"),
        pytest.param(("my clip.mp4",), "--pick proposes", id="neither, names pick"),
        pytest.param(("my clip.mp4",), "--box x,y,width,height", id="neither, names box"),
        pytest.param(("my clip.mp4", "--box", "1,2,3"), "--pick", id="no box"),
    ],
)
def test_refusals_name_both_ways_and_write_nothing(folder, capsys, arguments, named):
    assert main(["track", *arguments]) == 2
    captured = capsys.readouterr()
    assert named in captured.err
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert [path.name for path in folder.iterdir()] == ["my clip.mp4"]


def test_an_image_folder_does_not_get_the_image(folder, monkeypatch, capsys):
    (folder / "shots").mkdir()
    monkeypatch.chdir(folder / "shots")
    cv2.imwrite("1.png", np.full((48, 64, 3), 90, np.uint8))
    assert main(["track", "../shots", "--pick"]) == 2
    assert "would be read as a frame" in capsys.readouterr().err
