"""`ssiam train` with missing inputs; complete runs are in tests/training."""

import os
import subprocess
import sys

import pytest

from ssiam.cli import main
from ssiam.outputs import atomic_write


def test_missing_pytorch_names_the_extra(tmp_path):
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "from ssiam.cli import main\n"
        "sys.exit(main(['train', 'lite.toml']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "pip install 'ssiam[train]'" in done.stderr


@pytest.mark.parametrize(
    ("content", "named"),
    [
        pytest.param(None, "lite.toml cannot be read", id="no file"),
        pytest.param("steps = ", "lite.toml", id="no TOML"),
        pytest.param("stepz = 5\n", "stepz", id="unknown key"),
        pytest.param('[[sources]]\nlayout = "davis"\npath = "missing"\n', "missing", id="no data"),
    ],
)
def test_invalid_config_gives_one_line_error(tmp_path, monkeypatch, capsys, content, named):
    monkeypatch.chdir(tmp_path)
    if content is not None:
        (tmp_path / "lite.toml").write_text(content)
    assert main(["train", "lite.toml"]) == 2
    error = capsys.readouterr().err
    assert named in error
    assert error.count("\n") == 1


_KILLED = """
import os, signal, sys
from pathlib import Path
from ssiam.outputs import atomic_write
from ssiam.runtime.manifest import atomic_export
folder = Path(sys.argv[1])
with atomic_export(folder), atomic_write(folder / "checkpoint.pth", "wb", hidden=True) as file:
    file.write(bytes(10))
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_leftovers_of_a_killed_run_are_removed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lite.toml").write_text('[[sources]]\nlayout = "davis"\npath = "missing"\n')
    folder = tmp_path / "runs" / "lite"
    folder.mkdir(parents=True)
    assert main(["train", "lite.toml"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    subprocess.run([sys.executable, "-c", _KILLED, str(folder)], timeout=60)
    export, part = next(folder.glob(".export-*")), folder / ".checkpoint.pth.part"
    assert part.exists()
    (folder / ".checkpoint.pth.4711").touch()  # as earlier versions called them
    (folder / "checkpoint.pth.old").touch()
    with atomic_write(folder / "metrics.csv", "w", hidden=True):  # of a run that goes on
        assert main(["train", "lite.toml"]) == 2
    *listed, error = capsys.readouterr().err.splitlines()
    assert "missing" in error
    names = (".metrics.csv.part", ".checkpoint.pth.4711")
    assert [line.split()[1].rpartition("/")[2] for line in listed] == list(names)
    assert all("killed or is still running; it is kept" in line for line in listed)
    assert not export.exists()
    assert not part.exists()
