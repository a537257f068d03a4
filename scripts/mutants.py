"""Check that the tests detect known mutants: small wrong changes of the code.

    python scripts/mutants.py [NAME...]

Each mutant of `mutants.toml` is applied to a temporary copy of `src` and `tests`, and its test
file is run there without the shared test data. A failing test kills the mutant. Without names all
mutants are run. Exits with 1 if a mutant survives, if its text is not in the file exactly once, or
if the test file fails without the mutant too.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
TABLE = Path(__file__).with_name("mutants.toml")
COPIED = ("src", "tests", "pyproject.toml")

# Exit codes of pytest.
PASSED = 0
FAILED = 1


@dataclass(frozen=True)
class Mutant:
    """A wrong change of the code.

    Attributes
    ----------
    name : str
    file, test : str
        The changed file, and the test file that must fail; relative to the project.
    old, new : str
        The text that is replaced, which occurs once, and its replacement.
    """

    name: str
    file: str
    old: str
    new: str
    test: str


def main() -> int:
    """Run the mutants and print a line for each; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these mutants")
    chosen = select(read_table(TABLE), parser.parse_args().names)
    with tempfile.TemporaryDirectory() as temporary:
        project = copy_project(Path(temporary))
        unmutated = {test: run_test(project, test) for test in sorted({m.test for m in chosen})}
        outcomes = []
        for mutant in chosen:
            outcomes.append(outcome(project, mutant, unmutated[mutant.test]))
            print(f"{outcomes[-1]:10s}{mutant.name}  ({mutant.test})", flush=True)
    killed = outcomes.count("killed")
    print(f"{killed} of {len(chosen)} mutants killed")
    return 0 if killed == len(chosen) else 1


def read_table(path: Path) -> list[Mutant]:
    """The mutants of a TOML file with one table per mutant."""
    with path.open("rb") as file:
        return [Mutant(name, **fields) for name, fields in tomllib.load(file).items()]


def select(mutants: list[Mutant], names: list[str]) -> list[Mutant]:
    """The mutants with these names; all if there are no names."""
    unknown = set(names) - {mutant.name for mutant in mutants}
    if unknown:
        sys.exit(f"unknown mutants {', '.join(sorted(unknown))}: see {TABLE.name}")
    return [mutant for mutant in mutants if not names or mutant.name in names]


def copy_project(folder: Path) -> Path:
    """Copy the files that the tests need to `folder`, and return it."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder)
    return folder


def outcome(project: Path, mutant: Mutant, unmutated: int) -> str:
    """Test a mutant; returns "killed", "survived", "not found" or "no test"."""
    path = project / mutant.file
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    if text.count(mutant.old) != 1:
        return "not found"
    if unmutated != PASSED:
        return "no test"
    path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
    code = run_test(project, mutant.test)
    path.write_text(text, encoding="utf-8")
    return {PASSED: "survived", FAILED: "killed"}.get(code, "no test")


def run_test(project: Path, test: str) -> int:
    """Run a test file of the copy; returns pytest's exit code."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(project / "src"),
        # Two mutants written within a second would share a compiled file.
        "PYTHONDONTWRITEBYTECODE": "1",
        "SSIAM_SHARED": str(project / "absent"),
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", test]
    return subprocess.run(command, cwd=project, env=environment, capture_output=True).returncode


if __name__ == "__main__":
    sys.exit(main())
