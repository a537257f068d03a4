"""Recordings are complete: the video plays, the tables and exports match it."""

import csv
import json
import os
import resource
import signal
import tempfile
import time
import zipfile
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from queue import SimpleQueue
from stat import S_IMODE
from xml.etree import ElementTree

import numpy as np
import pytest

from helpers.shaky_clip import SIZE, shaky_frames
from ssiam.errors import SinkError, StreamError
from ssiam.geometry import IDENTITY
from ssiam.track import Track
from ssiam.video import Frame, open_source
from ssiam.web import recording, recording_files
from ssiam.web.recording import Recordings
from ssiam.web.types import CommandError, Step, Target

RATE = 25


def steps(count, *, targets=lambda index: (1,)):
    """Steps of a clip, with the patch as the targets of these ids."""
    frames, boxes = shaky_frames(count)
    for index, (image, box) in enumerate(zip(frames, boxes, strict=True)):
        states = tuple(
            Target(id, f"patch {id}", "#00ff00", Track(box, 0.9, lost=index % 10 == 9))
            for id in targets(index)
        )
        frame = Frame(index + 100, index / RATE, image)
        yield Step(
            index + 1, frame, states, None, IDENTITY, "off", 0.0, 0.0, RATE, 0, "playing", None
        )


def recorded(recordings, count, **options):
    name = recordings.begin(RATE)
    for step in steps(count, **options):
        recordings.write(step)
    assert recordings.end() == name
    while recordings.listing()[-1]["open"]:
        time.sleep(0.01)
    return name


@pytest.fixture
def recordings():
    kept = Recordings()
    yield kept
    kept.close()


def test_every_file_of_a_recording_matches_its_video(recordings):
    name = recorded(recordings, 30)
    (listed,) = recordings.listing()
    assert (listed["frames"], listed["seconds"]) == (30, pytest.approx(1.2))
    with open_source(recordings.path(name, "video.mp4")) as frames:
        assert frames.size_wh == SIZE
        played = list(frames)
    assert len(played) == 30
    assert played[-1].time == pytest.approx(29 / RATE, abs=1e-3)
    rows = list(csv.DictReader(recordings.path(name, "results.csv").open()))
    assert [int(row["frame"]) for row in rows] == list(range(30))
    lines = recordings.path(name, "results.jsonl").read_text().splitlines()
    assert [json.loads(line)["lost"] for line in lines] == [i % 10 == 9 for i in range(30)]
    cvat = ElementTree.parse(recordings.path(name, "cvat.xml"))
    assert cvat.find(".//track").get("label") == "patch 1"
    coco = json.loads(recordings.path(name, "coco.json").read_text())
    assert len(coco["images"]) == 30
    with zipfile.ZipFile(recordings.path(name, "got10k.zip")) as archive:
        assert archive.testzip() is None


def test_targets_can_be_added_and_removed(recordings):
    name = recorded(recordings, 12, targets=lambda index: () if index < 4 else (3, 5))
    rows = list(csv.DictReader(recordings.path(name, "results.csv").open()))
    assert {(row["frame"], row["target"]) for row in rows} == {
        (str(frame), target) for frame in range(4, 12) for target in "35"
    }
    coco = json.loads(recordings.path(name, "coco.json").read_text())
    assert {each["attributes"]["track_id"] for each in coco["annotations"]} == {3, 5}


def test_boxes_are_drawn_into_the_video(recordings):
    drawn = recorded(recordings, 3)
    plain = recorded(recordings, 3, targets=lambda index: ())
    first = [
        next(open_source(recordings.path(name, "video.mp4"))).image.astype(int)
        for name in (drawn, plain)
    ]
    difference = np.abs(first[0] - first[1])
    assert difference.max() > 60


def test_a_repeated_frame_is_recorded_once(recordings):
    name = recordings.begin(RATE)
    for step in steps(4):
        recordings.write(step)
        recordings.write(step)
    recordings.end()
    while recordings.listing()[0]["open"]:
        time.sleep(0.01)
    assert recordings.listing()[0]["frames"] == 4
    assert name == recordings.listing()[0]["name"]


def test_a_recording_without_targets_is_a_video(recordings):
    recorded(recordings, 3, targets=lambda index: ())
    assert recordings.listing()[0]["files"] == ["video.mp4", "results.csv", "results.jsonl"]


def test_a_change_of_the_frame_size_finishes_the_recording(recordings):
    notes, listings = [], []
    recordings.listen_notes(notes.append)
    recordings.listen(listings.append)
    name = recordings.begin(RATE)
    for step in steps(3):
        recordings.write(step)
    larger = Frame(900, None, np.zeros((480, 640, 3), np.uint8))
    odd = Step(4, larger, (), None, IDENTITY, "off", 0.0, 0.0, RATE, 0, "playing", None)
    recordings.write(odd)
    while recordings.listing()[0]["open"]:
        time.sleep(0.01)
    assert recordings.current is None
    recordings.write(odd)
    while len(listings) < 2:
        time.sleep(0.01)
    reason = "the frame size changed from 320x240 to 640x480 pixels"
    assert listings[-1][0]["error"] == reason
    assert {"cvat.xml", "coco.json", "labelstudio.json"} <= set(listings[-1][0]["files"])
    assert [note.message for note in notes] == [
        f"recording {name} ended early: {reason}; the rest is kept"
    ]
    with open_source(recordings.path(name, "video.mp4")) as frames:
        assert len(list(frames)) == 3
    assert recordings.begin(RATE) != name


@pytest.fixture
def small_files():
    """Limits files to 60,000 bytes, to simulate a full disk."""
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, handler)


def test_after_a_full_disk_the_partial_video_is_listed_and_plays(recordings, small_files):
    name = recordings.begin(RATE)
    for step in steps(60):
        recordings.write(step)
        time.sleep(0.005)
    while recordings.listing()[-1]["open"]:
        time.sleep(0.01)
    (listed,) = recordings.listing()
    assert "video.mp4" in listed["files"]
    assert "cannot be written" in listed["error"]
    with open_source(recordings.path(name, "video.mp4")) as frames, suppress(StreamError):
        assert next(frames).image.shape[1::-1] == SIZE
        assert next(frames).index == 1


@pytest.mark.parametrize(
    ("name", "file"),
    [
        pytest.param("../..", "video.mp4", id="another folder"),
        pytest.param("", "video.mp4", id="no name"),
        pytest.param("NAME", "../video.mp4", id="a path"),
        pytest.param("NAME", "secret", id="unknown file"),
        pytest.param("NAME", "/etc/passwd", id="absolute"),
    ],
)
def test_only_listed_files_have_a_path(recordings, name, file):
    known = recorded(recordings, 2)
    with pytest.raises(KeyError):
        recordings.path(known if name == "NAME" else name, file)


def test_an_open_recording_cannot_be_downloaded_and_is_the_only_one(recordings):
    name = recordings.begin(RATE)
    with pytest.raises(KeyError):
        recordings.path(name, "video.mp4")
    with pytest.raises(CommandError, match="is open"):
        recordings.begin(RATE)


def test_listeners_are_called_on_changes(recordings):
    listings: SimpleQueue[list] = SimpleQueue()
    unlisten = recordings.listen(listings.put)
    recorded(recordings, 2)
    assert [listings.get(timeout=10)[0]["open"] for _ in range(2)] == [True, False]
    unlisten()
    recorded(recordings, 2)
    recordings.close()  # waits for the last change
    assert listings.empty()


def test_recordings_are_kept_in_the_given_folder(tmp_path):
    kept = Recordings(tmp_path / "kept")
    name = recorded(kept, 2)
    kept.close()
    assert (tmp_path / "kept" / name / "video.mp4").stat().st_size > 0


def test_without_a_folder_recordings_are_deleted(recordings):
    path = recordings.path(recorded(recordings, 2), "video.mp4")
    recordings.close()
    assert not path.exists()


@pytest.mark.parametrize("exists", [False, True], ids=["new folder", "the shared one"])
def test_in_a_shared_folder_other_users_cannot_read_recordings(tmp_path, exists):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o1777)
    umask = os.umask(0o022)
    try:
        kept = Recordings(shared if exists else shared / "new" / "recordings")
        part = kept.begin(RATE)
        (folder,) = shared.iterdir()
        assert S_IMODE(folder.stat().st_mode) == 0o700
        assert list(folder.rglob("video.part.mp4")), f"the files of {part} are in it"
        kept.close()
        own = Recordings(tmp_path / "own")
        own.close()
        assert S_IMODE((tmp_path / "own").stat().st_mode) == 0o755, "as the user wants it"
    finally:
        os.umask(umask)


def test_temporary_recordings_are_readable_by_their_owner_only(recordings):
    path = recordings.path(recorded(recordings, 2), "video.mp4")
    assert S_IMODE(path.parents[1].stat().st_mode) == 0o700


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """A temporary folder, and elsewhere a finished recording with a lock that is a link."""
    folder = tmp_path / "planted"
    kept = Recordings(folder)
    recorded(kept, 2)
    kept.close()
    (folder / "recording.lock").symlink_to(tmp_path / "created")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    return folder


def test_a_link_in_the_temporary_folder_is_not_reported(planted, tmp_path):
    (planted / "recording.lock").unlink()
    (tmp_path / "tmp" / "ssiam-live-x").symlink_to(planted)
    assert recording_files.abandoned_recordings() == []


def test_a_lock_that_is_a_link_creates_no_file(planted, tmp_path):
    planted.rename(tmp_path / "tmp" / "ssiam-live-x")
    assert recording_files.abandoned_recordings() == []
    assert not (tmp_path / "created").exists()


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder to another user")
def test_a_temporary_folder_of_another_user_is_not_reported(planted, tmp_path):
    (planted / "recording.lock").unlink()
    folder = planted.rename(tmp_path / "tmp" / "ssiam-live-x")
    assert recording_files.abandoned_recordings() == [folder]
    os.chown(folder, 12345, 12345)
    assert recording_files.abandoned_recordings() == []


def test_a_folder_that_cannot_be_created_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SinkError, match="file/there: cannot be written"):
        Recordings(tmp_path / "file" / "there")


def test_results_have_the_times_of_their_video(recordings):
    """The recording starts mid-session, and the source's times are uneven and jump back."""
    name = recordings.begin(RATE)
    seconds = [37.0, 37.2, 37.4, 37.9, 2.0, 2.2]
    for step, time_ in zip(steps(6), seconds, strict=True):
        frame = Frame(step.frame.index, time_, step.frame.image)
        recordings.write(replace(step, frame=frame))
    recordings.end()
    while recordings.listing()[-1]["open"]:
        time.sleep(0.01)
    (listed,) = recordings.listing()
    rows = list(csv.DictReader((recordings.path(name, "results.csv")).open()))
    with open_source(recordings.path(name, "video.mp4")) as frames:
        played = [frame.time for frame in frames]
    assert [float(row["time"]) for row in rows] == pytest.approx(played, abs=1e-3)
    assert played == pytest.approx([0, 0.2, 0.4, 0.9, 0.94, 1.14], abs=1e-3)
    assert listed["seconds"] == pytest.approx(1.18, abs=2e-3)


def test_the_pixel_aspect_of_the_source_is_kept(recordings):
    name = recordings.begin(RATE, Fraction(16, 15))
    for step in steps(3):
        recordings.write(step)
    recordings.end()
    while recordings.listing()[-1]["open"]:
        time.sleep(0.01)
    with open_source(recordings.path(name, "video.mp4")) as frames:
        assert frames.info.pixel_aspect == Fraction(16, 15)


def test_an_export_that_fails_does_not_affect_the_others(recordings, monkeypatch):
    original = recording_files.write_exports
    notes = []
    recordings.listen_notes(notes.append)

    def failing(annotations, path, kind, video="video.mp4"):
        if kind == "coco":
            raise RuntimeError("no categories")
        original(annotations, path, kind, video)

    monkeypatch.setattr(recording_files, "write_exports", failing)
    name = recorded(recordings, 5)
    (listed,) = recordings.listing()
    assert "coco.json" not in listed["files"]
    assert {"cvat.xml", "labelstudio.json", "got10k.zip"} <= set(listed["files"])
    assert "coco.json was not written: RuntimeError: no categories" in listed["error"]
    recordings.close()
    assert f"recording {name} is incomplete" in notes[0].message


def test_a_frame_that_cannot_be_drawn_finishes_the_recording(recordings, monkeypatch):
    original, calls = recording.draw_tracks, []

    def failing(*given, **options):
        calls.append(given)
        if len(calls) == 4:
            raise RuntimeError("no font")
        return original(*given, **options)

    monkeypatch.setattr(recording, "draw_tracks", failing)
    name = recordings.begin(RATE)
    for step in steps(8):
        recordings.write(step)
    while recordings.listing()[0]["open"]:
        time.sleep(0.01)
    (listed,) = recordings.listing()
    assert (listed["frames"], listed["error"]) == (3, "RuntimeError: no font")
    assert "cvat.xml" in listed["files"]
    with open_source(recordings.path(name, "video.mp4")) as frames:
        assert len(list(frames)) == 3
    monkeypatch.undo()
    recordings.close()
    assert recordings.current is None


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(b"", id="empty"),
        pytest.param(b"nonsense", id="not JSON"),
        pytest.param(b"[1]", id="a list"),
        pytest.param(b'{"fps": "1/0", "size_wh": [1, 1], "frames": 1, "names": {}}', id="no rate"),
        pytest.param(b'{"fps": "30", "size_wh": [1], "frames": 1, "names": {}}', id="no size"),
    ],
)
def test_damaged_metadata_of_an_earlier_recording_affects_no_other(tmp_path, content):
    kept = Recordings(tmp_path)
    names = [recorded(kept, 3) for _ in range(2)]
    kept.close()
    (tmp_path / names[0] / "recording.json").write_bytes(content)
    (tmp_path / "else").mkdir()
    (tmp_path / "file.txt").write_text("nothing")
    later = Recordings(tmp_path)
    while any(each["open"] for each in later.listing()):
        time.sleep(0.01)
    assert [each["name"] for each in later.listing()] == names
    assert all("video.mp4" in each["files"] for each in later.listing())
    with open_source(later.path(names[0], "video.mp4")) as frames:
        assert len(list(frames)) == 3
    with pytest.raises(KeyError):
        later.path(names[0], "recording.json")
    later.close()
