"""Run tests on a changed copy of the project, in forks of processes that have imported much.

A `Worker` is a process that runs actions, each in a fork of itself. A bare worker has imported the
large libraries, but nothing of the project: its forks import the changed file. A warm worker has
also imported the project and all tests: its forks replace the code of the changed functions, which
takes no time. A bare worker is for changes of what runs at import, and to confirm survivors.
"""

from __future__ import annotations

import gc
import importlib
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from types import CodeType, FunctionType
from typing import Final

import pytest

_LIBRARIES: Final = (
    "av",
    "cv2",
    "cyclopts",
    "hypothesis",
    "joblib",
    "matplotlib.figure",
    "numpy",
    "onnx",
    "openvino",
    "optuna",
    "rich",
    "torch",
)
_QUIET: Final = ("-q", "--tb=short", "-p", "no:cacheprovider")
_POLL: Final = 0.02  # s

UNCHANGED: Final = 100  # exit code: no function has changed
TIMEOUT: Final = 124  # exit code, as of timeout(1)

Action = Callable[[], int]


class Worker:
    """A process that runs actions in forks of itself.

    Parameters
    ----------
    project : Path
        The copy of the project; the working folder.
    collected : tuple of str
        Test files and folders to import.
    """

    def __init__(self, project: Path, collected: tuple[str, ...] = ()) -> None:
        context = multiprocessing.get_context("fork")
        self._connection, other = context.Pipe()
        # Not a daemon: daemons may not start processes, as some tests do.
        context.Process(target=_serve, args=(self._connection, other, project, collected)).start()
        other.close()

    def run(self, action: Action, limit: float) -> int:
        """Run an action, at most `limit` seconds; returns its exit code, or `TIMEOUT`."""
        self._connection.send((action, limit))
        code: int = self._connection.recv()
        return code


def run_tests(tests: list[str]) -> int:
    """Run tests in their order until one fails; returns pytest's exit code."""
    # A changed file and its original, written within a second, would share a compiled file.
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    code = pytest.main(["-x", *_QUIET, *tests], plugins=[_InThisOrder(tests)])
    if code == pytest.ExitCode.USAGE_ERROR:  # the change has renamed parameters of a test
        code = pytest.main(["-x", *_QUIET, *sorted({test.split("::")[0] for test in tests})])
    return int(code)


def run_tests_changed(path: Path, text: str, tests: list[str]) -> int:
    """Replace the code of an imported file's functions by that of `text`, and run the tests."""
    codes = {(code.co_name, code.co_firstlineno): code for code in _codes(path, text)}
    changed = 0
    for function in gc.get_objects():
        if type(function) is FunctionType and function.__code__.co_filename == str(path):
            old = function.__code__
            new = codes.get((old.co_name, old.co_firstlineno), old)
            if new != old and new.co_freevars == old.co_freevars:
                function.__code__ = new
                changed += 1
    return run_tests(tests) if changed else UNCHANGED


def _codes(path: Path, text: str) -> Iterator[CodeType]:
    waiting = [compile(text, str(path), "exec", dont_inherit=True)]
    while waiting:
        code = waiting.pop()
        yield code
        waiting += [constant for constant in code.co_consts if isinstance(constant, CodeType)]


def _serve(
    other: Connection, connection: Connection, project: Path, collected: tuple[str, ...]
) -> None:
    """Import, then run actions until the other end is closed."""
    other.close()
    os.chdir(project)
    os.environ.update(
        {
            "PYTHONPATH": str(project / "src"),
            "SSIAM_SHARED": str(project / "absent"),
            "OMP_WAIT_POLICY": "PASSIVE",
            "MPLBACKEND": "agg",
        }
    )
    sys.path.insert(0, str(project / "src"))
    sys.dont_write_bytecode = False  # forks of a bare worker need not compile again
    output = project.with_name("output.txt")
    _redirect(output.with_name("workers.txt"))
    for name in _LIBRARIES:
        with suppress(ImportError):
            importlib.import_module(name)
    if collected:
        pytest.main(["--collect-only", *_QUIET, *collected])
    with suppress(EOFError):
        while True:
            action, limit = connection.recv()
            connection.send(_forked(action, output, limit))


def _forked(action: Action, output: Path, limit: float) -> int:
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        code = int(pytest.ExitCode.INTERNAL_ERROR)
        try:
            os.setsid()
            _redirect(output)
            code = action()
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)
    end = time.monotonic() + limit
    code = TIMEOUT
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
            break
        time.sleep(_POLL)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    if code == TIMEOUT:
        os.waitpid(child, 0)
    return code


def _redirect(output: Path) -> None:
    file = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.close(file)


class _InThisOrder:
    """A pytest plugin that runs the tests in the order of the command line."""

    def __init__(self, tests: list[str]) -> None:
        self._order = {test: index for index, test in enumerate(tests)}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Sort the collected tests."""
        items.sort(key=lambda item: self._order.get(item.nodeid, len(self._order)))
