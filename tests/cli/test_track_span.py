"""`ssiam track` with `--start`, `--end`, and targets that begin at different times."""

import json
import shutil

import av
import numpy as np
import pytest

from helpers.odd_clips import write_at_times, write_clip_with_sound, write_without_times
from helpers.tracked_clip import BOX, COUNT, SIZE, box_of, decoded, rows_of, run
from ssiam.cli import main
from ssiam.cli.moments import Moment, PlannedTarget, Span
from ssiam.cli.options import TrackerOptions
from ssiam.cli.track_outputs import OutputPaths
from ssiam.cli.track_run import SourceOptions, TrackJob, run_track
from ssiam.exchange.result_files import read_annotations
from ssiam.stabilize import StabilizerConfig
from ssiam.target_start import TargetStart
from ssiam.video import open_source

KCF = ("--tracker", "kcf")
# Seconds of the frames of a clip of variable rate: 25, then 5, then 25 frames a second.
TIMES = [*(0.04 * i for i in range(10)), *(0.36 + 0.2 * i for i in range(1, 6))]
TIMES += [1.36 + 0.04 * i for i in range(1, 11)]


@pytest.fixture
def folder(clip, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(clip[0], "clip.mp4")
    return clip[1]


@pytest.fixture(scope="module")
def variable(tmp_path_factory):
    path = tmp_path_factory.mktemp("variable") / "v.mp4"
    write_at_times(path, TIMES)
    return path


def track(*arguments):
    return main(["track", *map(str, arguments), *KCF])


def frames_of(name, target="1"):
    return [int(row["frame"]) for row in rows_of(name) if row["target"] == target]


def test_start_and_end_are_tracked_and_written(folder, tmp_path):
    box = box_of(folder[10])
    assert track("clip.mp4", "--box", box, "--start", "10", "--end", "25") == 0
    rows = rows_of(tmp_path / "clip-tracked.csv")
    assert [int(row["frame"]) for row in rows] == list(range(10, 26))
    for row, (x, y, _, _) in zip(rows, folder[10:26], strict=True):
        assert np.hypot(float(row["x"]) - x, float(row["y"]) - y) < 10
    assert float(rows[0]["time"]) == pytest.approx(10 * 1001 / 30000, abs=1e-3)
    written, _ = decoded(tmp_path / "clip-tracked.mp4")
    assert len(written) == 16
    assert written[0].pts == 0


@pytest.mark.parametrize(
    ("start", "end", "expected"),
    [
        ("0.56s", "1.16s", range(10, 14)),
        ("0.5s", "1.2s", range(10, 14)),
        ("0:01", "0:01", None),
        ("0:00:01.3", "99s", range(14, len(TIMES))),
        ("11", "1.16s", range(11, 14)),
        ("0.56s", "14", range(10, 15)),
        ("0", "0", range(1)),
    ],
)
def test_times_are_those_of_the_frames(variable, tmp_path, capsys, start, end, expected):
    results = tmp_path / "r.csv"
    arguments = ("--box", "60,40,30,30", "--results", results, "--start", start, "--end", end)
    code = track(variable, *arguments)
    if expected is None:  # no frame between 0.96 s and 1.16 s
        assert code == 2
        assert "is before" in capsys.readouterr().err
        return
    assert code == 0
    assert frames_of(results) == list(expected)
    for row in rows_of(results):
        assert float(row["time"]) == pytest.approx(TIMES[int(row["frame"])], abs=2e-3)


def test_targets_begin_at_different_times(variable, tmp_path, capsys):
    results, out = tmp_path / "r.csv", tmp_path / "o.mp4"
    boxes = ("--box", "12:60,40,30,30", "--box", "20,20,30,30", "--box", "0:01.3:90,40,30,30")
    assert track(variable, *boxes, "--results", results, "--out", out) == 0
    output = capsys.readouterr().out
    assert "target 1: begins in frame 12, " in output
    assert "target 2: lost" in output
    assert "target 3: begins in frame 14, " in output
    for target, begins in (("1", 12), ("2", 0), ("3", 14)):
        rows = [row for row in rows_of(results) if row["target"] == target]
        assert [int(row["frame"]) for row in rows] == list(range(len(TIMES)))
        for row in rows:
            is_waiting = int(row["frame"]) < begins
            values = [row[name] for name in ("x", "y", "w", "h", "score", "lost")]
            assert values == [""] * 6 if is_waiting else "" not in values
            assert row["time"] != ""
    found = read_annotations(results, (160, 96), 25)
    assert sum(row.visible for row in found.rows if row.target == 1) <= len(TIMES) - 12
    assert len(list(open_source(out))) == len(TIMES)


@pytest.mark.parametrize(
    ("layout", "waiting", "first"), [("otb", "0,0,0,0", "61,41,30,30"), ("vot", "0", "1")]
)
def test_text_layouts_before_a_target_begins(variable, tmp_path, layout, waiting, first):
    results = tmp_path / "r.txt"
    box = ("--box", "3:60,40,30,30")
    assert track(variable, *box, "--results", results, "--layout", layout) == 0
    lines = results.read_text().splitlines()
    assert lines[:3] == [waiting] * 3
    assert lines[3] == first
    assert len(lines) == len(TIMES)


def test_mot_has_no_line_before_a_target_begins(variable, tmp_path):
    results = tmp_path / "r.txt"
    boxes = ("--box", "3:60,40,30,30", "--box", "20,20,30,30")
    assert track(variable, *boxes, "--results", results, "--layout", "mot") == 0
    assert results.read_text().splitlines()[3].startswith("4,1,61,41,30,30,")


def test_threads_do_not_change_a_target_that_begins_later(folder, tmp_path):
    boxes = ("--box", box_of(BOX), "--box", f"12:{box_of(folder[12])}", "--end", "20")
    for threads in (1, 2):
        assert track("clip.mp4", *boxes, "--results", f"{threads}.csv", "--threads", threads) == 0
    assert (tmp_path / "1.csv").read_text() == (tmp_path / "2.csv").read_text()


def test_file_of_boxes_is_never_an_output(folder, tmp_path, capsys):
    (tmp_path / "b.csv").write_text("x,y,w,h,frame\n140,90,36,40,\n20,20,40,30,5\n")
    assert track("clip.mp4", "--box", "@b.csv", "--results", "b.csv", "--overwrite") == 2
    assert "b.csv" in capsys.readouterr().err
    assert track("clip.mp4", "--box", "@b.csv", "--results", "r.jsonl", "--end", "9") == 0
    rows = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    assert [row["x"] is None for row in rows if row["target"] == 2] == [True] * 5 + [False] * 5


class Recorder:
    """Progress as a list of calls."""

    def __init__(self):
        self.steps, self.written = [], []

    def advance(self, done, total, fps):
        self.steps.append((done, total))
        assert fps is None or fps > 0

    def finished(self, written):
        self.written = [(kind, path.name) for kind, path in written]


def test_a_run_with_given_starts_reports_its_progress(folder, tmp_path):
    job = TrackJob(
        SourceOptions("clip.mp4"),
        OutputPaths.explicit(tmp_path / "o.mp4", tmp_path / "r.csv", None, None, 2, False),
        TrackerOptions(tracker="kcf"),
        StabilizerConfig(),
        Span(end=Moment("19", frame=19)),
        quiet=True,
    )
    starts = [TargetStart(5, tuple(folder[5])), TargetStart(0, tuple(folder[0]))]
    progress = [Recorder(), Recorder()]
    run_track(job, [PlannedTarget.from_start(each) for each in starts], progress)
    for each in progress:
        assert each.steps == [(done, 20) for done in range(1, 21)]
        assert sorted(each.written) == [("results", "r.csv"), ("video", "o.mp4")]
    lost = [row["lost"] for row in rows_of(tmp_path / "r.csv") if row["target"] == "1"]
    assert [value == "" for value in lost] == [True] * 5 + [False] * 15


def test_four_words_and_equal_results(folder, tmp_path):
    words = [f"{value:g}" for value in BOX]
    assert track("clip.mp4", "--box", *words, "--results", "words.csv", "--end", "9") == 0
    assert track("clip.mp4", "--box", ",".join(words), "--results", "one.csv", "--end", "9") == 0
    assert (tmp_path / "words.csv").read_text() == (tmp_path / "one.csv").read_text()


def test_sound_begins_with_the_first_written_frame(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_clip_with_sound(tmp_path / "clip.mp4")
    assert track("clip.mp4", "--box", "60,40,30,30", "--out", "o.mp4", "--start", "0.8s") == 0
    with av.open("clip.mp4") as whole, av.open("o.mp4") as part:
        cut = float(whole.streams.video[0].duration * whole.streams.video[0].time_base) - 0.8
        sound, video = part.streams.audio[0], part.streams.video[0]
        assert float(video.duration * video.time_base) == pytest.approx(cut, abs=0.05)
        assert float(sound.duration * sound.time_base) == pytest.approx(cut, abs=0.1)


HOSTILE = [
    pytest.param(("--start", "30", "--end", "20"), "--end 20 is before --start 30", id="swapped"),
    pytest.param(("--start", "0:02", "--end", "1s"), "is before --start 0:02", id="swapped times"),
    pytest.param(("--start", "30", "--end", "0.2s"), "--end 0.2s is before", id="mixed"),
    pytest.param(("--start", "500"), f"after the end of clip.mp4, which has {COUNT}", id="late"),
    pytest.param(("--start", "1:00:00"), "after the end of clip.mp4", id="an hour"),
    pytest.param(("--start", "-3"), "'-3'", id="negative"),
    pytest.param(("--start", "nan"), "'nan'", id="nan"),
    pytest.param(("--end", "1:99"), "'1:99'", id="99 seconds"),
    pytest.param(("--end", "soon"), "'soon'", id="word"),
    pytest.param(("--box", "30:5,5,9,9", "--end", "20"), "--end 20", id="begins after the end"),
    pytest.param(("--box", "3:5,5,9,9", "--start", "5"), "before --start 5", id="begins before"),
    pytest.param(
        ("--box", "0.1s:5,5,9,9", "--start", "9"), "before --start 9", id="begins before, mixed"
    ),
    pytest.param(("--box", "20:999,5,9,9"), "--box 20:999,5,9,9: box", id="later box outside"),
    pytest.param(("--box", "20:nan,5,9,9"), "not finite", id="later box nan"),
    pytest.param(("--box", "@missing.csv"), "missing.csv", id="no file"),
]


@pytest.mark.parametrize(("arguments", "named"), HOSTILE)
def test_impossible_spans_write_nothing(folder, tmp_path, capsys, arguments, named):
    box = ("--box", "140,90,36,40") if "--start" in arguments or "--end" in arguments else ()
    assert track("clip.mp4", *box, *arguments) == 2
    captured = capsys.readouterr()
    assert named in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["clip.mp4"]


@pytest.mark.parametrize("late", ["500:5,5,20,20", "1:00:5,5,20,20", "30:5,5,20,20"])
def test_a_target_that_never_begins_is_reported(folder, tmp_path, capsys, late):
    end = ("--end", "0.5s") if late.startswith("30") else ()
    assert track("clip.mp4", "--box", box_of(BOX), "--box", late, *end) == 3
    captured = capsys.readouterr()
    assert captured.err.startswith(f"ssiam: --box {late} begins after the last frame")
    assert "target 2: did not begin" in captured.out
    assert (tmp_path / "clip-tracked.mp4").exists()


def test_a_source_without_times_has_no_seconds(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_without_times("clip.mjpeg")
    assert track("clip.mjpeg", "--box", "60,40,30,30", "--start", "0.1s") == 2
    assert "no timestamps" in capsys.readouterr().err
    assert track("clip.mjpeg", "--box", "60,40,30,30", "--start", "2", "--results", "r.csv") == 0
    assert frames_of(tmp_path / "r.csv") == [2, 3]


def test_frames_of_a_pipe_are_read_to_the_end_only(clip, tmp_path):
    frames, _ = decoded(clip[0])
    raw = b"".join(frame.to_ndarray(format="bgr24").tobytes() for frame in frames)
    with (tmp_path / "raw").open("wb") as file:
        file.write(raw)
    with (tmp_path / "raw").open("rb") as file:
        arguments = ("--raw", f"{SIZE[0]}x{SIZE[1]},bgr24,25", "--results", tmp_path / "r.csv")
        span = ("--start", "0.4s", "--end", "0.8s", "--box", "0.6s:40,40,50,50")
        done = run("track", "-", *arguments, *span, *KCF, stdin=file)
    assert done.returncode == 0, done.stderr
    assert frames_of(tmp_path / "r.csv") == list(range(10, 21))
