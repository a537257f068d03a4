"""Files and folders of unfinished outputs: locked while their process lives, else removed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp

try:
    import fcntl
except ModuleNotFoundError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["hold", "hold_new", "remove_abandoned", "staging_folder"]


def hold(path: Path) -> int | None:
    """Lock a file or folder until the descriptor is closed or the process ends, also by a kill.

    Returns
    -------
    int or None
        The descriptor; None where there are no such locks: on Windows and some network drives.

    Raises
    ------
    BlockingIOError
        Another process, or another descriptor of this one, holds it.
    FileNotFoundError
        It does not exist, or was removed before it was locked.
    """
    if fcntl is None:
        return None
    try:
        # Whoever may write to a shared folder could have put a link there.
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        raise
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # Its name may belong to a new file by now, which the lock does not protect.
        if not os.path.samestat(os.fstat(descriptor), os.lstat(path)):
            raise FileNotFoundError(path)
    except (BlockingIOError, FileNotFoundError):
        os.close(descriptor)
        raise
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def hold_new(path: Path) -> int | None:
    """As `hold`, for what was created a moment ago.

    Remove or rename it before its descriptor is closed: without the lock, another process may
    remove it.

    Raises
    ------
    FileNotFoundError
        Another process took it for abandoned and has removed it: create another one.
    """
    try:
        return hold(path)
    except BlockingIOError:
        raise FileNotFoundError(path) from None


def remove_abandoned(paths: Iterable[Path]) -> list[Path]:
    """Remove the files and folders of this user that no process holds; returns the others."""
    kept = []
    for path in paths:
        try:
            descriptor = hold(path)
        except FileNotFoundError:
            continue
        except BlockingIOError:
            descriptor = None
        if descriptor is None:
            kept.append(path)
            continue
        if os.fstat(descriptor).st_uid == os.getuid():
            _remove(path)
        os.close(descriptor)
        if os.path.lexists(path):
            kept.append(path)
    return kept


@contextmanager
def staging_folder(folder: Path, prefix: str) -> Iterator[Path]:
    """An empty folder in `folder`, which is removed on exit.

    Those that killed processes have left, with the same prefix, are removed first.
    """
    remove_abandoned(folder.glob(f"{prefix}*"))
    while True:
        path = Path(mkdtemp(dir=folder, prefix=prefix))
        with suppress(FileNotFoundError):
            descriptor = hold_new(path)
            break
    try:
        yield path
    finally:
        _remove(path)
        if descriptor is not None:
            os.close(descriptor)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        return
    with suppress(OSError):
        path.unlink()
