"""No message, page, log or file contains the password of a source's address."""

from __future__ import annotations

import logging
import traceback
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from helpers.opened_feeds import wait_for
from helpers.video_clips import write_clip
from ssiam.addresses import display_name, redact_address, redact_words, stack_of
from ssiam.cli import main
from ssiam.cli.track_run import SourceOptions
from ssiam.errors import ArgumentError, SinkError, SourceError
from ssiam.evaluation.runs.parallel import in_parallel
from ssiam.outputs import check_output, make_folder
from ssiam.video import Source, open_source
from ssiam.video.reversing import check_reversible
from ssiam.web.feeds.opening import open_feed
from ssiam.web.feeds.paced import PacedFeed
from ssiam.web.mavlink.links import open_link

REDACTED = [
    ("rtsp://cam/live", "rtsp://cam/live"),
    ("rtsp://u:p@cam:554/live", "rtsp://cam:554/live"),
    ("rtsp://u:p@ss@cam/live", "rtsp://cam/live"),
    ("rtsp://u:p/w@cam/live", "rtsp://cam/live"),
    ("http://cam/live?user=u&pwd=p#x", "http://cam/live"),
    ("http://cam?pwd=a@b", "http://cam"),
    ("rtsp://u:p#w@cam/live", "rtsp://cam/live"),
    ("rtsp://u:p?w@cam:554/live?key=p", "rtsp://cam:554/live"),
    ("rtsp://u:12#w@cam/live", "rtsp://..."),
    ("rtsp://u:p#w@cam/live?mail=p@w", "rtsp://..."),
    ("rtsp://u@cam/live", "rtsp://cam/live"),
    ("RTSP://u:p@cam/live", "RTSP://cam/live"),
    ("rtsp:/u:p@cam/live", "rtsp://cam/live"),
    (" rtsp://u:p@cam/live", "rtsp://cam/live"),
    ("'rtsp://u:p@cam/live'", "rtsp://cam/live"),
    ('"rtsp:/u:p@cam/live', "rtsp://cam/live"),
    ("async:rtsp://u:p@cam/live", "async:rtsp://cam/live"),
    ("u:p@cam/live", "cam/live"),
    ("rtsp:u:p@cam/live", "cam/live"),
    ("rtsp://u:p@[::1]:554/live", "rtsp://[::1]:554/live"),
    ("rtsp://u:p@[::1/live", "rtsp://..."),
    ("rtsp://u:p", "rtsp://..."),
    ("rtsp://u%3Ap%40cam/live", "rtsp://..."),
    ("rtsp://cam/user=u&password=p/1.sdp", "rtsp://cam/user=.../1.sdp"),
    ("rtsp://u:p@cam\u2100/live", "rtsp://..."),
]


@pytest.mark.parametrize(("address", "redacted"), REDACTED, ids=[each[0] for each in REDACTED])
def test_redact_address(address, redacted):
    assert redact_address(address) == redacted
    assert display_name(address) == redacted


@pytest.mark.parametrize("name", ["a.mp4", "a/b c@d.mp4", "C:\\a.mp4", "0", "-", "a?.mp4"])
def test_names_of_files_stay(name):
    assert display_name(name) == name


def test_a_file_with_the_name_of_an_address_stays(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_clip(tmp_path / "12:30 at me@home.mp4", 3)
    with open_source("12:30 at me@home.mp4") as source:
        assert source.name == "12:30 at me@home.mp4"


MISTYPED = [
    "rtsp:/anna:hunter2@127.0.0.1/live",
    " rtsp://anna:hunter2@127.0.0.1:9/live",
    "'rtsp://anna:hunter2@127.0.0.1:9/live'",
    "RTSP:/anna:hunter2@127.0.0.1/live",
    "anna:hunter2@127.0.0.1/live",
    "rtsp://anna:hunter2#@127.0.0.1:9/live",
    "rtsp://anna:hunter2?@127.0.0.1:9/live",
    "rtsp://anna:hunter2@[127.0.0.1/live",
    "async:rtsp://anna:hunter2@127.0.0.1:9/live",
    "http://127.0.0.1:9/live?password=hunter2",
    "rtsp://127.0.0.1:9/user=anna&password=hunter2",
]
COMMANDS = {
    "track": ["track", "SOURCE", "--box", "1,2,30,40"],
    "page": ["track", "SOURCE", "--tracker", "kcf"],
    "pick": ["track", "SOURCE", "--pick"],
    "backward": ["track", "SOURCE", "--backward", "--box", "5:1,2,30,40"],
    "headless": ["live", "SOURCE", "--headless", "--tracker", "kcf"],
    "live": ["live", "SOURCE", "--tracker", "kcf"],
    "surplus": ["track", "clip.mp4", "SOURCE"],
    "option": ["track", "clip.mp4", "--threads=SOURCE"],
    "value": ["track", "clip.mp4", "--box", "SOURCE"],
    "results": ["track", "clip.mp4", "--results", "SOURCE"],
    "command": ["SOURCE"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_errors_of_commands_contain_no_password(command, tmp_path, monkeypatch, capfd, caplog):
    caplog.set_level(logging.DEBUG)
    monkeypatch.chdir(tmp_path)
    write_clip(tmp_path / "clip.mp4", 3)
    for address in MISTYPED:
        words = [word.replace("SOURCE", address) for word in COMMANDS[command]]
        assert main(words) == 2
        streams = capfd.readouterr()
        assert streams.err.count("\n") == 1
        for text in (streams.out, streams.err, caplog.text, *map(str, tmp_path.rglob("*"))):
            assert "hunter2" not in text, address


@pytest.mark.parametrize("address", MISTYPED)
def test_errors_of_the_library_contain_no_password(address):
    for opened in (open_source, check_reversible, lambda spec: open_feed(spec, notify=print)):
        with pytest.raises(SourceError) as caught:
            opened(address)
        assert "hunter2" not in str(caught.value)
    assert "hunter2" not in repr(SourceOptions(address))


def test_a_mistyped_address_is_explained():
    with pytest.raises(SourceError, match="SCHEME://HOST/PATH"):
        open_source("rtsp:/cam/live")


def test_the_log_of_a_feed_contains_no_password(caplog):
    def images():
        yield 0.0, np.zeros((48, 64, 3), np.uint8)
        raise RuntimeError("rtsp://u:{}@cam".format("hunter2"))

    notes = []
    source = Source("rtsp://cam", images(), fps=Fraction(25), length=None)
    feed = PacedFeed(source, notes.append)
    wait_for(lambda: notes)
    feed.close()
    assert "rtsp://cam" in caplog.text
    assert "RuntimeError" in caplog.text
    assert "hunter2@" not in caplog.text


def test_words_are_redacted_as_they_are_and_quoted():
    words = ["track", "--out=rtsp:/u:p'w@cam/live"]
    for text in ("rtsp:/u:p'w@cam/live", repr("rtsp:/u:p'w@cam/live")):
        assert "p'w" not in redact_words(text, words)


def test_a_stack_has_no_text_of_the_error():
    text = "rtsp://u:{}@cam".format("hunter2")
    try:
        raise RuntimeError(text)
    except RuntimeError as error:
        stack = stack_of(error)
    assert "RuntimeError" in stack
    assert "in test_a_stack_has_no_text" in stack
    assert "hunter2@" not in stack


LONG = "hunter2" * 20  # is cut off in messages
SHORTENED = [
    f"rtsp://anna:{LONG}@127.0.0.1:9/live",
    f"rtsp:/anna:{LONG}@127.0.0.1:9/live",
    f"http://127.0.0.1:9/live?token={LONG}",
    f"anna:{LONG}@127.0.0.1/live",
    f"rtsp://anna:x\\y'{LONG}@127.0.0.1:9/live",
    "rtsp://anna:\thunter2@127.0.0.1:9/live",
    "rtsp://anna:hunter2\udce9@127.0.0.1:9/live",
]


@pytest.mark.parametrize(
    "words",
    [["track", "x.mp4", "--box"], ["track", "x.mp4", "--raw"], ["export", "x.csv", "--fps"]],
)
def test_shortened_and_escaped_quotes_contain_no_password(words, capsys):
    """Messages quote the first 40 or 80 characters, or the repr of a part."""
    if words[0] == "export":
        words = ["export", "x.csv", "--to", "coco", "--out", "x.json", "--size", "4x4", "--fps"]
    for address in SHORTENED:
        assert main([*words, address]) == 2
        assert "hunter" not in capsys.readouterr().err, address


def test_a_link_says_no_password(caplog):
    address = "tcp:anna:hunter2@nowhere.invalid:5760"
    link = open_link(address)
    link.read(0)
    link.close()
    assert "nowhere.invalid:5760" in caplog.text
    with pytest.raises(ArgumentError, match="5760") as caught:
        open_link(address.replace("tcp", "udpout"))
    assert "hunter2" not in caplog.text + str(caught.value)


def test_no_folder_is_named_like_an_address(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for write in (make_folder, check_output):
        for address in ("rtsp://anna:hunter2@cam/live", "rtmp:/cam/anna?key=hunter2"):
            with pytest.raises(SinkError, match="is an address") as caught:
                write(Path(address))
            assert "hunter2" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []
    make_folder(tmp_path / "rtsp:")
    make_folder(Path("rtsp:/kept"))


def test_the_cause_of_an_unreachable_scheduler_has_no_password():
    pytest.importorskip("distributed")
    address = "tcp://anna:hunter2@127.0.0.1:9"
    with pytest.raises(ArgumentError, match=r"127\.0\.0\.1:9") as caught:
        list(in_parallel(str, ["1"], 1, cluster=address, failed=lambda item, reason: reason))
    assert "hunter2" not in "".join(traceback.format_exception(caught.value))
