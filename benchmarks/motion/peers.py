"""The peers of the camera motion, and the worker processes of all estimators."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.environments import JsonProcess, Requirements, environment

_SCRIPT = Path(__file__).with_name("estimators.py")
_OPENCV = "opencv-contrib-python-headless>=4.10,<5"

PEERS = (
    "vidstab-gftt",
    "vidstab-orb",
    "vidgear",
    "norfair",
    "boxmot-sof",
    "boxmot-ecc",
    "boxmot-ecc-euclidean",
)

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
        requirements = REQUIREMENTS.get(family)
        python = Path(sys.executable)
        if requirements is not None:
            python = environment(family, requirements, environments)
        self._process = JsonProcess([python, _SCRIPT, name])
        self.versions: dict[str, str] = self._process.greeting["versions"]

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._process.__exit__(kind, error, traceback)

    def run(self, clip: Path, *, exclude: bool) -> Run:
        """Run a new estimator over a saved clip; `exclude` gives it the target's boxes.

        Raises
        ------
        EstimatorFailed
            It raised an exception, or its process ended; the next clip starts a new one.
        """
        answer = self._process.ask({"clip": str(clip), "exclude": exclude})
        return Run(**{key: np.array(value) for key, value in answer.items()})
