"""`ssiam.outputs`: files are compared by identity and written atomically."""

from __future__ import annotations

import os

import pytest

from ssiam.errors import ArgumentError, SinkError
from ssiam.outputs import (
    PartFile,
    atomic_write,
    check_distinct,
    check_output,
    is_stream,
    leftover_parts,
    make_folder,
)


def test_files_are_compared_by_identity(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).write_text(name)
    os.link(tmp_path / "a", tmp_path / "hard")
    (tmp_path / "soft").symlink_to("hard")
    (tmp_path / "loop").symlink_to("loop")
    check_distinct([("--out", tmp_path / "b")], [("the source", tmp_path / "a")])
    check_distinct([("--out", tmp_path / "loop")], [("the source", tmp_path / "a")])
    for name in ("a", "hard", "soft", "../" + tmp_path.name + "/a"):
        with pytest.raises(ArgumentError, match="is the file of the source"):
            check_distinct([("--out", tmp_path / name)], [("the source", tmp_path / "a")])


def test_files_that_do_not_exist_yet_are_compared(tmp_path):
    (tmp_path / "link.csv").symlink_to("new.csv")
    outputs = [("--out", tmp_path / "new.csv"), ("--results", tmp_path / "link.csv")]
    with pytest.raises(ArgumentError, match=r"--out .* and --results .* are the same file"):
        check_distinct(outputs, [])
    same = tmp_path / "new.csv"
    with pytest.raises(ArgumentError, match="are the same file"):
        check_distinct([("--out", same), ("--results", same)], [])


def test_devices_may_be_given_twice(tmp_path):
    for name in ("a.csv", "b.png"):
        (tmp_path / name).symlink_to("/dev/null")
    outputs = [("--results", tmp_path / "a.csv"), ("--plot", tmp_path / "b.png")]
    check_distinct(outputs, [("the source", tmp_path / "a.csv")])
    assert is_stream(tmp_path / "a.csv")


def test_the_check_does_not_change_the_file(tmp_path):
    path = tmp_path / "out.mp4"
    path.write_text("older")
    before = path.stat().st_mtime_ns
    check_output(path)
    with pytest.raises(SinkError, match="exists already"):
        check_output(path, overwrite=False)
    assert (path.stat().st_mtime_ns, [each.name for each in tmp_path.iterdir()]) == (
        before,
        ["out.mp4"],
    )


@pytest.mark.parametrize("mode", ["w", "wb"])
def test_a_file_is_replaced_when_the_new_one_is_complete(tmp_path, mode):
    path, text = tmp_path / "out.xml", "new\n" if mode == "w" else b"new\n"
    path.write_text("older")
    with atomic_write(path, mode) as file:
        file.write(text)
        file.flush()
        assert path.read_text() == "older"
        assert leftover_parts(path) == [tmp_path / "out.part.xml"]
    assert path.read_text() == "new\n"
    assert leftover_parts(path) == []


def test_an_error_keeps_the_older_file_and_leaves_no_part_file(tmp_path):
    path = tmp_path / "out.xml"
    path.write_text("older")
    for error in (KeyboardInterrupt, ValueError):
        with pytest.raises(error), atomic_write(path, "w"):
            raise error
    with pytest.raises(SinkError, match=r"out\.xml: cannot be written"), atomic_write(path, "w"):
        raise OSError(28, "No space left on device")
    assert path.read_text() == "older"
    assert [each.name for each in tmp_path.iterdir()] == ["out.xml"]


def test_only_part_files_of_this_output_are_found(tmp_path):
    mine = ["clip.part-2.mp4", "clip.part.mp4"]
    others = ["clip.part.csv", "clip-2.part.mp4", "clip.part-x.mp4", "myclip.part.mp4", "clip.mp4"]
    for name in (*mine, *others):
        (tmp_path / name).write_text("")
    assert [path.name for path in leftover_parts(tmp_path / "clip.mp4")] == mine
    assert leftover_parts(tmp_path / "missing" / "clip.mp4") == []


def test_the_part_file_of_a_link_is_beside_its_target(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out.mp4").symlink_to("elsewhere/o.mp4")
    part = PartFile(tmp_path / "out.mp4")
    assert part.file == tmp_path / "elsewhere" / "o.part.mp4"
    assert leftover_parts(tmp_path / "out.mp4") == [part.location]
    part.finish()
    assert (tmp_path / "elsewhere" / "o.mp4").exists()
    assert part.location == tmp_path / "out.mp4"


def test_a_folder_is_made_with_its_parents_or_refused(tmp_path):
    for _ in range(2):
        make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    with pytest.raises(SinkError, match=r"file/b: cannot be written \(Not a directory\)"):
        make_folder(tmp_path / "file" / "b")
