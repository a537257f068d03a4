"""Calls that write one file over and over, for processes that do so at the same time."""

from ssiam.outputs import atomic_write, check_output
from ssiam.unfinished import staging_folder

REPEATS = 150


def write_often(path):
    for _ in range(REPEATS):
        with atomic_write(path, "w", hidden=True) as file:
            file.write("text")


def check_often(path):
    for _ in range(REPEATS):
        check_output(path)


def stage_often(path):
    for _ in range(REPEATS):
        with staging_folder(path.parent, ".x-") as folder:
            (folder / "file").write_text("1")
