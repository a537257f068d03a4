"""Virtual environments of other people's packages, and processes in them that answer in JSON.

Each package is installed with pip into a separate virtual environment, since the version
requirements of the packages conflict with each other and with this project.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class EstimatorFailed(Exception):
    """A package could not be installed or started, or failed on a clip."""


@dataclass(frozen=True)
class Requirements:
    """Packages that pip installs; `bare` ones without their dependencies."""

    whole: tuple[str, ...]
    bare: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join((*self.whole, *(f"{name} (bare)" for name in self.bare)))


def environment(name: str, requirements: Requirements, folder: Path) -> Path:
    """Interpreter of the virtual environment `folder`/`name`, created unless it is complete.

    Raises
    ------
    EstimatorFailed
        A package cannot be installed.
    """
    home = folder / name
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    complete = home / "installed.txt"
    if complete.is_file() and complete.read_text() == str(requirements):
        return python
    print(f"installing {name} into {home}", file=sys.stderr, flush=True)
    _call([sys.executable, "-m", "venv", "--clear", home])
    install: list[str | Path] = [python, "-m", "pip", "install", "--quiet", "--no-compile"]
    install.append("--disable-pip-version-check")
    _call([*install, *requirements.whole])
    if requirements.bare:
        _call([*install, "--no-deps", *requirements.bare])
    complete.write_text(str(requirements))
    return python


class JsonProcess:
    """A process that answers each line of JSON with one, and greets with one.

    Parameters
    ----------
    command : sequence of str or Path
    environment : dict, optional
        Further environment variables.

    Raises
    ------
    EstimatorFailed
        Its greeting has the key "failed", or it ended.
    """

    def __init__(
        self, command: Sequence[str | Path], environment: dict[str, str] | None = None
    ) -> None:
        self._command, self._environment = command, environment or {}
        self._process, self.greeting = self._started()

    def __enter__(self) -> JsonProcess:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._process.communicate()

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request.

        Raises
        ------
        EstimatorFailed
            The answer has the key "failed", or the process ended; the next request starts another.
        """
        if self._process.poll() is not None:
            self._process, self.greeting = self._started()
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return _answer(self._process)

    def _started(self) -> tuple[subprocess.Popen[str], dict[str, Any]]:
        process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | _ONE_THREAD | self._environment,
        )
        return process, _answer(process)


def _answer(process: subprocess.Popen[str]) -> dict[str, Any]:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise EstimatorFailed(f"the process ended with code {process.wait()}")
    answer: dict[str, Any] = json.loads(line)
    if "failed" in answer:
        raise EstimatorFailed(answer["failed"])
    return answer


def _call(command: list[str | Path]) -> None:
    """Run a command; raise `EstimatorFailed` with its last error message if it fails."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines()
        errors = [line for line in lines if line.startswith("ERROR")] or lines
        reason = errors[-1] if errors else f"exit code {done.returncode}"
        raise EstimatorFailed(f"not installed: {reason}")
