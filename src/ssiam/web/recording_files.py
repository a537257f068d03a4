"""`RecordingFolder`: the files of one recording, and how they are finished after a crash."""

from __future__ import annotations

import json
import logging
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from stat import S_ISDIR
from typing import Any, Final

from ssiam.errors import SinkError, SsiamError, one_line
from ssiam.exchange import ExportKind, read_annotations, write_exports
from ssiam.outputs import atomic_write
from ssiam.parsing import parse_json, parse_rate
from ssiam.video import open_source

try:
    import fcntl
except ModuleNotFoundError:  # Windows
    fcntl = None  # type: ignore[assignment]

_log = logging.getLogger(__name__)

VIDEO: Final = "video.mp4"
TABLES: Final = ("results.csv", "results.jsonl")
TEMPORARY_PREFIX: Final = "ssiam-live-"
"""Of folders whose recordings are deleted when their session ends."""
UNKNOWN_RATE: Final = "30"
"""Frames per second of a recording without metadata."""

_EXPORTS: Final[dict[str, ExportKind]] = {
    "cvat.xml": "cvat",
    "coco.json": "coco",
    "labelstudio.json": "labelstudio",
    "got10k.zip": "got10k",
}
_FILES: Final = (VIDEO, *TABLES, *_EXPORTS)
_METADATA: Final = "recording.json"
_LOCK: Final = "recording.lock"
_MAX_METADATA_BYTES: Final = 2**20
_MAX_EARLIER: Final = 200  # recordings of earlier sessions that are listed, the newest ones
_KILLED: Final = "ssiam was killed during this recording"


@dataclass(frozen=True)
class RecordingMetadata:
    """Data of a recording that its video and tables do not contain; stored as recording.json.

    Attributes
    ----------
    fps : str
        Frames per second, as a fraction.
    size_wh : (int, int)
        Frame size in pixels; (0, 0) before the first frame.
    frames : int
        Number of frames written so far.
    seconds : float
        Duration of the video.
    names : mapping of str to str
        Names of the targets by their ids.
    is_finished : bool
        Whether the recording has ended and its exports are written; ``whole`` in the file.
    error : str
        Why the recording ended early, or which of its files are missing, one line; empty if it is
        complete.
    """

    fps: str
    size_wh: tuple[int, int] = (0, 0)
    frames: int = 0
    seconds: float = 0.0
    names: Mapping[str, str] = field(default_factory=dict)
    is_finished: bool = False
    error: str = ""

    @property
    def rate(self) -> Fraction:
        """Frames per second."""
        return parse_rate(self.fps)

    def to_json(self) -> str:
        """The content of recording.json."""
        return json.dumps(
            {
                "fps": self.fps,
                "size_wh": self.size_wh,
                "frames": self.frames,
                "seconds": self.seconds,
                "names": dict(self.names),
                "whole": self.is_finished,
                "error": self.error,
            }
        )

    @classmethod
    def from_json(cls, text: str) -> RecordingMetadata:
        """Parse the content of recording.json.

        Raises
        ------
        ValueError, TypeError, KeyError, AttributeError, ArithmeticError
            It is damaged.
        """
        values = parse_json(text)
        width, height = (int(value) for value in values["size_wh"])
        return cls(
            str(values["fps"]),
            (width, height),
            int(values["frames"]),
            float(values["seconds"]),
            {str(int(n)): str(name) for n, name in values["names"].items()},
            values["whole"] is True,
            str(values["error"]),
        )


class RecordingFolder:
    """The folder with the files of one recording.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, path.name
        self._lock_descriptor: int | None = None

    @property
    def files(self) -> list[str]:
        """Names of the files that can be downloaded."""
        return [name for name in _FILES if (self.path / name).is_file()]

    def summary(self, metadata: RecordingMetadata, *, is_open: bool) -> dict[str, Any]:
        """The entry of the protocol's `recordings` message."""
        return {
            "name": self.name,
            "frames": metadata.frames,
            "seconds": round(metadata.seconds, 3),
            "open": is_open,
            "error": metadata.error or None,
            "files": [] if is_open else self.files,
        }

    def write_metadata(self, metadata: RecordingMetadata) -> None:
        """Replace recording.json; `SinkError` if it cannot be written."""
        path = self.path / _METADATA
        with atomic_write(path, "w", hidden=True) as file:
            file.write(metadata.to_json())

    def read_metadata(self) -> RecordingMetadata | None:
        """Read recording.json; None if it is missing or damaged."""
        path = self.path / _METADATA
        try:
            if path.stat().st_size > _MAX_METADATA_BYTES:
                return None
            metadata = RecordingMetadata.from_json(path.read_text(encoding="utf-8"))
            return metadata if metadata.rate > 0 and metadata.frames >= 0 else None
        except (OSError, ValueError, TypeError, KeyError, AttributeError, ArithmeticError):
            return None

    def lock(self) -> bool:
        """Prevent other processes from finishing the recording; False if one holds the lock."""
        if fcntl is None:
            return True
        try:
            # Whoever may write to the folder could have put a link there.
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            descriptor = os.open(self.path / _LOCK, flags, 0o600)
        except OSError:
            return False
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            return False
        self._lock_descriptor = descriptor
        return True

    def unlock(self) -> None:
        """Release the lock, if it is held."""
        descriptor, self._lock_descriptor = self._lock_descriptor, None
        if descriptor is not None:
            with suppress(OSError):
                (self.path / _LOCK).unlink()
            os.close(descriptor)

    def finish(self, metadata: RecordingMetadata) -> RecordingMetadata:
        """Rename the partial files to their final names, and write the exports and recording.json.

        Returns
        -------
        RecordingMetadata
            Finished; `error` names the files that could not be written.
        """
        problems = [metadata.error] if metadata.error else []
        for name in (VIDEO, *TABLES):
            self._rename_partial(name)
        problems += self._export(metadata)
        finished = replace(metadata, is_finished=True, error="; ".join(problems))
        try:
            self.write_metadata(finished)
        except SinkError as error:
            _log.error("%s", error)
        return finished

    def finish_after_crash(self, metadata: RecordingMetadata | None) -> RecordingMetadata:
        """Finish a recording whose process was killed.

        None stands for a recording without metadata, as early versions wrote them.
        """
        if metadata is not None:
            return self.finish(replace(metadata, error=_KILLED))
        try:
            with open_source(str(self.path / VIDEO)) as frames:
                rate, size_wh, length = frames.fps, frames.size_wh, frames.length
        except SsiamError as error:
            return RecordingMetadata(UNKNOWN_RATE, is_finished=True, error=one_line(error))
        count = length or 0
        return RecordingMetadata(str(rate), size_wh, count, count / float(rate), is_finished=True)

    def _rename_partial(self, name: str) -> None:
        """Rename the part file that a crash has left; it contains all that was written."""
        path = self.path / name
        part = path.with_name(f"{path.stem}.part{path.suffix}")
        with suppress(OSError):
            if part.is_file() and not path.exists():
                part.rename(path)

    def _export(self, metadata: RecordingMetadata) -> list[str]:
        """Write the exports; returns a line for each that could not be written."""
        if not metadata.names:
            return []
        table = self.path / TABLES[0]
        last = max(map(int, metadata.names))
        names = [metadata.names.get(str(n), f"target {n}") for n in range(1, last + 1)]
        problems = []
        try:
            _drop_partial_line(table)
            rows = read_annotations(table, metadata.size_wh, metadata.rate)
            names += [f"target {n}" for n in range(last + 1, len(rows.names) + 1)]
            annotations = replace(rows, names=tuple(names), length=metadata.frames)
        except Exception as error:
            return [f"no exports were written: {one_line(error)}"]
        for file, kind in _EXPORTS.items():
            try:
                (self.path / file).unlink(missing_ok=True)
                write_exports(annotations, self.path / file, kind)
            except Exception as error:
                problems.append(f"{file} was not written: {one_line(error)}")
                with suppress(OSError):
                    (self.path / file).unlink()
        return problems


def earlier_recordings(
    path: Path,
) -> dict[str, tuple[RecordingFolder, RecordingMetadata | None]]:
    """The recordings in a folder, by name, with their metadata (None if missing or damaged)."""
    found = {}
    try:
        names = sorted(each.name for each in path.iterdir() if each.is_dir())
    except OSError as error:
        _log.warning("%s cannot be read: %s", path, error)
        return {}
    for name in names[-_MAX_EARLIER:]:
        folder = RecordingFolder(path / name)
        metadata = folder.read_metadata()
        if metadata is not None or {VIDEO, TABLES[0]} <= set(folder.files):
            found[name] = folder, metadata
    return found


def abandoned_recordings() -> list[Path]:
    """Temporary folders, owned by this user, with recordings of sessions that were killed."""
    found = []
    for path in sorted(Path(tempfile.gettempdir()).glob(f"{TEMPORARY_PREFIX}*")):
        folder = RecordingFolder(path)
        with suppress(OSError):
            if not _is_own(path):
                continue
            if any(path.iterdir()) and earlier_recordings(path) and folder.lock():
                folder.unlock()
                found.append(path)
    return found


def _is_own(path: Path) -> bool:
    """Whether a folder belongs to this user and is no link; others can use its name too."""
    status = path.lstat()
    return S_ISDIR(status.st_mode) and (fcntl is None or status.st_uid == os.getuid())


def _drop_partial_line(path: Path) -> None:
    """Truncate a table after its last complete line."""
    with path.open("rb+") as file:
        size = file.seek(0, os.SEEK_END)
        start = max(0, size - _MAX_METADATA_BYTES)
        file.seek(start)
        end = file.read().rfind(b"\n")
        if end >= 0:
            file.truncate(start + end + 1)
