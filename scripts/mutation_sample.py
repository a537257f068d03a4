"""Measure how many random mutants the tests kill: small wrong changes of the code.

    python scripts/mutation_sample.py [--seed N] [--count N]

Draws mutants of geometry, motion, stabilize, trackers and evaluation (`mutation_sites.py`), and
runs for each the tests that run the changed lines (`mutation_coverage.py`), the fastest first,
until one fails (`mutation_worker.py`). A mutant that no test notices survives; survivors with a
known reason are named in `mutation_survivors.toml`. Prints each survivor, and the score with and
without the named ones. Exits with 1 if the score of all mutants is below 92 %.

Works in a copy of the project's files in `build/mutation`, without the shared test data, and in one
process. The first run measures the coverage of all tests. A run that was stopped continues: results
are kept by seed, those of survivors until the tests change, all until the changed file does.

`mutants.py` is the other tool: mutants named by hand, each with the test that must notice it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import pytest
from mutation_coverage import CoverageByTest, measure
from mutation_sites import count_mutants, mutant
from mutation_worker import TIMEOUT, UNCHANGED, Worker, run_tests, run_tests_changed

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT: Final = Path(__file__).parents[1]
WORK: Final = ROOT / "build" / "mutation"
SURVIVORS: Final = Path(__file__).with_name("mutation_survivors.toml")
SOURCES: Final = (
    "src/ssiam/geometry.py",
    "src/ssiam/motion",
    "src/ssiam/stabilize",
    "src/ssiam/trackers",
    "src/ssiam/evaluation",
)
TESTS: Final = (
    "tests/test_geometry.py",
    "tests/motion",
    "tests/stabilize",
    "tests/trackers",
    "tests/evaluation",
    "tests/cli/test_eval.py",
    "tests/cli/test_eval_layouts.py",
    "tests/cli/test_eval_one_pass.py",
    "tests/cli/test_shaken_results.py",
    "tests/cli/test_tables.py",
    "tests/cli/test_weights_import.py",
)
# Numbers copied from publications: a test could only repeat them.
TRANSCRIBED: Final = "src/ssiam/evaluation/paper/published.py"

OUTCOMES: Final = {
    int(pytest.ExitCode.OK): "survived",
    int(pytest.ExitCode.NO_TESTS_COLLECTED): "no tests",
    TIMEOUT: "timeout",
}

GOAL: Final = 0.92  # share of killed mutants
_TIMES_LONGER: Final = 5.0  # than usual is a timeout
_START_S: Final = 30.0  # to import the tests
_MOST_S: Final = 30.0  # of chosen tests
_MEASURE_S: Final = 7200.0


@dataclass(frozen=True)
class Result:
    """A tested mutant.

    Attributes
    ----------
    file : str
    index : int
        Of the change, among those of the file.
    line : int
    old, new : str
        The lines before and after.
    outcome : str
        "killed", "timeout" (killed too), "survived" or "no tests".
    tests : int
        Number of chosen tests.
    seconds : float
    versions : list of str
        Digests of the file and of all tests.
    """

    file: str
    index: int
    line: int
    old: str
    new: str
    outcome: str
    tests: int
    seconds: float
    versions: list[str]

    @property
    def killed(self) -> bool:
        """Whether a test failed, or did not come to its end."""
        return self.outcome in ("killed", "timeout")


def main() -> int:
    """Draw and test the mutants, and print the survivors; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default: 1)")
    parser.add_argument("--count", type=int, default=300, help="mutants (default: 300)")
    arguments = parser.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    project = copy_project(WORK / "project")
    drawn = draw(count_all(project), arguments.seed, arguments.count)
    results = test_all(project, drawn, WORK / f"seed-{arguments.seed}.jsonl")
    print(f"\nseed {arguments.seed}, {len(results)} mutants")
    return report(results, read_reasons(SURVIVORS))


def copy_project(folder: Path) -> Path:
    """Bring the tracked files' copy in `folder` up to date; returns the folder.

    Unchanged files keep their times, and with them their compiled files.
    """
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    files = {name for name in listing.stdout.splitlines() if (ROOT / name).is_file()}
    for old in folder.rglob("*"):
        if old.is_file() and old.suffix != ".pyc" and str(old.relative_to(folder)) not in files:
            old.unlink()
    for name in files:
        target = folder / name
        if not target.is_file() or target.read_bytes() != (ROOT / name).read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)
    return folder


def count_all(project: Path) -> dict[str, int]:
    """The number of mutants of each file; counted once for each content of the file."""
    path = WORK / "counts.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    counts = {file: f"{file} {digest([project / file])}" for file in source_files(project)}
    found = {key: known.get(key) or count_mutants(project, file) for file, key in counts.items()}
    path.write_text(json.dumps(found), encoding="utf-8")
    return {file: found[key] for file, key in counts.items()}


def draw(counts: dict[str, int], seed: int, count: int) -> list[tuple[str, int]]:
    """Random mutants by file and index; a larger sample of a seed begins with the smaller ones."""
    every = [(file, index) for file, number in counts.items() for index in range(number)]
    random.Random(seed).shuffle(every)
    return every[:count]


def source_files(project: Path) -> list[str]:
    """The files that are changed, relative to the project."""
    return sorted(set(python_files(project, SOURCES)) - {TRANSCRIBED})


def python_files(project: Path, names: tuple[str, ...]) -> list[str]:
    """Files, and the Python files in folders, relative to the project."""
    found: list[Path] = []
    for name in names:
        found += [project / name] if name.endswith(".py") else (project / name).rglob("*.py")
    return sorted(str(path.relative_to(project)) for path in found)


def test_all(project: Path, drawn: list[tuple[str, int]], path: Path) -> list[Result]:
    """Test each mutant that has no valid result in the file of results yet."""
    done = {(result.file, result.index): result for result in read_results(path)}
    tests_version = digest(sorted((project / "tests").rglob("*.py")))
    results = []
    bench = None
    with path.open("a", encoding="utf-8") as stream:
        for number, (file, index) in enumerate(drawn, 1):
            versions = [digest([project / file]), tests_version]
            result = done.get((file, index))
            if result is None or not still_valid(result, versions):
                bench = bench or Bench(project)
                result = bench.test(file, index, versions)
                stream.write(json.dumps(vars(result)) + "\n")
                stream.flush()
                print(f"{number:4d} {result.outcome:9s}{result.seconds:6.1f} s  {file}", flush=True)
            results.append(result)
    return results


class Bench:
    """Two workers, and the coverage of the tests.

    Parameters
    ----------
    project : Path
        The copy.
    """

    def __init__(self, project: Path) -> None:
        self._project = project
        self._bare = Worker(project)
        self._warm = Worker(project, TESTS)
        self._measured = measured_tests(project, self._warm)

    def test(self, file: str, index: int, versions: list[str]) -> Result:
        """Test a mutant: write its file, run the tests, and write the original back."""
        start = time.monotonic()
        changed = mutant(self._project, file, index)
        chosen = self._measured.choose(self._project, file, changed.lines, changed.names)
        tests, usual = affordable(chosen, self._measured)
        path = self._project / file
        original, times = path.read_bytes(), path.stat()
        path.write_text(changed.text, encoding="utf-8")
        try:
            code = self._run(path, changed.text, tests, _START_S + _TIMES_LONGER * usual)
        finally:
            path.write_bytes(original)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        return Result(
            file,
            index,
            changed.lines.start,
            changed.old,
            changed.new,
            OUTCOMES.get(code, "killed"),
            len(tests),
            round(time.monotonic() - start, 1),
            versions,
        )

    def _run(self, path: Path, text: str, tests: list[str], limit: float) -> int:
        if not tests:
            return int(pytest.ExitCode.NO_TESTS_COLLECTED)
        code = self._warm.run(partial(run_tests_changed, path, text, tests), limit)
        if code in (UNCHANGED, pytest.ExitCode.OK):
            code = self._bare.run(partial(run_tests, tests), limit)
        return code


def measured_tests(project: Path, worker: Worker) -> CoverageByTest:
    """The coverage of each test; measures the test files that have changed."""
    folder = WORK / "coverage"
    folder.mkdir(exist_ok=True)
    files = source_files(project)
    sources = digest([project / file for file in files])
    seconds: dict[str, float] = {}
    tests: dict[str, dict[str, list[str]]] = {file: {} for file in files}
    for test_file in python_files(project, TESTS):
        if not Path(test_file).name.startswith("test_"):
            continue
        version = digest([project / test_file])
        path = folder / f"{Path(test_file).stem}-{sources}-{version}.json"
        if not path.is_file():
            print(f"measuring {test_file}", flush=True)
            action = partial(write_coverage, project, files, test_file, path)
            code = worker.run(action, _MEASURE_S)
            if code:
                print(f"{test_file} is not used: code {code}, see {WORK / 'output.txt'}")
                continue
        part = CoverageByTest.read(path)
        seconds |= part.seconds
        for file, lines in part.tests.items():
            for line, names in lines.items():
                tests[file].setdefault(line, []).extend(names)
    return CoverageByTest(seconds, tests)


def write_coverage(project: Path, files: list[str], test_file: str, path: Path) -> int:
    """Measure a test file in this process."""
    measure(project, files, [test_file]).write(path)
    return 0


def affordable(tests: list[str], measured: CoverageByTest) -> tuple[list[str], float]:
    """The first tests that take less than 30 s together, or one test; and their time."""
    chosen, total = tests[:1], measured.seconds[tests[0]] if tests else 0.0
    for test_name in tests[1:]:
        total += measured.seconds[test_name]
        if total > _MOST_S:
            break
        chosen.append(test_name)
    return chosen, total


def read_results(path: Path) -> list[Result]:
    """The results of earlier runs, in their order."""
    if not path.is_file():
        return []
    return [Result(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def still_valid(result: Result, versions: list[str]) -> bool:
    """Whether the changed file is the same, and for a survivor the tests too."""
    return result.versions[0] == versions[0] and (result.killed or result.versions == versions)


def digest(paths: list[Path]) -> str:
    """Of files' contents: 12 hexadecimal digits."""
    total = hashlib.sha256()
    for path in paths:
        total.update(path.read_bytes())
    return total.hexdigest()[:12]


def read_reasons(path: Path) -> dict[tuple[str, str, str], str]:
    """Why named mutants survive: by file, old and new line."""
    with path.open("rb") as file:
        tables = tomllib.load(file).get("survivor", [])
    return {(table["file"], table["old"], table["new"]): table["reason"] for table in tables}


def report(results: list[Result], reasons: dict[tuple[str, str, str], str]) -> int:
    """Print the survivors and the score; returns the exit code."""
    survivors = [result for result in results if not result.killed]
    named = 0
    for result in survivors:
        reason = reasons.get((result.file, result.old, result.new))
        named += reason is not None
        print(f"\n{result.file}:{result.line}  {result.outcome}, {result.tests} tests")
        print(f"  - {result.old}\n  + {result.new}\n  {reason or 'no reason is known'}")
    counts = Counter(result.outcome for result in results)
    killed, total = len(results) - len(survivors), len(results)
    print(f"\n{', '.join(f'{outcome} {number}' for outcome, number in counts.most_common())}")
    print(f"killed: {killed} of {total}, {killed / total:.1%}")
    rest = max(total - named, 1)
    print(f"without {named} survivors with a reason: {killed} of {rest}, {killed / rest:.1%}")
    return 0 if killed >= GOAL * total else 1


if __name__ == "__main__":
    sys.exit(main())
