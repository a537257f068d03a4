"""Which tests run a line: the coverage of each test, measured once, and the choice of tests."""

from __future__ import annotations

import json
import re
import signal
import time
from collections import defaultdict
from collections.abc import Generator, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import coverage
import pytest

_SLOW_S: Final = 30.0  # of processor time


@dataclass(frozen=True)
class CoverageByTest:
    """What each test runs, and for how long.

    Attributes
    ----------
    seconds : dict of str to float
        By pytest's node ID; the fixtures that it sets up included.
    tests : dict of str to dict of str to list of str
        By file and line number, the tests that run the line.
    """

    seconds: dict[str, float]
    tests: dict[str, dict[str, list[str]]]

    @classmethod
    def read(cls, path: Path) -> CoverageByTest:
        """Read what `write` wrote."""
        return cls(**json.loads(path.read_text(encoding="utf-8")))

    def write(self, path: Path) -> None:
        """Write a JSON file."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    def choose(
        self, project: Path, file: str, lines: range, names: frozenset[str] | None
    ) -> list[str]:
        """The tests of some lines of a file, the fastest first.

        Lines that run when the module is imported, which have `names`, belong to no test. Their
        tests are those of the lines that mention one of the names, and those in test files that do.
        Without any, all tests of the file are chosen.
        """
        found = self._of(file, lines)
        if not found and names:
            word = re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(names)))})\b")
            for other in self.tests:
                found |= self._of(other, _lines_with(word, project / other))
            test_files = {test.split("::")[0] for test in self.seconds}
            using = {name for name in test_files if any(_lines_with(word, project / name))}
            found |= {test for test in self.seconds if test.split("::")[0] in using}
        if not found and names is not None:
            found = self._of(file, map(int, self.tests.get(file, {})))
        return sorted(found, key=self.seconds.__getitem__)

    def _of(self, file: str, lines: Iterable[int]) -> set[str]:
        by_line = self.tests.get(file, {})
        return {test for line in lines for test in by_line.get(str(line), [])}


def _lines_with(word: re.Pattern[str], path: Path) -> list[int]:
    lines = path.read_text(encoding="utf-8").splitlines()
    return [number for number, line in enumerate(lines, 1) if word.search(line)]


def measure(project: Path, files: list[str], test_files: list[str]) -> CoverageByTest:
    """Run tests in this process, which must not have imported any of `files` before.

    Tests that fail or are skipped are left out: they cannot notice a change. So are slow tests,
    which are stopped.
    """
    signal.signal(signal.SIGPROF, _stop)
    paths = {str(project / file): file for file in files}
    measured = coverage.Coverage(data_file=None, include=list(paths), config_file=False)
    recorder = _Recorder(measured)
    measured.start()
    pytest.main(["-q", "-p", "no:cacheprovider", *test_files], plugins=[recorder])
    measured.stop()
    data = measured.get_data()
    tests = {
        name: {
            str(line): sorted(recorder.tests_of(contexts))
            for line, contexts in data.contexts_by_lineno(path).items()
        }
        for path, name in paths.items()
    }
    return CoverageByTest({test: recorder.seconds[test] for test in recorder.passed}, tests)


class _Recorder:
    """A pytest plugin that gives each test, and each fixture that tests share, its own context."""

    def __init__(self, measured: coverage.Coverage) -> None:
        self.seconds: dict[str, float] = {}
        self.passed: set[str] = set()
        self._measured = measured
        self._contexts = [""]
        self._users: dict[str, set[str]] = defaultdict(set)  # tests by shared fixture

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Measure a test."""
        for definitions in item._fixtureinfo.name2fixturedefs.values():  # type: ignore[attr-defined]
            for definition in definitions:
                self._users[_context(definition)].add(item.nodeid)
        self._enter(item.nodeid)
        start = time.perf_counter()
        signal.setitimer(signal.ITIMER_PROF, _SLOW_S)
        result = yield
        signal.setitimer(signal.ITIMER_PROF, 0)
        self.seconds[item.nodeid] = round(time.perf_counter() - start, 4)
        self._leave()
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note whether the test passed."""
        if report.when == "call" and report.passed:
            self.passed.add(report.nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Generator[None, Any, Any]:
        """Measure a fixture; the lines that it runs belong to all tests that use it."""
        if fixturedef.scope == "function":
            return (yield)
        self._enter(_context(fixturedef))
        try:
            return (yield)
        finally:
            self._leave()

    def tests_of(self, contexts: Iterable[str]) -> set[str]:
        """The tests of coverage contexts."""
        found = set()
        for context in contexts:
            found |= self._users.get(context, {context})
        return found & self.passed

    def _enter(self, context: str) -> None:
        self._contexts.append(context)
        self._measured.switch_context(context)

    def _leave(self) -> None:
        self._contexts.pop()
        self._measured.switch_context(self._contexts[-1])


def _stop(number: int, frame: object) -> None:
    raise TimeoutError(f"slower than {_SLOW_S} s of processor time")


def _context(fixture: Any) -> str:
    return f"fixture {fixture.baseid} {fixture.argname}"
