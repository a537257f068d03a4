"""`ssiam track --backward`: from a later frame to the start, written in the order of the frames."""

import shutil

import av
import cv2
import numpy as np
import pytest

from helpers.odd_clips import write_clip_with_sound
from helpers.tracked_clip import COUNT, box_of, decoded, rows_of, write_clip
from ssiam.cli import main
from ssiam.cli.moments import PlannedTarget
from ssiam.cli.options import TrackerOptions
from ssiam.cli.track_backward import run_backward
from ssiam.cli.track_outputs import OutputPaths
from ssiam.cli.track_run import SourceOptions, TrackJob
from ssiam.stabilize import StabilizerConfig

KCF = ("--tracker", "kcf")


@pytest.fixture
def truth(clip, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(clip[0], "clip.mp4")
    return clip[1]


def track(*arguments):
    return main(["track", *map(str, arguments), "--backward", *KCF])


def assert_follows(rows, truth):
    for row in rows:
        x, y, _, _ = truth[int(row["frame"])]
        assert np.hypot(float(row["x"]) - x, float(row["y"]) - y) < 10


def test_from_the_last_frame_to_the_first(truth, tmp_path, capsys):
    assert track("clip.mp4", "--box", box_of(truth[-1])) == 0
    rows = rows_of(tmp_path / "clip-tracked.csv")
    assert [int(row["frame"]) for row in rows] == list(range(COUNT))
    assert_follows(rows, truth)
    assert len(decoded(tmp_path / "clip-tracked.mp4")[0]) == COUNT
    assert "clip.mp4 backward" in capsys.readouterr().out


def test_motion_is_that_since_the_frame_before(truth, tmp_path):
    assert main(["track", "clip.mp4", "--box", box_of(truth[0]), *KCF, "--results", "f.csv"]) == 0
    assert track("clip.mp4", "--box", box_of(truth[-1]), "--results", "b.csv") == 0
    forward, backward = rows_of(tmp_path / "f.csv"), rows_of(tmp_path / "b.csv")
    assert backward[0]["dx"] == ""
    for ahead, back in zip(forward[1:], backward[1:], strict=True):
        for name, tolerance in (("dx", 0.5), ("dy", 0.5), ("angle_rad", 0.003)):
            assert float(back[name]) == pytest.approx(float(ahead[name]), abs=tolerance)


def test_span_and_targets_of_different_frames(truth, tmp_path, capsys):
    boxes = ("--box", f"30:{box_of(truth[30])}", "--box", f"20:{box_of(truth[20])}")
    span = ("--start", "5", "--end", "34")
    assert track("clip.mp4", *boxes, *span, "--results", "r.csv", "--out", "o.mkv") == 0
    rows = rows_of(tmp_path / "r.csv")
    for target, begins in (("1", 30), ("2", 20)):
        mine = [row for row in rows if row["target"] == target]
        assert [int(row["frame"]) for row in mine] == list(range(5, 35))
        assert [row["lost"] == "" for row in mine] == [f > begins for f in range(5, 35)]
        assert_follows([row for row in mine if row["lost"]], truth)
    assert len(decoded(tmp_path / "o.mkv")[0]) == 30
    assert "target 2: begins in frame 20" in capsys.readouterr().out


def test_without_an_end_the_video_ends_with_the_last_target(truth, tmp_path):
    boxes = ("--box", f"0.5s:{box_of(truth[15])}", "--box", f"9:{box_of(truth[9])}")
    assert track("clip.mp4", *boxes, "--results", "r.csv") == 0
    assert {int(row["frame"]) for row in rows_of(tmp_path / "r.csv")} == set(range(16))


def test_number_of_threads_does_not_change_results(truth, tmp_path):
    for threads in (1, 2):
        out = ("--results", f"{threads}.csv", "--threads", threads)
        assert track("clip.mp4", "--box", f"20:{box_of(truth[20])}", *out) == 0
    assert (tmp_path / "1.csv").read_text() == (tmp_path / "2.csv").read_text()


def test_a_folder_of_images(truth, tmp_path):
    (tmp_path / "frames").mkdir()
    for index, frame in enumerate(decoded(tmp_path / "clip.mp4")[0][:12]):
        cv2.imwrite(f"frames/{index}.png", frame.to_ndarray(format="bgr24"))
    assert track("frames", "--box", box_of(truth[11]), "--results", "r.csv") == 0
    rows = rows_of(tmp_path / "r.csv")
    assert len(rows) == 12
    assert_follows(rows, truth)


def test_masks_and_rotated_boxes_are_kept(truth, tmp_path):
    arguments = ["--box", f"6:{box_of(truth[6])}", "--out", "o.mp4", "--results", "r.csv"]
    assert main(["track", "clip.mp4", *arguments, "--backward"]) == 0
    rows = rows_of(tmp_path / "r.csv")
    assert all(row["x1"] for row in rows[:-1])
    plain, _ = decoded(tmp_path / "clip.mp4")
    drawn, _ = decoded(tmp_path / "o.mp4")
    x, y, w, h = (int(float(rows[2][key])) for key in "xywh")
    inside = np.s_[y + h // 3 : y + 2 * h // 3, x + w // 3 : x + 2 * w // 3, 1]
    tint = [frames[2].to_ndarray(format="bgr24")[inside].mean() for frames in (plain, drawn)]
    assert tint[1] > tint[0] + 20


def test_sound_is_copied(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_clip_with_sound(tmp_path / "clip.mp4")
    assert track("clip.mp4", "--box", "60,40,30,30", "--out", "o.mp4") == 0
    with av.open("o.mp4") as container:
        assert float(container.streams.audio[0].duration) > 0


def test_a_truncated_file_is_tracked_from_its_last_frame(truth, tmp_path, capsys):
    write_clip(tmp_path / "whole.mkv")
    content = (tmp_path / "whole.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(content[: len(content) // 2])
    assert track("cut.mkv", "--box", "100,80,40,40") == 3
    assert capsys.readouterr().err.startswith("ssiam: cut.mkv: broke off")
    rows = rows_of(tmp_path / "cut-tracked.csv")
    assert 5 < len(rows) < COUNT


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("-", "--box", "1,2,30,30"), "save it to a file", id="pipe"),
        pytest.param(("rtsp://h/cam", "--box", "1,2,30,30"), "save it to a file", id="stream"),
        pytest.param(("clip.mp4", "--box", "99:1,2,30,30"), "--box 99:", id="after the end"),
        pytest.param(("clip.mp4", "--box", "5:999,2,30,30"), "outside", id="outside"),
        pytest.param(("clip.mp4", "--box", "1,2,9,9", "--start", "99"), "40 frames", id="start"),
        pytest.param(("clip.mp4", "--box", "9:1,2,9,9", "--end", "0.1s"), "--box 9:", id="mixed"),
        pytest.param(("clip.mp4", "--pick"), "--pick --start FRAME", id="pick"),
        pytest.param(("clip.mp4", "--box", "9:1,2,9,9", "--out", "o.xyz"), "o.xyz", id="video"),
        pytest.param(
            ("clip.mp4", "--box", "9:1,2,9,9", "--layout", "vot", "--results", "r.txt"),
            "--layout vot",
            id="layout",
        ),
    ],
)
def test_refusals_write_nothing(truth, tmp_path, capsys, arguments, named):
    assert track(*arguments) == 2
    captured = capsys.readouterr()
    assert named in captured.err
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert [path.name for path in tmp_path.iterdir()] == ["clip.mp4"]


class Interrupting:
    """Progress that is interrupted, as by Ctrl-C, after a number of steps."""

    def __init__(self, after):
        self.after = after
        self.written = []

    def advance(self, done, total, fps):
        assert 1 <= done <= total == 2 * COUNT
        if done == self.after:
            raise KeyboardInterrupt

    def finished(self, written):
        self.written = [(kind, path.name) for kind, path in written]


@pytest.mark.parametrize(("after", "rows"), [(5, None), (COUNT, None), (COUNT + 7, 7)])
def test_nothing_is_written_before_all_is_tracked(truth, tmp_path, after, rows):
    job = TrackJob(
        SourceOptions("clip.mp4"),
        OutputPaths.explicit(None, tmp_path / "r.csv", None, None, 1, False),
        TrackerOptions(tracker="kcf"),
        StabilizerConfig(),
        quiet=True,
    )
    x, y, w, h = truth[-1]
    progress = Interrupting(after)
    with pytest.raises(KeyboardInterrupt):
        run_backward(job, [PlannedTarget((x, y, w, h))], [progress])
    assert progress.written == ([] if rows is None else [("results", "r.csv")])
    assert not list(tmp_path.glob("*.part*"))
    assert (tmp_path / "r.csv").exists() == (rows is not None)
    if rows is not None:
        assert len(rows_of(tmp_path / "r.csv")) == rows
