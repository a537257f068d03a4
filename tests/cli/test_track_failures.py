"""`ssiam track` with a failing tracker: the rest is tracked, with exit code 3."""

import pytest

from helpers.tracked_clip import BOX, COUNT, box_of, decoded, rows_of
from ssiam.cli import main
from ssiam.motion import CameraMotion
from ssiam.trackers.opencv import OpenCvTracker

OTHER = (40.0, 60.0, 50.0, 40.0)


@pytest.fixture
def arguments(clip, tmp_path):
    words = ["track", str(clip[0]), "--box", box_of(BOX), "--box", box_of(OTHER)]
    words += ["--tracker", "kcf", "--results", str(tmp_path / "r.csv")]
    return [*words, "--out", str(tmp_path / "o.mp4")]


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_failing_tracker_does_not_affect_other_targets(
    arguments, tmp_path, monkeypatch, capsys, stabilize
):
    update, calls = OpenCvTracker.update, {}

    def fail_sometimes(tracker, view):
        own_calls = calls.setdefault(id(tracker), [])
        own_calls.append(tracker)
        if tracker is next(iter(calls.values()))[0] and len(own_calls) % 10 == 0:
            raise RuntimeError("broken")
        return update(tracker, view)

    monkeypatch.setattr(OpenCvTracker, "update", fail_sometimes)
    assert main([*arguments, "--stabilize", stabilize]) == 3
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert "target 1 could not be tracked in" in captured.err
    assert "frame 10: RuntimeError: broken" in captured.err
    assert len(decoded(tmp_path / "o.mp4")[0]) == COUNT
    rows = rows_of(tmp_path / "r.csv")
    assert len(rows) == 2 * COUNT
    failed = [row for row in rows if row["target"] == "1" and int(row["frame"]) % 10 == 0][1:]
    assert {(row["lost"], float(row["score"])) for row in failed[:1]} == {("1", 0.0)}
    assert all(row["lost"] == "0" for row in rows if row["target"] == "2")


def test_failing_camera_motion_does_not_stop_tracking(arguments, tmp_path, monkeypatch, capsys):
    update, calls = CameraMotion.update, []

    def fail_sometimes(camera, *given):
        calls.append(camera)
        if len(calls) == 20:
            raise ArithmeticError("singular")
        return update(camera, *given)

    monkeypatch.setattr(CameraMotion, "update", fail_sometimes)
    assert main([*arguments, "--threads", "2"]) == 3
    assert "camera could not be tracked in 1 of" in capsys.readouterr().err
    assert len(rows_of(tmp_path / "r.csv")) == 2 * COUNT


def test_box_refused_by_the_tracker_writes_nothing(clip, tmp_path, capsys):
    words = ["track", str(clip[0]), "--tracker", "csrt", "--out", str(tmp_path / "o.mp4")]
    for box in ("100,100,1,1", "0,100,320,1", "0,0,1e6,1e6"):
        assert main([*words, "--box", box]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert "box" in error
    assert not (tmp_path / "o.mp4").exists()
