"""What all outputs share: the check before work starts, and their one kind of error."""

from __future__ import annotations

from pathlib import Path

from ssiam.errors import SinkError


def check_output(path: Path) -> None:
    """Raise `SinkError` if `path` cannot be written; leaves what it holds as it is.

    Folders are not created: a misspelt one should be seen, and before the work, not after.
    """
    folder = path.parent
    try:
        if not folder.is_dir():
            raise SinkError(f"{path}: there is no folder {folder}; create it first")
        if path.is_dir():
            raise SinkError(f"{path}: is a folder; give the name of a file")
        existed = path.exists()
        with path.open("ab"):
            pass
        if not existed:
            path.unlink()
    except OSError as error:
        raise output_error(path, error) from error


def output_error(path: Path, error: Exception) -> SinkError:
    """The `SinkError` for a failure of the operating system or of FFmpeg."""
    reason = getattr(error, "strerror", None) or str(error)
    return SinkError(f"{path}: cannot be written ({reason}); what is in it so far is kept")
