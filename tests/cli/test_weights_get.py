"""`ssiam weights get`: from an address to a tracker, or to the place where a person gets it."""

import sys
from dataclasses import replace

import pytest

import ssiam
from helpers.file_server import serve
from ssiam.cli import main
from ssiam.runtime import MODEL_ZOO, download
from ssiam.runtime.files import sha256


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(download, "_WAIT", 0.0)
    return tmp_path / "cache" / "ssiam" / "weights"


def test_nanotrack_is_downloaded_checked_and_tracks(shared, store, monkeypatch, capsys):
    published = MODEL_ZOO["nanotrack_v3"]
    first, second = (shared("data/weights/nanotrackv3") / each.name for each in published.files)
    with serve(first.read_bytes(), cut_after=10**6) as (one, _), serve(second.read_bytes()) as two:
        files = (
            replace(published.files[0], address=one),
            replace(published.files[1], address=two[0]),
        )
        monkeypatch.setitem(MODEL_ZOO, "nanotrack_v3", replace(published, files=files))
        assert main(["weights", "get", "nanotrack_v3"]) == 0
    assert f"stored in {store / 'nanotrack_v3'} for nanotrack_v3" in capsys.readouterr().out
    for file in published.files:
        assert sha256(store / "nanotrack_v3" / file.name) == file.sha256
    assert not (store.parent / "downloads" / "nanotrack_v3").exists()
    ssiam.load_tracker("nanotrack_v3")
    assert main(["weights", "get", "nanotrack_v3"]) == 0
    assert "nothing to do" in capsys.readouterr().out


def test_a_web_page_in_place_of_a_checkpoint_is_refused(store, monkeypatch, capsys):
    pytest.importorskip("torch")
    published = MODEL_ZOO["siammask_vot"]
    with serve(b"<html>busy</html>") as (address, _):
        files = (replace(published.files[0], address=address),)
        monkeypatch.setitem(MODEL_ZOO, "siammask_vot", replace(published, files=files))
        assert main(["weights", "get", "siammask_vot"]) == 2
    error = capsys.readouterr().err
    assert "are a web page" in error
    assert error.count("\n") == 1
    assert not store.exists()
    assert not list(store.parent.rglob("*.pth"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        pytest.param(
            "siamrpn_alex_dwxcorr", ("MODEL_ZOO.md", "ssiam weights import model.pth"), id="page"
        ),
        pytest.param("siamfc", ("drive.google.com", "pip install gdown"), id="Google Drive"),
        pytest.param("csrt", ("unknown tracker with weights",), id="no weights"),
    ],
)
def test_what_cannot_be_downloaded_is_named(name, words, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "gdown", None)
    assert main(["weights", "get", name]) == 2
    error = capsys.readouterr().err
    assert all(word in error for word in words)
    assert error.count("\n") == 1
