"""`ssiam weights get`: from an address to a tracker, or to the place where a person gets it."""

import hashlib
import sys
from dataclasses import replace

import pytest

import ssiam
from helpers.file_server import serve
from ssiam.cli import main
from ssiam.errors import ArgumentError
from ssiam.runtime import MODEL_ZOO, download
from ssiam.runtime.files import sha256
from ssiam.runtime.model_zoo import OTHER_WEIGHTS


def digest(content):
    return hashlib.sha256(content).hexdigest()


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


def test_weights_that_no_tracker_runs_are_stored_with_what_they_are_for(
    store, tmp_path, monkeypatch, capsys
):
    first, second = b"template" * 1000, b"search" * 2000
    published = OTHER_WEIGHTS["fear_xs_coreml"]
    with serve(first) as (one, _), serve(second) as (two, _):
        files = tuple(
            replace(file, address=address, size=len(content), sha256=digest(content))
            for file, address, content in zip(
                published.files, (one, two), (first, second), strict=True
            )
        )
        monkeypatch.setitem(OTHER_WEIGHTS, "fear_xs_coreml", replace(published, files=files))
        assert main(["weights", "get", "fear_xs_coreml", "--folder", "mine"]) == 0
    assert (
        f"stored in mine/fear_xs_coreml, license MIT; use: {published.use}"
        in capsys.readouterr().out
    )
    stored = {path.name: path.read_bytes() for path in (tmp_path / "mine/fear_xs_coreml").iterdir()}
    assert stored == {"TrackerInit.mlmodel": first, "Tracker.mlmodel": second}
    assert main(["weights", "list", "--folder", "mine"]) == 0
    assert "fear_xs_coreml: mine/fear_xs_coreml (Core ML)" in capsys.readouterr().out
    assert main(["weights", "get", "fear_xs_coreml", "--folder", "mine"]) == 0
    assert "nothing to do" in capsys.readouterr().out
    with pytest.raises(ArgumentError, match="unknown tracker 'fear_xs_coreml'"):
        ssiam.load_tracker("fear_xs_coreml")


@pytest.mark.parametrize("has_terminal", [True, False])
def test_progress_is_shown_on_terminals(has_terminal, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("TTY_COMPATIBLE", str(int(has_terminal)))
    monkeypatch.setenv("COLUMNS", "120")
    published = OTHER_WEIGHTS["vittrack"]
    with serve(b"x" * 3000, pause=0.2) as (address, _):
        files = (replace(published.files[0], address=address, size=3000, sha256=None),)
        monkeypatch.setitem(OTHER_WEIGHTS, "vittrack", replace(published, files=files))
        assert main(["weights", "get", "vittrack"]) == 0
    error = capsys.readouterr().err
    assert ("/3.0 kB" in error) == has_terminal
    assert bool(error) == has_terminal
