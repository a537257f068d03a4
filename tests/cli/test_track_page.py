"""`ssiam track` without ``--box`` where the page cannot be opened."""

from __future__ import annotations

import sys

import pytest

from helpers.video_clips import write_clip
from ssiam.cli import main

WAYS = ("--pick", "--box x,y,width,height")


@pytest.fixture
def clip(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.chdir(tmp_path)
    return write_clip(tmp_path / "clip.mp4")


def error_of(capsys, *arguments):
    assert main(["track", *map(str, arguments)]) == 2
    output, error = capsys.readouterr()
    assert (output, error.count("\n")) == ("", 1)
    assert all(way in error for way in WAYS)
    return error


def test_without_the_extra(clip, capsys, monkeypatch):
    for name in [
        name for name in sys.modules if name.startswith(("ssiam.web.server", "ssiam.web.picking"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "starlette", None)
    assert "pip install 'ssiam[web]'" in error_of(capsys, clip)


def test_without_a_browser_and_a_terminal(clip, capsys):
    assert "no browser" in error_of(capsys, clip)


@pytest.mark.parametrize("source", ["-", "0", "rtsp://127.0.0.1:1/x"])
def test_a_source_that_is_read_once(clip, capsys, source):
    error_of(capsys, source)


def test_outputs_are_checked_before_the_page_opens(clip, capsys, tmp_path):
    (tmp_path / "old.mp4").write_bytes(b"kept")
    assert main(["track", str(clip), "--out", "old.mp4"]) == 2
    assert "old.mp4" in capsys.readouterr().err
    assert (tmp_path / "old.mp4").read_bytes() == b"kept"
