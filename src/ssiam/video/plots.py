"""`PathPlot`: camera path and stabilization as a figure (Fig. 3 and 4 of the paper)."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssiam.copying import NotCopyable
from ssiam.errors import MissingExtraError, SinkError
from ssiam.geometry import frame_center, rigid_parameters
from ssiam.motion import Motion
from ssiam.outputs import ClosedOnExit, atomic_write, check_output
from ssiam.stabilize import CameraPath
from ssiam.track import Track

_RAW, _SMOOTH, _UNRELIABLE = "#e8710a", "#1a73e8", "#d9d9d9"  # orange and blue as in Fig. 3
_AXES = (
    ("dx", "px, right", 1.0),
    ("dy", "px, down", 1.0),
    ("da", "degrees, clockwise", 180 / np.pi),
)


class PathPlot(NotCopyable, ClosedOnExit):
    """Collects the camera motion while tracking and plots it when closed.

    Threads: one thread at a time.

    Left column: the camera path, raw and smoothed (Fig. 3). Right column: the correction of each
    frame, after the limits of eq. 6 (Fig. 4). Gray: frames whose motion is unreliable.

    Parameters
    ----------
    path : Path
        The image file; its suffix (.png, .svg, .pdf) selects the format.
    window : int
        Length of the moving average, frames.
    overwrite : bool
        Whether an existing file may be replaced; it is kept until the new one is complete.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    SinkError
        The file cannot be written, or exists and `overwrite` is False.
    """

    def __init__(self, path: Path, window: int, *, overwrite: bool = True) -> None:
        check_plot(path)
        check_output(path, overwrite=overwrite)
        self._path = path
        self._overwrite = overwrite
        self._written = False
        self._camera_path = CameraPath(window)
        self._rows: list[tuple[float, ...]] = []

    def write(self, track: Track) -> None:
        """Record the motion and stabilization of one frame; frames without them are ignored."""
        if track.motion is None or track.stab_from_raw is None:
            return
        motion = track.motion
        if motion.reliable:
            self._camera_path.advance(motion)
        self._rows.append((*motion.shift_angle, *self._difference(), *_correction(track, motion)))

    def _difference(self) -> tuple[float, float, float]:
        return self._camera_path.difference() if self._camera_path.started else (0.0, 0.0, 0.0)

    @property
    def location(self) -> Path | None:
        """The image file; None until it is written."""
        return self._path if self._written else None

    def close(self) -> None:
        """Plot the recorded frames, if there are any. May be called twice."""
        if self._rows:
            self._draw(np.array(self._rows))
            self._rows, self._written = [], True

    def abandon(self) -> None:
        """Discard the recorded frames."""
        self._rows = []

    def _draw(self, rows: NDArray[np.float64]) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(11, 7), layout="constrained")
        FigureCanvasAgg(figure)
        motions, differences, corrections = rows[:, :3], rows[:, 3:6], rows[:, 6:9]
        paths = motions.cumsum(axis=0)
        unreliable = np.flatnonzero(rows[:, 9] == 0)
        panels = figure.subplots(3, 2, sharex=True, squeeze=False)
        for axis, (name, unit, factor) in enumerate(_AXES):
            left, right = panels[axis]
            smooth = paths[:, axis] + differences[:, axis]
            left.plot(factor * paths[:, axis], color=_RAW, lw=1.2, label="camera path")
            left.plot(factor * smooth, color=_SMOOTH, lw=1.6, label="smoothed path")
            left.set_ylabel(f"{name}  ({unit})")
            right.plot(factor * corrections[:, axis], color=_SMOOTH, lw=1.2)
            for panel in (left, right):
                _style(panel, unreliable)
        panels[0, 0].legend(loc="best", frameon=False, fontsize=9)
        panels[0, 0].set_title("Camera path (Fig. 3)", loc="left", fontsize=11)
        panels[0, 1].set_title("Correction of each frame (Fig. 4)", loc="left", fontsize=11)
        for panel in panels[2]:
            panel.set_xlabel("frame")
        self._save(figure)

    def _save(self, figure: Any) -> None:
        file_format = self._path.suffix.lower()[1:]
        with atomic_write(self._path, "wb", overwrite=self._overwrite) as file:
            figure.savefig(file, dpi=130, format=file_format)


def check_plot(path: Path) -> None:
    """Raise `MissingExtraError` without matplotlib, `SinkError` for another kind of file."""
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("a plot needs matplotlib: pip install 'ssiam[plot]'")
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise SinkError(f"{path}: a plot is written as .png, .svg or .pdf")


def _correction(track: Track, motion: Motion) -> tuple[float, ...]:
    """(dx', dy', da') of the correction, and 1.0 if the motion is reliable, else 0.0."""
    assert track.stab_from_raw is not None
    shift_angle = rigid_parameters(track.stab_from_raw, frame_center(motion.size_wh))
    return (*shift_angle, float(motion.reliable))


def _style(panel: Any, unreliable: NDArray[np.intp]) -> None:
    for frame in unreliable:
        panel.axvspan(frame - 0.5, frame + 0.5, color=_UNRELIABLE, lw=0, zorder=0)
    panel.grid(alpha=0.25)
    panel.spines[["top", "right"]].set_visible(False)
