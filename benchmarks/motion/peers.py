"""Virtual environments of the peers, and the worker processes of all estimators.

Each peer is installed with pip into a separate virtual environment, since the version requirements
of the peers conflict with each other and with this project.
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
from numpy.typing import NDArray

_SCRIPT = Path(__file__).with_name("estimators.py")
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
    """An estimator could not be installed or started, or failed on a clip."""


@dataclass(frozen=True)
class Requirements:
    """Packages that pip installs for a peer; `bare` ones without their dependencies."""

    whole: tuple[str, ...]
    bare: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join((*self.whole, *(f"{name} (bare)" for name in self.bare)))


# vidstab cannot be imported with OpenCV 5. The camera motion of boxmot needs none of its networks.
REQUIREMENTS = {
    "vidstab": Requirements(("vidstab==1.7.4", _OPENCV)),
    "vidgear": Requirements(("vidgear==0.3.6", _OPENCV)),
    "norfair": Requirements(("norfair==2.3.0", _OPENCV)),
    "boxmot": Requirements(("numpy>=2.2", "rich>=15", _OPENCV), bare=("boxmot==25.0.0",)),
}


@dataclass(frozen=True, eq=False)
class Run:
    """Result of an estimator on a clip.

    Attributes
    ----------
    cur_from_prev : (N, 3, 3) float64
    reliable : (N,) bool
    ms : (N,) float64
        Milliseconds per frame.
    """

    cur_from_prev: NDArray[np.float64]
    reliable: NDArray[np.bool_]
    ms: NDArray[np.float64]


class Worker:
    """An estimator in a separate process.

    Parameters
    ----------
    name : str
        "ssiam-direct", "vidstab-orb", ...: see `estimators.load_estimator`.
    environments : Path
        Folder of the peers' virtual environments, created on first use.

    Raises
    ------
    EstimatorFailed
        The estimator cannot be installed or loaded.
    """

    def __init__(self, name: str, environments: Path) -> None:
        self.name = name
        family = name.split("-")[0]
        is_peer = family in REQUIREMENTS
        self._python = environment(family, environments) if is_peer else Path(sys.executable)
        self._process = self._started()
        self.versions: dict[str, str] = self._answer()["versions"]

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
        """Run a new estimator over a saved clip; `exclude` gives it the target's boxes.

        Raises
        ------
        EstimatorFailed
            It raised an exception, or its process ended; the next clip starts a new one.
        """
        if self._process.poll() is not None:
            self._process = self._started()
            self._answer()
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"clip": str(clip), "exclude": exclude}) + "\n")
        self._process.stdin.flush()
        return Run(**{key: np.array(value) for key, value in self._answer().items()})

    def _started(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [self._python, _SCRIPT, self.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | _ONE_THREAD,
        )

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise EstimatorFailed(f"the process ended with code {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        if "failed" in answer:
            raise EstimatorFailed(answer["failed"])
        return answer


def environment(family: str, folder: Path) -> Path:
    """Interpreter of a peer's virtual environment, which is created unless it is complete."""
    home = folder / family
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    complete = home / "installed.txt"
    requirements = REQUIREMENTS[family]
    if complete.is_file() and complete.read_text() == str(requirements):
        return python
    print(f"installing {family} into {home}", file=sys.stderr, flush=True)
    _call([sys.executable, "-m", "venv", "--clear", home])
    install: list[str | Path] = [
        python,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ]
    _call([*install, *requirements.whole])
    if requirements.bare:
        _call([*install, "--no-deps", *requirements.bare])
    complete.write_text(str(requirements))
    return python


def _call(command: list[str | Path]) -> None:
    """Run a command; raise `EstimatorFailed` with its last error message if it fails."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines()
        errors = [line for line in lines if line.startswith("ERROR")] or lines
        reason = errors[-1] if errors else f"exit code {done.returncode}"
        raise EstimatorFailed(f"not installed: {reason}")
