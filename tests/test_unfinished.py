"""What killed processes have left is removed by the next one; what is in use is kept."""

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from helpers.part_writers import check_often, stage_often, write_often
from ssiam import unfinished
from ssiam.errors import SinkError
from ssiam.outputs import atomic_write
from ssiam.runtime.files import cache_folder
from ssiam.runtime.manifest import Manifest, atomic_export
from ssiam.trackers.lite import SHIPPED
from ssiam.trackers.weight_imports import copy_files
from ssiam.unfinished import hold, remove_abandoned, staging_folder
from ssiam.web.recording_files import RecordingFolder, RecordingMetadata

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no flock")


def _left(folder, name):
    """A folder with a file, as a process leaves it that is killed."""
    path = folder / name
    path.mkdir(parents=True)
    (path / "template.onnx").write_bytes(bytes(10))
    return path


def test_an_import_removes_those_that_were_killed(tmp_path):
    left = _left(tmp_path, ".import-ab12")
    copy_files([SHIPPED / "network.json"], tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["network.json"]
    assert not left.exists()


def test_an_export_removes_those_that_were_killed(tmp_path):
    left = _left(tmp_path, ".export-ab12")
    with atomic_export(tmp_path) as temporary:
        (temporary / "mask.onnx").write_bytes(b"")
        Manifest("mask", "box_mask", "0" * 64, ("mask",)).write(temporary)
    assert not left.exists()


def test_a_compiled_network_removes_those_that_were_killed(tmp_path, monkeypatch):
    pytest.importorskip("onnx")
    from helpers.onnx_networks import small_network
    from ssiam.runtime.openvino import load_with_shared_weights

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    left = _left(cache_folder() / "openvino", ".joint-ab12")
    files = [tmp_path / name for name in ("template.onnx", "search.onnx")]
    for file in files:
        file.write_bytes(small_network())
    load_with_shared_weights(files, "0" * 32)
    assert not left.exists()


def test_a_result_removes_the_parts_that_were_killed(tmp_path):
    for name in (".a_001.txt.part", ".a_001.txt.part-2", ".b_001.txt.part"):
        (tmp_path / name).touch()
    with atomic_write(tmp_path / "a_001.txt", "w", hidden=True) as file:
        file.write("1")
    assert sorted(each.name for each in tmp_path.iterdir()) == [".b_001.txt.part", "a_001.txt"]


def test_a_recording_removes_the_metadata_that_were_killed(tmp_path):
    (tmp_path / ".recording.json.part").touch()
    RecordingFolder(tmp_path).write_metadata(RecordingMetadata("25"))
    assert [each.name for each in tmp_path.iterdir()] == ["recording.json"]


def test_what_is_in_use_is_kept(tmp_path):
    path = tmp_path / "a.txt"
    with atomic_write(path, "w", hidden=True) as first, staging_folder(tmp_path, ".x-") as folder:
        with atomic_write(path, "w", hidden=True) as second, staging_folder(tmp_path, ".x-"):
            second.write("second")
        assert folder.is_dir()
        assert path.read_text() == "second"
        first.write("first")
    assert path.read_text() == "first"
    assert [each.name for each in tmp_path.iterdir()] == ["a.txt"]


def test_processes_that_write_one_file_do_not_disturb_each_other(tmp_path):
    path = tmp_path / "run.json"
    with ProcessPoolExecutor(4, mp_context=get_context("spawn")) as processes:
        calls = write_often, write_often, check_often, stage_often
        done = [processes.submit(call, path) for call in calls]
    for each in done:
        each.result()
    assert [each.name for each in tmp_path.iterdir()] == ["run.json"]
    assert path.read_text() == "text"


def test_what_was_replaced_before_it_was_locked_is_kept(tmp_path, monkeypatch):
    path = tmp_path / ".a.part"
    path.write_text("abandoned")
    lock = unfinished.fcntl.flock

    def replace_and_lock(descriptor, how):
        path.unlink()
        path.write_text("new")
        lock(descriptor, how)

    monkeypatch.setattr(unfinished.fcntl, "flock", replace_and_lock)
    assert remove_abandoned([path]) == []
    assert path.read_text() == "new"


def test_links_and_files_of_others_are_kept(tmp_path, monkeypatch):
    target = _left(tmp_path, "target")
    link, other = tmp_path / ".x-link", _left(tmp_path, ".x-other")
    link.symlink_to(target)
    assert remove_abandoned([link, tmp_path / "missing"]) == [link]
    monkeypatch.setattr(os, "getuid", lambda: 2**31 - 5)
    assert remove_abandoned([other]) == [other]
    assert (target / "template.onnx").exists()


def test_without_locks_nothing_is_removed(tmp_path, monkeypatch):
    left = _left(tmp_path, ".x-ab12")
    monkeypatch.setattr(unfinished, "fcntl", None)
    assert hold(left) is None
    with staging_folder(tmp_path, ".x-"):
        assert left.exists()


def test_an_error_leaves_nothing(tmp_path):
    with pytest.raises(SinkError), atomic_write(tmp_path / "a", "w", hidden=True):
        raise OSError(28, "No space left on device")
    with pytest.raises(SinkError), staging_folder(tmp_path, ".x-") as folder:
        copy_files([SHIPPED / "missing"], folder)
    assert list(tmp_path.iterdir()) == []
