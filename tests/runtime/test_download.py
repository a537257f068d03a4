"""Downloads from servers that are slow, cut, lie, redirect or have another file."""

import hashlib
import socket
import threading
import traceback
import tracemalloc
import urllib.request
from contextlib import suppress

import pytest

from helpers.file_server import serve
from ssiam.errors import WeightsError
from ssiam.runtime import download as downloads
from ssiam.runtime.download import download
from ssiam.runtime.model_zoo import PublishedFile

CONTENT = bytes(range(256)) * 1000
DIGEST = hashlib.sha256(CONTENT).hexdigest()


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    monkeypatch.setattr(downloads, "_WAIT", 0.0)
    monkeypatch.delenv("http_proxy", raising=False)


def published(address):
    return PublishedFile("file.bin", address, len(CONTENT), DIGEST)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    "bad",
    [
        pytest.param({}, id="good"),
        pytest.param({"pause": 0.1}, id="slow"),
        pytest.param({"cut_after": 60_000}, id="cut again and again"),
        pytest.param({"redirects": 3}, id="redirected"),
    ],
)
@pytest.mark.parametrize("known", [True, False])
def test_the_whole_file_arrives(tmp_path, bad, known):
    seen = []
    with serve(CONTENT, **bad) as (address, _):
        file = published(address) if known else PublishedFile("file.bin", address)
        path = download(file, tmp_path, lambda *counts: seen.append(counts))
    assert path.read_bytes() == CONTENT
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert names(tmp_path) == ["file.bin"]


def test_a_later_call_continues(tmp_path, monkeypatch):
    monkeypatch.setattr(downloads, "_ATTEMPTS", 1)
    with serve(CONTENT, cut_after=100_000, cuts=1) as (address, behavior):
        with pytest.raises(WeightsError, match=r"after 100000 bytes; run the command again"):
            download(published(address), tmp_path)
        assert download(published(address), tmp_path).read_bytes() == CONTENT
        assert behavior.requests[1]["Range"] == "bytes=100000-"


def test_a_file_that_changed_in_between_is_downloaded_from_the_start(tmp_path, monkeypatch):
    monkeypatch.setattr(downloads, "_ATTEMPTS", 1)
    with serve(bytes(len(CONTENT)), cut_after=100_000, cuts=1) as (address, behavior):
        with pytest.raises(WeightsError):
            download(PublishedFile("file.bin", address), tmp_path)
        behavior.content, behavior.tag = CONTENT, '"two"'
        path = download(PublishedFile("file.bin", address), tmp_path)
    assert path.read_bytes() == CONTENT


REFUSED = {
    "longer than it says": ({"length": len(CONTENT) + 1000}, "has 257000 bytes"),
    "shorter than it says": ({"length": 1000}, "has 1000 bytes, the published file has 256000"),
    "no such file": ({"status": 404}, "the server answers 404"),
    "broken server": ({"status": 503}, "the server answers 503, after 0 bytes"),
    "to a file": ({"redirects": 1, "target": "file:///etc/hostname"}, "is not followed"),
    "redirections without end": ({"redirects": 10**6}, "the server answers 302"),
}


@pytest.mark.parametrize(("bad", "message"), REFUSED.values(), ids=REFUSED)
def test_nothing_is_kept_of_what_is_refused(tmp_path, bad, message):
    with serve(CONTENT, **bad) as (address, _), pytest.raises(WeightsError) as caught:
        download(published(address), tmp_path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert names(tmp_path) == []


def test_bytes_that_never_arrive_are_given_up(tmp_path):
    with serve(CONTENT, length=len(CONTENT) + 1000, tag='W/"weak"') as (address, behavior):
        with pytest.raises(WeightsError, match="run the command again"):
            download(PublishedFile("file.bin", address), tmp_path)
        assert len(behavior.requests) <= 8
    assert not (tmp_path / "file.bin").exists()


def test_https_is_not_left():
    request = urllib.request.Request("https://weights.invalid/a")
    with pytest.raises(WeightsError, match="is not followed"):
        downloads._Redirects().redirect_request(request, None, 302, "", {}, "http://x.invalid/a")


SIGNED = "https://anna:hunter2@x.invalid/a?X-Signature=hunter2"


@pytest.mark.parametrize(
    "target",
    [f"ftp{SIGNED[5:]}", f"file{SIGNED[5:]}", "http://anna:hunter2", "http://[hunter2/a"],
    ids=["ftp", "file", "port", "brackets"],
)
def test_redirections_print_no_key(tmp_path, target):
    bad = {"redirects": 1, "target": target}
    with serve(CONTENT, **bad) as (address, _), pytest.raises(WeightsError) as caught:
        download(published(address), tmp_path)
    assert "hunter2" not in "".join(traceback.format_exception(caught.value))


def test_from_https_a_signed_address_is_not_printed():
    request = urllib.request.Request(SIGNED)
    target, redirects = SIGNED.replace("https", "http"), downloads._Redirects()
    with pytest.raises(WeightsError, match=r"https://x\.invalid/a: redirects to http:") as caught:
        redirects.redirect_request(request, None, 302, "", {}, target)
    assert "hunter2" not in str(caught.value)


@pytest.mark.parametrize("proxy", ["http:/anna:hunter2@127.0.0.1:9", "//anna:hunter2"])
def test_a_proxy_that_is_mistyped_is_one_line_without_its_password(tmp_path, monkeypatch, proxy):
    monkeypatch.setenv("http_proxy", proxy)
    with pytest.raises(WeightsError, match="that of the proxy") as caught:
        download(published("http://weights.invalid/file.bin"), tmp_path)
    assert "hunter2" not in "".join(traceback.format_exception(caught.value))


def _answered(tmp_path, answer):
    """Download from a server that sends these bytes to every request; returns the error."""
    server = socket.create_server(("127.0.0.1", 0))

    def run():
        with suppress(OSError):
            while True:
                client, _ = server.accept()
                with client, suppress(OSError):
                    client.recv(1 << 16)
                    for part in answer:
                        client.sendall(part)

    threading.Thread(target=run, daemon=True).start()
    address = f"http://127.0.0.1:{server.getsockname()[1]}/file.bin"
    with server, pytest.raises(WeightsError) as caught:
        download(PublishedFile("file.bin", address, len(CONTENT), DIGEST), tmp_path)
    return str(caught.value)


BOMB = [bytes(1 << 20)] * 24


def _peak(call):
    tracemalloc.start()
    try:
        message = call()
        return message, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "head",
    [
        b"HTTP/1.1 302 Found\r\nLocation: ftp://x/\r\n\r\n",
        b"HTTP/1.1 302 Found\r\nLocation: /again\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n-1\r\n",
    ],
    ids=["refused redirection", "redirection", "negative chunk"],
)
def test_what_a_server_sends_without_end_is_not_kept(tmp_path, head):
    _, peak = _peak(lambda: _answered(tmp_path, [head, *BOMB]))
    assert peak < 8e6


def test_words_of_a_server_are_short_and_printable(tmp_path):
    message = _answered(tmp_path, [b"HTTP/1.1 404 \x1b[31m" + b"x" * 5000 + b"\r\n\r\n"])
    assert "\x1b" not in message
    assert len(message) < 300


def test_another_part_than_the_one_that_is_missing_is_not_appended(tmp_path):
    (tmp_path / "file.bin.part").write_bytes(CONTENT[:100])
    (tmp_path / "file.bin.part.tag").write_bytes(b'"\xff')  # is no reason to fail either
    part = f"Content-Range: bytes 0-{len(CONTENT) - 101}/{len(CONTENT)}\r\n\r\n".encode()
    message = _answered(tmp_path, [b"HTTP/1.1 206 Part\r\n" + part + CONTENT[:-100]])
    assert "SHA-256" not in message
    kept = tmp_path / "file.bin.part"
    assert not kept.exists() or CONTENT.startswith(kept.read_bytes())


def test_another_file_of_the_same_size_is_discarded(tmp_path):
    message = f"the published file has {DIGEST}"
    with serve(bytes(len(CONTENT))) as (address, _), pytest.raises(WeightsError, match=message):
        download(published(address), tmp_path)
    assert names(tmp_path) == []


def test_a_proxy_of_the_environment_is_used(tmp_path, monkeypatch):
    with serve(CONTENT) as (address, behavior):
        monkeypatch.setenv("http_proxy", address.removesuffix("/file.bin"))
        download(published("http://weights.invalid/file.bin"), tmp_path)
    assert behavior.requests[0]["path"] == "http://weights.invalid/file.bin"
