"""The peers' throw-away environments, and the processes in which every estimator runs.

A peer is installed with pip into a virtual environment of its own, so that none of them needs to
agree with this project or with the others on versions.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

_SCRIPT = Path(__file__).with_name("motion_estimators.py")
_OPENCV = "opencv-contrib-python-headless>=4.10,<5"
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

PEERS = (
    "vidstab-gftt",
    "vidstab-orb",
    "vidgear",
    "norfair",
    "boxmot-sof",
    "boxmot-ecc",
    "boxmot-ecc-euclidean",
)


class EstimatorFailed(Exception):
    """An estimator could not be installed or started, or did not survive a clip."""


@dataclass(frozen=True)
class Requirements:
    """What pip installs for a peer; `bare` is installed without its dependencies."""

    whole: tuple[str, ...]
    bare: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join((*self.whole, *(f"{name} (bare)" for name in self.bare)))


# vidstab does not import with OpenCV 5. boxmot's camera motion needs none of its networks.
REQUIREMENTS = {
    "vidstab": Requirements(("vidstab==1.7.4", _OPENCV)),
    "vidgear": Requirements(("vidgear==0.3.6", _OPENCV)),
    "norfair": Requirements(("norfair==2.3.0", _OPENCV)),
    "boxmot": Requirements(("numpy>=2.2", "rich>=15", _OPENCV), bare=("boxmot==25.0.0",)),
}


@dataclass(frozen=True, eq=False)
class Run:
    """What an estimator said of a clip.

    Attributes
    ----------
    cur_from_prev : (N, 3, 3) float64
    reliable : (N,) bool
    ms : (N,) float64
        Milliseconds it took over each frame.
    """

    cur_from_prev: np.ndarray
    reliable: np.ndarray
    ms: np.ndarray


class Worker:
    """An estimator in a process of its own.

    Parameters
    ----------
    name : str
        "ssiam-direct", "vidstab-orb", ...: see `motion_estimators.load_estimator`.
    environments : Path
        Folder in which the peers' environments are made and found again.

    Raises
    ------
    EstimatorFailed
        The estimator cannot be installed or loaded.
    """

    def __init__(self, name: str, environments: Path) -> None:
        self.name = name
        family = name.split("-")[0]
        own = family not in REQUIREMENTS
        self._python = Path(sys.executable) if own else _environment(family, environments)
        self.versions: dict[str, str] = self._start()["versions"]

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._process.communicate()

    def run(self, clip: Path, *, exclude: bool) -> Run:
        """Run a new estimator over a saved clip, telling it the target's boxes or not.

        Raises
        ------
        EstimatorFailed
            It raised an exception, or its process ended; the next clip starts another.
        """
        if self._process.poll() is not None:
            self._start()
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"clip": str(clip), "exclude": exclude}) + "\n")
        self._process.stdin.flush()
        return Run(**{key: np.array(value) for key, value in self._answer().items()})

    def _start(self) -> dict[str, Any]:
        self._process = subprocess.Popen(
            [self._python, _SCRIPT, self.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | _ONE_THREAD,
        )
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise EstimatorFailed(f"the process ended with code {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        if "failed" in answer:
            raise EstimatorFailed(answer["failed"])
        return answer


def _environment(family: str, folder: Path) -> Path:
    """Interpreter of a peer's environment, which is made unless a complete one is there."""
    home = folder / family
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    complete = home / "installed.txt"
    wanted = REQUIREMENTS[family]
    if complete.is_file() and complete.read_text() == str(wanted):
        return python
    print(f"installing {family} into {home}", file=sys.stderr, flush=True)
    _call([sys.executable, "-m", "venv", "--clear", home])
    install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    _call([*install, *wanted.whole])
    if wanted.bare:
        _call([*install, "--no-deps", *wanted.bare])
    complete.write_text(str(wanted))
    return python


def _call(command: list[str | Path]) -> None:
    """Run a command, or tell the last of what it complained about."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines()
        errors = [line for line in lines if line.startswith("ERROR")] or lines
        reason = errors[-1] if errors else f"exit code {done.returncode}"
        raise EstimatorFailed(f"not installed: {reason}")
