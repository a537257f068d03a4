"""Writing output files: never over an input, and atomically."""

from __future__ import annotations

import errno
import os
import re
import shutil
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count, takewhile
from pathlib import Path
from stat import S_ISDIR, S_ISREG, S_ISVTX, S_IWOTH
from types import TracebackType
from typing import IO, Any, TypeAlias, TypeVar

from ssiam.addresses import display_name, has_scheme
from ssiam.errors import ArgumentError, SinkError
from ssiam.unfinished import hold_new, remove_abandoned

NamedPath: TypeAlias = tuple[str, Path]
"""A label for messages, such as "--out" or "the source", and a file."""

Sink = TypeVar("Sink", bound="ClosedOnExit")

_Identity: TypeAlias = tuple[object, ...]

_READER_TIMEOUT = 5.0  # seconds until a named pipe must have a reader
_READER_POLL = 0.02  # seconds
_STANDARD_STREAMS = (1, 2)  # descriptors of standard output and standard error


def check_distinct(outputs: Sequence[NamedPath], inputs: Iterable[NamedPath]) -> None:
    """Check that no output is an input and that all outputs are different files; opens nothing.

    Files and folders are compared by identity, so that other spellings, symbolic links, hard
    links and a redirected standard output are found. Devices and pipes are not checked.

    Raises
    ------
    ArgumentError
        Two of them are the same file; the message names both.
    """
    read: dict[_Identity, NamedPath] = {}
    for label, path in inputs:
        read.setdefault(_identity(path), (label, path))
    written: dict[_Identity, NamedPath] = {}
    for label, path in outputs:
        identity = _identity(path)
        if identity in read:
            input_label, source = read[identity]
            kind = "folder" if source.is_dir() else "file"
            raise ArgumentError(
                f"{label} {path} is the {kind} of {input_label} {source}; give another {kind}"
            )
        if identity in written:
            other_label, other = written[identity]
            raise ArgumentError(
                f"{other_label} {other} and {label} {path} are the same file; give two files"
            )
        written[identity] = label, path


def _identity(path: Path) -> _Identity:
    """A value that is equal only for paths of the same file or folder."""
    try:
        status = path.stat()
    except OSError:  # it does not exist: compare the targets of symbolic links
        return (os.path.realpath(path),)
    is_device = not (S_ISREG(status.st_mode) or S_ISDIR(status.st_mode))
    return (object(),) if is_device else (status.st_dev, status.st_ino)


def check_output(path: Path, *, overwrite: bool = True) -> None:
    """Check that a file can be written, without changing it.

    Its folder must exist: a misspelled one is reported, not created.

    Parameters
    ----------
    path : Path
    overwrite : bool
        Whether an existing file may be replaced. Pipes and devices are never replaced.

    Raises
    ------
    SinkError
        It cannot be written, or exists and must not be replaced.
    """
    try:
        _check_no_address(path)
        if not path.parent.is_dir():
            raise SinkError(f"{path}: there is no folder {path.parent}; create it first")
        if path.is_dir():
            raise SinkError(f"{path}: is a folder; give the name of a file")
        if is_stream(path):
            return
        if path.exists():
            if not overwrite:
                raise SinkError(
                    f"{path}: exists already; give another name, or --overwrite to replace it"
                )
            if not os.access(path, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        part, lock = _new_held_part(Path(os.path.realpath(path)))
        part.unlink()
        _close(lock)
    except OSError as error:
        raise output_error(path, error) from error


def is_stream(path: Path) -> bool:
    """Whether `path` is a pipe, a device or this program's standard output or error."""
    try:
        status = path.stat()
    except OSError:
        return False
    if S_ISREG(status.st_mode):
        return any(_is_descriptor(status, descriptor) for descriptor in _STANDARD_STREAMS)
    return not S_ISDIR(status.st_mode)


def _is_descriptor(status: os.stat_result, descriptor: int) -> bool:
    try:
        return os.path.samestat(status, os.fstat(descriptor))
    except OSError:  # closed
        return False


def output_error(path: Path, error: Exception, part: Path | None = None) -> SinkError:
    """The `SinkError` for a failure of the operating system or of FFmpeg.

    All errors of this kind have the form "FILE: cannot be written (reason)".

    Parameters
    ----------
    path : Path
        The output.
    error : Exception
    part : Path, optional
        The file with the content that was written before the failure.
    """
    reason = getattr(error, "strerror", None) or str(error)
    rest = "" if part is None else f"; what was written is in {part}"
    return SinkError(f"{path}: cannot be written ({reason}){rest}")


def make_folder(path: Path, *, exist_ok: bool = True) -> None:
    """Create a folder and its parents.

    A folder in a shared temporary one, such as /tmp, is open to its owner only.

    Parameters
    ----------
    path : Path
    exist_ok : bool
        Whether it may exist already.

    Raises
    ------
    SinkError
        It cannot be created.
    """
    try:
        _check_no_address(path)
        missing = list(takewhile(lambda parent: not parent.exists(), path.parents))
        for parent in reversed(missing):
            parent.mkdir(_folder_mode(parent), exist_ok=True)
        path.mkdir(_folder_mode(path), exist_ok=exist_ok)
    except OSError as error:
        raise output_error(path, error) from error


def _check_no_address(path: Path) -> None:
    """Raise `SinkError` for an address, of whose password a folder or a message would be made."""
    if has_scheme(str(path)) and not os.path.lexists(path.parts[0]):
        raise SinkError(f"{display_name(str(path))}: is an address; outputs are files and folders")


def _folder_mode(path: Path) -> int:
    return 0o700 if _is_shared(path.parent) else 0o777


def _is_shared(folder: Path) -> bool:
    """Whether all users may create files in a folder, and none may remove another's."""
    wanted = S_ISVTX | S_IWOTH
    return folder.stat().st_mode & wanted == wanted


class PartFile:
    """The file ``NAME.part.EXT`` to which an output is written until it is complete.

    `finish` then renames it. Part files of other runs are not changed: if there is one, the new one
    is called ``NAME.part-2.EXT``. The part file is in the folder of the file that is replaced, even
    if the output is a symbolic link. Pipes, devices and standard output have no part file and are
    written directly.

    Parameters
    ----------
    path : Path
        The output. Its folder must exist.
    overwrite : bool
        Whether `finish` may replace an existing file.
    hidden : bool
        Call it ``.NAME.EXT.part``, for folders in which other programs look for files by suffix.
        Those that killed processes have left are removed.

    Attributes
    ----------
    path : Path
        The output.
    file : Path
        The file to write: a new, empty file, or the pipe or device itself.

    Raises
    ------
    SinkError
        The output cannot be written, or exists and must not be replaced.
    """

    def __init__(self, path: Path, *, overwrite: bool = True, hidden: bool = False) -> None:
        check_output(path, overwrite=overwrite)
        self.path = path
        self._overwrite = overwrite
        # The file that `finish` replaces; None for a stream, and after `finish` or `discard`
        self._target = None if is_stream(path) else Path(os.path.realpath(path))
        self._lock: int | None = None
        try:
            self.file = path if self._target is None else self._new_file(self._target, hidden)
        except OSError as error:
            raise output_error(path, error) from error
        self._discarded = False
        self._reader: int | None = _await_reader(path) if self._target is None else None

    def _new_file(self, target: Path, hidden: bool) -> Path:
        if not hidden:
            return _new_part(target, hidden=False)
        remove_abandoned(leftover_parts(target, hidden=True))
        file, self._lock = _new_held_part(target)
        return file

    @property
    def location(self) -> Path | None:
        """The file with the content: the part file, the output, or None after `discard`."""
        if self._discarded:
            return None
        if self._target is None:
            return self.path
        return self.file if self.path.is_symlink() else self.path.with_name(self.file.name)

    def finish(self) -> None:
        """Rename the part file to the output. May be called twice.

        Raises
        ------
        OSError
            It cannot be renamed; the part file and an older output are kept.
        """
        self._release_reader()
        if self._target is None:
            return
        with self.file.open("r+b") as file:
            os.fsync(file.fileno())
        with suppress(OSError):  # no older output, or its mode cannot be copied
            shutil.copymode(self._target, self.file)
        if self._overwrite:
            self.file.replace(self._target)
        else:
            _rename(self.file, self._target)
        self._target = None
        self._release_lock()

    def discard(self) -> None:
        """Remove the part file; does nothing after `finish`."""
        self._release_reader()
        if self._target is None:
            return
        self._target, self._discarded = None, True
        with suppress(OSError):
            self.file.unlink()
        self._release_lock()

    def _release_reader(self) -> None:
        if self._reader is not None:
            os.close(self._reader)
            self._reader = None

    def _release_lock(self) -> None:
        _close(self._lock)
        self._lock = None

    def error(self, error: Exception) -> SinkError:
        """The error for a failure to write; it names the part file unless that is empty."""
        with suppress(OSError):
            if self._target is not None and self.file.stat().st_size:
                return output_error(self.path, error, self.location)
        return output_error(self.path, error)


def _await_reader(path: Path) -> int | None:
    """Wait until a program reads a named pipe, which opening it would wait for without end.

    Returns a descriptor that keeps the reader until the pipe is opened again; None for other files.
    """
    if not path.is_fifo():
        return None
    deadline = time.monotonic() + _READER_TIMEOUT
    while True:
        try:
            return os.open(path, os.O_WRONLY | os.O_NONBLOCK)
        except OSError as error:
            if error.errno != errno.ENXIO or time.monotonic() > deadline:
                reason = "no program reads this pipe" if error.errno == errno.ENXIO else None
                raise SinkError(
                    f"{path}: cannot be written ({reason or error.strerror}); start its reader"
                ) from error
        time.sleep(_READER_POLL)


class ClosedOnExit(ABC):
    """A context manager that closes itself on exit, even after Ctrl-C or an exception."""

    @abstractmethod
    def close(self) -> None:
        """Finish the output; raises `SinkError` if that fails. May be called twice."""

    def __enter__(self: Sink) -> Sink:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if exc_type is None:
            self.close()
            return
        # The exception is more informative than the errors that it causes.
        with suppress(SinkError):
            self.close()


def leftover_parts(path: Path, *, hidden: bool = False) -> list[Path]:
    """Part files of the output `path` from runs that were killed or are still running.

    `hidden` is as for `PartFile`.
    """
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    name = re.compile(
        rf"\.{re.escape(target.name)}\.part(-[0-9]+)?"
        if hidden
        else rf"{re.escape(target.stem)}\.part(-[0-9]+)?{re.escape(target.suffix)}"
    )
    try:
        return sorted(each for each in target.parent.iterdir() if name.fullmatch(each.name))
    except OSError:
        return []


@contextmanager
def atomic_write(
    path: Path, mode: str, *, overwrite: bool = True, hidden: bool = False
) -> Iterator[IO[Any]]:
    """Write a file atomically: `path` gets the new content, or keeps the old one on any error.

    Parameters
    ----------
    path : Path
    mode : {"w", "wb"}
        Text (UTF-8) or bytes.
    overwrite, hidden : bool
        As for `PartFile`.

    Yields
    ------
    file
        Open for writing.

    Raises
    ------
    SinkError
        It cannot be written, on entry or on exit.
    """
    part = PartFile(path, overwrite=overwrite, hidden=hidden)
    is_text = "b" not in mode
    try:
        with part.file.open(
            mode, encoding="utf-8" if is_text else None, newline="\n" if is_text else None
        ) as file:
            yield file
        part.finish()
    except OSError as error:
        part.discard()
        raise output_error(path, error) from error
    except BaseException:
        part.discard()
        raise


def numbered_names(name: str) -> Iterator[str]:
    """`name`, then the name with -2, -3, ... appended, without end."""
    yield name
    for number in count(2):
        yield f"{name}-{number}"


def _new_part(target: Path, *, hidden: bool) -> Path:
    """Create an empty part file next to `target`, under the first unused name."""
    for word in numbered_names("part"):
        name = f".{target.name}.{word}" if hidden else f"{target.stem}.{word}{target.suffix}"
        file = target.with_name(name)
        try:
            os.close(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        except FileExistsError:
            continue
        return file
    raise AssertionError("unreachable: the loop is infinite")


def _new_held_part(target: Path) -> tuple[Path, int | None]:
    """A new, hidden part file, and the lock that keeps other processes from removing it."""
    while True:
        file = _new_part(target, hidden=True)
        with suppress(FileNotFoundError):
            return file, hold_new(file)


def _close(descriptor: int | None) -> None:
    if descriptor is not None:
        os.close(descriptor)


def _rename(file: Path, target: Path) -> None:
    """Rename a file without replacing another one; `FileExistsError` if `target` exists."""
    try:
        os.link(file, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        if target.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST)) from None
        file.replace(target)
    else:
        file.unlink()
