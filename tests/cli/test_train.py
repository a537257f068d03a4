"""`ssiam train` with missing inputs; complete runs are in tests/training."""

import subprocess
import sys

import pytest

from ssiam.cli import main


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
