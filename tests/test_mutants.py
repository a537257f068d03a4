"""Each mutant in scripts/mutants.toml can be applied; scripts/mutants.py runs them."""

import sys
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
MUTANTS = tomllib.loads((ROOT / "scripts" / "mutants.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", MUTANTS)
def test_each_mutant_can_be_applied(name):
    mutant = MUTANTS[name]
    text = (ROOT / mutant["file"]).read_text(encoding="utf-8")
    assert text.count(mutant["old"]) == 1
    changed = text.replace(mutant["old"], mutant["new"])
    assert changed != text
    compile(changed, mutant["file"], "exec")
    assert (ROOT / mutant["test"]).is_file()
