"""`ssiam track --view`: stabilized videos, in one pass and in two."""

import re
import signal
import subprocess
import sys
import time
from itertools import pairwise

import av
import cv2
import numpy as np
import pytest

from helpers.odd_clips import write_at_times, write_clip_with_sound
from helpers.synthetic import camera_frame, generator, poses, world
from helpers.tracked_clip import BOX, COUNT, SIZE, box_of, decoded, rows_of, write_clip
from ssiam.cli import main
from ssiam.video import VideoSink, open_source

KCF = ("--box", box_of(BOX), "--tracker", "kcf")


def track(source, *options):
    """Run `ssiam track` with one output, o.mp4; returns its exit code."""
    return main(["track", str(source), *KCF, "--out", "o.mp4", "--overwrite", *options])


def images_of(path):
    with open_source(path) as frames:
        return [frame.image for frame in frames]


def jitter(images, left=0):
    """Mean motion of the middle of the images, measured by phase correlation, pixels a frame."""
    rows, columns = slice(60, 188), slice(left + 80, left + 240)
    gray = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)[rows, columns] for image in images]
    window = cv2.createHanningWindow((160, 128), cv2.CV_32F)
    steps = [cv2.phaseCorrelate(np.float32(a), np.float32(b), window)[0] for a, b in pairwise(gray)]
    return float(np.hypot(*np.transpose(steps)).mean())


@pytest.fixture(autouse=True)
def in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("stabilize", ["predict", "off"])
def test_stabilized_view_is_still(clip, capsys, stabilize):
    options = ("--view", "stabilized", "--overlay", "none", "--stabilize", stabilize)
    assert track(clip[0], *options) == 0
    images = images_of("o.mp4")
    assert len(images) == COUNT
    assert images[0].shape == (SIZE[1], SIZE[0], 3)
    assert jitter(images) < 0.25 * jitter(images_of(clip[0]))
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "view:" in line)
    assert "; it shakes by 0." in line
    assert "% of width and height cropped" in line


def test_side_by_side_shows_a_still_image_beside_the_raw_one(clip):
    assert track(clip[0], "--side-by-side") == 0
    images = images_of("o.mp4")
    assert images[0].shape == (SIZE[1], 2 * SIZE[0], 3)
    assert jitter(images, left=SIZE[0]) < 0.35 * jitter(images)


def test_results_do_not_depend_on_the_view(clip):
    for name, view in (("raw.csv", "raw"), ("stabilized.csv", "stabilized")):
        assert track(clip[0], "--view", view, "--results", name) == 0
    with open("raw.csv") as raw, open("stabilized.csv") as stabilized:
        assert raw.read() == stabilized.read()


def test_pipe_gets_a_camera_without_delay(clip, tmp_path):
    raw = b"".join(frame.to_ndarray(format="bgr24").tobytes() for frame in decoded(clip[0])[0])
    command = [sys.executable, "-m", "ssiam", "track", "-", *KCF, "--raw", "320x240,bgr24,25"]
    command += ["--out", "o.mp4", "--view", "stabilized", "--overlay", "none"]
    done = subprocess.run(command, input=raw, cwd=tmp_path, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert b"stabilized, without delay, " in done.stdout
    images = images_of("o.mp4")
    assert len(images) == COUNT
    assert jitter(images) < 0.6 * jitter(images_of(clip[0]))


def test_span_backward_and_several_targets(clip):
    span = ("--start", "8", "--end", "29", "--view", "stabilized", "--overlay", "none")
    assert track(clip[0], *span, "--box", "20:40,30,50,50") == 0
    forward = images_of("o.mp4")
    assert track(clip[0], *span, "--backward") == 0
    backward = images_of("o.mp4")
    raw = images_of(clip[0])[8:30]
    for images in (forward, backward):
        assert len(images) == len(raw)
        assert jitter(images) < 0.35 * jitter(raw)
    differences = [np.abs(a - 1.0 * b).mean() for a, b in zip(forward, backward, strict=True)]
    assert np.mean(differences) < 12


def test_times_and_sound_are_kept():
    write_at_times("variable.mkv", [0.0, 0.04, 0.08, 0.4, 0.44, 0.9, 1.0])
    box = ("--box", "60,40,30,30", "--tracker", "kcf", "--view", "stabilized")
    assert main(["track", "variable.mkv", *box, "--out", "v.mkv"]) == 0
    with open_source("variable.mkv") as source, open_source("v.mkv") as written:
        times = [[frame.time for frame in frames] for frames in (source, written)]
    assert times[0] == pytest.approx(times[1], abs=2e-3)
    write_clip_with_sound("sound.mp4")
    assert main(["track", "sound.mp4", *box, "--out", "s.mp4"]) == 0
    with av.open("s.mp4") as container:
        assert float(container.streams.audio[0].duration) > 0


def test_source_that_breaks_off_gives_a_whole_video(tmp_path, capsys):
    write_clip(tmp_path / "whole.mkv")
    content = (tmp_path / "whole.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(content[: len(content) // 2])
    assert track("cut.mkv", "--results", "r.csv", "--view", "stabilized") == 3
    assert capsys.readouterr().err.startswith("ssiam: cut.mkv")
    assert len(images_of("o.mp4")) == len(rows_of(tmp_path / "r.csv")) > 5


def test_interrupted_run_writes_the_video_of_its_frames(tmp_path):
    write_clip(tmp_path / "long.mp4", count=400)
    command = [sys.executable, "-m", "ssiam", "track", "long.mp4", *KCF, "--view", "stabilized"]
    process = subprocess.Popen(
        [*command, "--out", "o.mp4", "--results", "r.csv"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    part = tmp_path / "r.part.csv"
    deadline = time.monotonic() + 60
    while not part.exists() or part.read_bytes().count(b"\n") < 15:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.startswith("ssiam: interrupted; writes the video of ")
    assert "o.mp4" in output
    rows = rows_of(tmp_path / "r.csv")
    assert 10 < len(rows) < 400
    assert abs(len(images_of("o.mp4")) - len(rows)) <= 1
    assert not list(tmp_path.glob("*.part*"))


def test_box_is_drawn_where_the_target_is_shown():
    """The target is in the middle of its box: a bright square on a dark, shaking scene."""
    shake = generator(6).normal(0, (5, 5, 0.02), (30, 3))
    shake[0] = 0
    with VideoSink("square.mp4", 25) as sink:
        for pose in poses(shake, SIZE):
            scene = (world(2, SIZE) * 0.4).astype(np.uint8)
            scene[100:130, 150:180] = (250, 60, 60)
            sink.write(camera_frame(scene, pose))
    box = ("--box", "146,96,38,38", "--tracker", "csrt", "--view", "stabilized")
    for overlay, name in (("none", "clean.mp4"), ("box", "drawn.mp4")):
        assert main(["track", "square.mp4", *box, "--overlay", overlay, "--out", name]) == 0
    for clean, drawn in zip(images_of("clean.mp4")[5:], images_of("drawn.mp4")[5:], strict=True):
        blue = np.argwhere((clean[..., 0] > 160) & (clean[..., 2] < 110)).mean(axis=0)
        changed = np.argwhere(np.abs(drawn.astype(int) - clean).max(axis=2) > 90)
        middle = (changed.min(axis=0) + changed.max(axis=0)) / 2
        assert middle == pytest.approx(blue, abs=6)


@pytest.mark.parametrize("overlay", ["none", "box", "box+score", "trail", "mask"])
def test_overlays(clip, overlay):
    assert track(clip[0], "--overlay", overlay, "--stabilize", "off") == 0
    pairs = zip(images_of("o.mp4"), images_of(clip[0]), strict=True)
    drawn = [(np.abs(a.astype(int) - b).max(axis=2) > 100).sum() for a, b in pairs]
    assert (np.median(drawn) > 50) == (overlay != "none")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--view", "stabilized", "--crop", "some"), "--crop 'some'"),
        (("--view", "stabilized", "--crop", "95"), "--crop '95'"),
        (("--view", "raw", "--side-by-side"), "--side-by-side"),
        (
            (
                "--view",
                "locked-on",
            ),
            "--view",
        ),
        (("--border", "white"), "--border"),
    ],
)
def test_refused_options(clip, capsys, options, words):
    assert track(clip[0], *options) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def view_line(output):
    (line,) = (line for line in output.splitlines() if "view:" in line)
    return line


def test_locked_view_holds_the_target_in_its_middle(clip, capsys):
    assert track(clip[0], "--view", "locked", "--overlay", "none") == 0
    found = re.search(
        r"locked, planned .* the target is (.*) px \(RMS\) from its position, of (\d+) px",
        view_line(capsys.readouterr().out),
    )
    assert float(found[1]) < 0.05 * SIZE[0]
    assert int(found[2]) == SIZE[0]
    images = images_of("o.mp4")
    height, width = (side // 4 for side in images[0].shape[:2])
    middle = images[0][height : 3 * height, width : 3 * width]
    for image in images[1:]:
        _, score, _, corner = cv2.minMaxLoc(cv2.matchTemplate(image, middle, cv2.TM_CCOEFF_NORMED))
        assert score > 0.5
        assert np.hypot(corner[0] - width, corner[1] - height) < 0.08 * SIZE[0]


@pytest.mark.parametrize(
    ("aspect", "size_wh"), [("9:16", (136, 240)), ("1:1", (240, 240)), ("16:9", (320, 180))]
)
def test_locked_view_has_the_aspect(clip, aspect, size_wh):
    assert track(clip[0], "--view", "locked", "--aspect", aspect, "--end", "3") == 0
    height, width = images_of("o.mp4")[0].shape[:2]
    assert (width, height) == size_wh


def test_locked_view_backward_beside_the_raw_frame_and_from_a_pipe(clip, tmp_path, capsys):
    assert track(clip[0], "--view", "locked", "--side-by-side", "--backward", "--start", "30") == 0
    assert "locked, planned" in view_line(capsys.readouterr().out)
    assert images_of("o.mp4")[0].shape == (SIZE[1], 2 * SIZE[0], 3)
    raw = b"".join(frame.to_ndarray(format="bgr24").tobytes() for frame in decoded(clip[0])[0])
    command = [sys.executable, "-m", "ssiam", "track", "-", *KCF, "--raw", "320x240,bgr24,25"]
    command += ["--out", "p.mp4", "--view", "locked", "--position", "left third"]
    done = subprocess.run(command, input=raw, cwd=tmp_path, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "locked, without delay, the target is " in view_line(done.stdout.decode())
    assert len(images_of("p.mp4")) == COUNT


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--aspect", "1:1"), "--aspect 1:1 is for the locked view"),
        (("--view", "stabilized", "--zoom", "fixed"), "--zoom fixed is for the locked view"),
        (("--position", "left third"), "--position left third is for the locked view"),
        (("--view", "locked", "--crop", "none"), "--crop none is for the stabilized view"),
    ],
)
def test_options_of_another_view_are_refused(clip, capsys, options, message):
    assert track(clip[0], *options) == 2
    assert message in capsys.readouterr().err
