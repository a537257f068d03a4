"""Configs: valid files, and the one-line errors of invalid ones."""

from pathlib import Path

import pytest

pytest.importorskip("torch")

from ssiam.cli import main
from ssiam.training.config import read_config

SOURCE = '[[sources]]\nlayout = "davis"\npath = "x"\n'
CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize("path", sorted(CONFIGS.rglob("*.toml")), ids=lambda path: path.stem)
def test_all_configs_of_the_repository_are_valid(path):
    assert read_config(path).sources


def test_values_of_the_example_config():
    settings = read_config(CONFIGS / "lite.toml")
    assert settings.sources[0].layout == "davis"
    assert settings.teacher.weights == "weights/nanotrackv3"
    assert settings.validation.held_out[0].kind is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param("steps = ", "not valid TOML", id="no TOML"),
        pytest.param("steps = " + "9" * 5000, "number of too many digits", id="digits"),
        pytest.param("steps = " + "[" * 5000, "nested too deeply", id="deep"),
        pytest.param("a = " + "{b=" * 5000, "not valid TOML", id="deep tables"),
        pytest.param(f"steps = 0x{'f' * 5000}\n{SOURCE}", "of 20000 bits", id="hexadecimal"),
        pytest.param(f"steps = [0x{'f' * 5000}]\n{SOURCE}", "steps is a list", id="list"),
        pytest.param(
            f"[optimiser]\nlr = {'9' * 400}\n{SOURCE}",
            "optimiser.lr is an integer of 1329",
            id="no float",
        ),
        pytest.param("", "sources is missing", id="no sources"),
        pytest.param(f"stpes = 3\n{SOURCE}", "unknown key stpes; did you mean steps?", id="typo"),
        pytest.param(
            f"[pairs.augment]\nfilp = 1\n{SOURCE}",
            "unknown key pairs.augment.filp; did you mean flip?",
            id="typo in a table",
        ),
        pytest.param(f'steps = "3"\n{SOURCE}', "steps is '3': give an integer", id="string"),
        pytest.param(f"steps = true\n{SOURCE}", "steps is True: give an integer", id="flag"),
        pytest.param(f"steps = 0\n{SOURCE}", "steps 0 of a training run", id="zero"),
        pytest.param(f"losses = 3\n{SOURCE}", "losses is 3: give a table", id="no table"),
        pytest.param("sources = 3\n", "sources is 3: give a list", id="no list"),
        pytest.param(
            f'[losses]\nkind_of_box = "iou"\n{SOURCE}', "choose from giou, log_iou", id="choice"
        ),
        pytest.param("[[sources]]\npath = 'x'\n", r"sources[0].layout is missing", id="layout"),
        pytest.param(f"[network]\nattention = 1\n{SOURCE}", "give begin", id="no weights"),
        pytest.param(
            f'[network]\nbegin = "w"\nattention = -1\n{SOURCE}', "attention -1", id="attention"
        ),
    ],
)
def test_invalid_configs_give_a_one_line_error(tmp_path, capsys, text, message):
    path = tmp_path / "c.toml"
    path.write_text(text)
    assert main(["train", str(path), "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert "c.toml" in printed
    assert printed.count("\n") == 1


def test_a_missing_config(tmp_path, capsys):
    assert main(["train", str(tmp_path / "missing.toml")]) == 2
    assert "missing.toml cannot be read" in capsys.readouterr().err
