"""Downloads from servers that are slow, cut, lie, redirect or have another file."""

import hashlib
import urllib.request

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
