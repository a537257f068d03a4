"""`ssiam export`: arguments, files and errors."""

from __future__ import annotations

import json
from fractions import Fraction
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest

from helpers.video_clips import write_clip
from ssiam.cli import main
from ssiam.track import Track
from ssiam.video import open_results

FRAMES = [Track((10.0 + i, 20.0, 30.0, 40.0), 0.9, lost=i == 1) for i in range(3)]
PLAIN = ["--size", "160x96", "--fps", "25", "--out", "out"]
COCO = ["r.csv", "--to", "coco"]


def changed(**options):
    """`PLAIN` with some options replaced."""
    given = dict(zip(PLAIN[::2], PLAIN[1::2], strict=True))
    given |= {f"--{name}": value for name, value in options.items()}
    return [word for pair in given.items() for word in pair]


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with open_results("r.csv", targets=2) as sink:
        for index, track in enumerate(FRAMES):
            sink.write(index, index / 25, [track, track])
    return tmp_path / "r.csv"


def test_size_and_rate_from_video(tmp_path, capsys):
    write_clip(tmp_path / "clip.mp4", 3, rate=Fraction(30000, 1001))
    arguments = ["export", "r.csv", "--to", "labelstudio", "--video", "clip.mp4"]
    assert main([*arguments, "--out", "task.json", "--names", "boat, crew"]) == 0
    assert capsys.readouterr().out == "r.csv: 2 targets in 3 frames, written to task.json\n"
    (task,) = json.loads((tmp_path / "task.json").read_text())
    assert task["data"]["video"] == "clip.mp4"
    boat, crew = (result["value"] for result in task["predictions"][0]["result"])
    assert (boat["labels"], crew["labels"]) == (["boat"], ["crew"])
    assert boat["duration"] == pytest.approx(3 * 1001 / 30000, abs=1e-6)
    assert boat["sequence"][0]["x"] == pytest.approx(100 * 10 / 160)


def test_all_formats_from_size_and_rate(tmp_path):
    for kind in ("cvat", "coco", "labelstudio", "got10k"):
        arguments = ["export", "r.csv", "--to", kind, "--size", "160x96", "--fps", "30000/1001"]
        assert main([*arguments, "--out", f"out.{kind}"]) == 0
    size = ElementTree.parse("out.cvat").getroot().find("meta/task/original_size")
    assert [each.text for each in size] == ["160", "96"]
    assert len(json.loads((tmp_path / "out.coco").read_text())["annotations"]) == 4
    with ZipFile("out.got10k") as archive:
        assert archive.read("list.txt") == b"target_1\ntarget_2\n"
        assert b"anno_fps: 29.97Hz" in archive.read("target_1/meta_info.ini")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param(["r.csv", "--to", "voc", *PLAIN], "voc", id="unknown kind"),
        pytest.param(["r.csv", *PLAIN], "--to", id="no kind"),
        pytest.param(["none.csv", "--to", "coco", *PLAIN], "none.csv: cannot be read", id="absent"),
        pytest.param(
            ["damaged.csv", "--to", "coco", *PLAIN], "damaged.csv: line 1 has no", id="damaged"
        ),
        pytest.param([*COCO, "--out", "o"], "give either --video", id="no size"),
        pytest.param([*COCO, "--out", "o", "--size", "9x9"], "give either", id="no rate"),
        pytest.param([*COCO, "--video", "r.csv", *PLAIN], "give either", id="both"),
        pytest.param([*COCO, *changed(size="big")], "--size 'big' is not", id="bad size"),
        pytest.param([*COCO, *changed(size="0x9")], "is not positive", id="empty"),
        pytest.param([*COCO, *changed(fps="1/0")], "--fps '1/0' is not", id="bad rate"),
        pytest.param([*COCO, *PLAIN, "--names", "a"], "1 names for the 2", id="names"),
        pytest.param([*COCO, *changed(out="r.csv")], "is the file of results", id="same"),
        pytest.param([*COCO, *changed(out="no/o")], "there is no folder", id="no folder"),
        pytest.param(
            [*COCO, "--out", "o", "--video", "none.mp4"],
            "none.mp4: no such file",
            id="no video",
        ),
    ],
)
def test_wrong_arguments_give_one_line_error(results, capsys, arguments, message):
    before = results.read_bytes()
    (results.parent / "damaged.csv").write_text("<html>\n")
    assert main(["export", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert results.read_bytes() == before


def test_frames_of_hours_in_a_few_rows_need_an_option(tmp_path, capsys):
    row = (tmp_path / "r.csv").read_text().splitlines()[1].split(",")
    with (tmp_path / "r.csv").open("a") as file:
        file.write(",".join(["999999", *row[1:]]) + "\n")
    assert main(["export", "r.csv", "--to", "coco", *PLAIN]) == 2
    assert "1000000 frames: if the video has as many, give --max-frames" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert main(["export", "r.csv", "--to", "cvat", *PLAIN, "--max-frames", "1000000"]) == 0


def test_many_targets_of_few_rows_are_as_many_frames(tmp_path, capsys):
    row = (tmp_path / "r.csv").read_text().splitlines()[1].split(",")
    with (tmp_path / "r.csv").open("a") as file:
        for target in range(3, 20):
            file.write(",".join(["99998", row[1], str(target), *row[3:]]) + "\n")
    assert main(["export", "r.csv", "--to", "got10k", *PLAIN]) == 2
    assert "of 19 targets, but 99999 frames" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--fps", "--size"])
@pytest.mark.parametrize("value", ["1e99999999", "9" * 5000, f"{'9' * 400}x5", "0x5", "1/0"])
def test_endless_numbers(capsys, option, value):
    name = option.removeprefix("--")
    assert main(["export", *COCO, *changed(**{name: value})]) == 2
    assert len(capsys.readouterr().err) < 200


def test_file_names_that_xml_cannot_hold(tmp_path):
    name = "a\x01b\udce9.mp4"
    write_clip(tmp_path / name, 3)
    arguments = ["export", "r.csv", "--video", name]
    for kind in ("cvat", "coco", "labelstudio", "got10k"):
        assert main([*arguments, "--to", kind, "--out", f"out.{kind}"]) == 0
    root = ElementTree.parse(tmp_path / "out.cvat").getroot()
    assert root.findtext("meta/task/name") == "a\ufffdb\ufffd.mp4"
    assert json.loads((tmp_path / "out.labelstudio").read_text())[0]["data"]["video"].endswith(
        "mp4"
    )
