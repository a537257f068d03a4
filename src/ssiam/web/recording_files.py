"""`RecordingFolder`: the files of one recording, and what is known of it after a crash."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

from ssiam.errors import SinkError, one_line
from ssiam.exchange import ExportKind, read_annotations, write_exports
from ssiam.outputs import atomic_write

try:
    import fcntl
except ModuleNotFoundError:  # Windows
    fcntl = None  # type: ignore[assignment]

_log = logging.getLogger(__name__)

VIDEO: Final = "video.mp4"
TABLES: Final = ("results.csv", "results.jsonl")
_EXPORTS: Final[dict[str, ExportKind]] = {
    "cvat.xml": "cvat",
    "coco.json": "coco",
    "labelstudio.json": "labelstudio",
    "got10k.zip": "got10k",
}
FILES: Final = (VIDEO, *TABLES, *_EXPORTS)
_FACTS: Final = "recording.json"
_LOCK: Final = "recording.lock"
_LARGEST_FACTS: Final = 2**20  # bytes


@dataclass(frozen=True)
class Facts:
    """What a recording's own files do not say.

    Attributes
    ----------
    fps : str
        Frames a second, as a fraction.
    size_wh : (int, int)
        Of the frames, pixels; (0, 0) before the first one.
    frames : int
        Written so far.
    seconds : float
        Length of the video.
    names : mapping of str to str
        Of the targets, by their number.
    whole : bool
        Whether it has been ended, and its exports are written.
    error : str
        Why it ended by itself or lacks something, one line; empty if it is as it was asked for.
    """

    fps: str
    size_wh: tuple[int, int] = (0, 0)
    frames: int = 0
    seconds: float = 0.0
    names: Mapping[str, str] = field(default_factory=dict)
    whole: bool = False
    error: str = ""

    @property
    def rate(self) -> Fraction:
        """Frames a second."""
        return Fraction(self.fps)


class RecordingFolder:
    """The files of one recording.

    Parameters
    ----------
    path : Path
        Its folder.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, path.name
        self._locked: int | None = None

    @property
    def files(self) -> list[str]:
        """Names of the files that can be fetched."""
        return [name for name in FILES if (self.path / name).is_file()]

    def summary(self, facts: Facts, *, is_open: bool) -> dict[str, Any]:
        """The recording as the protocol's `recordings` message has it."""
        return {
            "name": self.name,
            "frames": facts.frames,
            "seconds": round(facts.seconds, 3),
            "open": is_open,
            "error": facts.error or None,
            "files": [] if is_open else self.files,
        }

    def write_facts(self, facts: Facts) -> None:
        """Replace the facts on disk; `SinkError` if that cannot be done."""
        path = self.path / _FACTS
        with atomic_write(path, "w", hidden=True) as file:
            json.dump(asdict(facts), file)

    def read_facts(self) -> Facts | None:
        """The facts on disk; None where there are none that can be used."""
        path = self.path / _FACTS
        try:
            if path.stat().st_size > _LARGEST_FACTS:
                return None
            values = json.loads(path.read_text(encoding="utf-8"))
            width, height = (int(value) for value in values["size_wh"])
            facts = Facts(
                str(values["fps"]),
                (width, height),
                int(values["frames"]),
                float(values["seconds"]),
                {str(int(n)): str(name) for n, name in values["names"].items()},
                values["whole"] is True,
                str(values["error"]),
            )
            return facts if facts.rate > 0 and facts.frames >= 0 else None
        except (OSError, ValueError, TypeError, KeyError, AttributeError, ZeroDivisionError):
            return None

    def lock(self) -> bool:
        """Keep other processes from finishing it; False if another one is at work on it."""
        if fcntl is None:
            return True
        try:
            descriptor = os.open(self.path / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError:
            return False
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            return False
        self._locked = descriptor
        return True

    def unlock(self) -> None:
        """Let other processes at it."""
        descriptor, self._locked = self._locked, None
        if descriptor is not None:
            with suppress(OSError):
                (self.path / _LOCK).unlink()
            os.close(descriptor)

    def finish(self, facts: Facts) -> Facts:
        """Give the files their names, write the exports; the facts then, which are on disk too.

        What cannot be written is named in their `error`; the rest is.
        """
        problems = [facts.error] if facts.error else []
        for name in (VIDEO, *TABLES):
            self._adopt(name)
        problems += self._export(facts)
        whole = replace(facts, whole=True, error="; ".join(problems))
        try:
            self.write_facts(whole)
        except SinkError as error:
            _log.error("%s", error)
        return whole

    def _adopt(self, name: str) -> None:
        """Give a file that was left unfinished its name: it holds all that was written."""
        path = self.path / name
        part = path.with_name(f"{path.stem}.part{path.suffix}")
        with suppress(OSError):
            if part.is_file() and not path.exists():
                part.rename(path)

    def _export(self, facts: Facts) -> list[str]:
        """Write what other programs read; a line for each file that could not be written."""
        if not facts.names:
            return []
        table = self.path / TABLES[0]
        last = max(map(int, facts.names))
        names = [facts.names.get(str(n), f"target {n}") for n in range(1, last + 1)]
        problems = []
        try:
            _drop_cut_line(table)
            rows = read_annotations(table, facts.size_wh, facts.rate)
            names += [f"target {n}" for n in range(last + 1, len(rows.names) + 1)]
            annotations = replace(rows, names=tuple(names), length=facts.frames)
        except Exception as error:
            return [f"there are no exports: {one_line(error)}"]
        for file, kind in _EXPORTS.items():
            try:
                (self.path / file).unlink(missing_ok=True)
                write_exports(annotations, self.path / file, kind)
            except Exception as error:
                problems.append(f"there is no whole {file}: {one_line(error)}")
                with suppress(OSError):
                    (self.path / file).unlink()
        return problems


def _drop_cut_line(path: Path) -> None:
    """Cut a last line off that was not written to its end."""
    with path.open("rb+") as file:
        size = file.seek(0, os.SEEK_END)
        start = max(0, size - _LARGEST_FACTS)
        file.seek(start)
        end = file.read().rfind(b"\n")
        if end >= 0:
            file.truncate(start + end + 1)
