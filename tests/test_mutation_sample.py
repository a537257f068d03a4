"""scripts/mutation_sample.py: what it changes, which tests it chooses, which survivors it names."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("mutmut")
ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from mutation_coverage import CoverageByTest  # noqa: E402
from mutation_sample import SURVIVORS, draw, read_reasons  # noqa: E402
from mutation_sites import count_mutants, mutant  # noqa: E402

CODE = '''
"""A module."""
from typing import Final, Literal

Side = Literal["left", "right"]
_LIMIT: Final = 3  # pixels


class Box:
    """A box."""

    side: Side = "left"

    @property
    def far(self) -> bool:
        """Whether it is far."""
        if self.x is None:
            raise ValueError(f"x is {self.x}: give a number")
        return self.x > _LIMIT

    def __repr__(self) -> str:
        return "Box"
'''

SLOW, QUICK, OTHER = (f"test_box.py::test_{name}" for name in ("slow", "quick", "other"))
LIMIT = "test_limit.py::test_limit"


def changes(folder, code):
    (folder / "box.py").write_text(code)
    return [mutant(folder, "box.py", index) for index in range(count_mutants(folder, "box.py"))]


def test_constants_fields_and_properties_are_changed(tmp_path):
    found = {(change.old, change.new) for change in changes(tmp_path, CODE)}
    assert ("_LIMIT: Final = 3  # pixels", "_LIMIT: Final = 4  # pixels") in found
    assert ('side: Side = "left"', 'side: Side = "LEFT"') in found
    assert ("return self.x > _LIMIT", "return self.x >= _LIMIT") in found
    assert ("if self.x is None:", "if self.x is not None:") in found


def test_texts_types_and_assertions_are_not_changed(tmp_path):
    code = CODE + "\n\ndef pairs(a: int = 1, b=2):\n    return zip(a, b, strict=True)\n"
    lines = {change.old for change in changes(tmp_path, code)}
    assert lines == {
        "_LIMIT: Final = 3  # pixels",
        'side: Side = "left"',
        "if self.x is None:",
        "return self.x > _LIMIT",
        "def pairs(a: int = 1, b=2):",
        "return zip(a, b, strict=True)",
    }
    assert all("strict=True" in c.new for c in changes(tmp_path, code) if "strict" in c.old)


def test_each_change_is_valid_code(tmp_path):
    code = (ROOT / "src/ssiam/stabilize/judge.py").read_text(encoding="utf-8")
    for change in changes(tmp_path, code):
        compile(change.text, change.file, "exec")
        assert change.old != change.new


@pytest.fixture
def measured(tmp_path):
    (tmp_path / "box.py").write_text(CODE)
    (tmp_path / "other.py").write_text("from box import _LIMIT\nprint(_LIMIT)\n")
    (tmp_path / "test_box.py").write_text("from box import Box\n")
    (tmp_path / "test_limit.py").write_text("from box import _LIMIT\n")
    tests = {
        "box.py": {"17": [SLOW, QUICK], "19": [SLOW]},
        "other.py": {"2": [OTHER]},
    }
    return CoverageByTest({SLOW: 2.0, QUICK: 0.1, OTHER: 1.0, LIMIT: 3.0}, tests)


def test_tests_of_a_line_are_chosen_the_fastest_first(tmp_path, measured):
    assert measured.choose(tmp_path, "box.py", range(17, 20), frozenset()) == [QUICK, SLOW]


def test_tests_of_a_constant_are_those_of_the_lines_and_files_that_mention_it(tmp_path, measured):
    found = measured.choose(tmp_path, "box.py", range(6, 7), frozenset({"_LIMIT"}))
    assert found == [OTHER, SLOW, LIMIT]


def test_tests_of_what_nobody_mentions_are_those_of_the_file(tmp_path, measured):
    assert measured.choose(tmp_path, "box.py", range(1, 2), frozenset()) == [QUICK, SLOW]


def test_a_larger_sample_continues_a_smaller_one():
    counts = {"a.py": 30, "b.py": 50}
    assert draw(counts, 3, 60)[:20] == draw(counts, 3, 20)
    assert draw(counts, 4, 20) != draw(counts, 3, 20)


@pytest.mark.parametrize(("file", "old", "new"), read_reasons(SURVIVORS))
def test_named_survivors_are_changes_of_the_code(file, old, new):
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    assert old in " ".join(line.strip() for line in lines)
    assert old != new
