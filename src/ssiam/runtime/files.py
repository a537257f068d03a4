"""Network files: checks of their first bytes, digests, and the cache folder."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from ssiam.errors import WeightsError, one_line

__all__ = [
    "cache_folder",
    "damaged_error",
    "fingerprint",
    "input_shape_error",
    "not_arrays_error",
    "not_int8_error",
    "not_run_error",
    "sha256",
    "weights_sha256",
]

_CHUNK: Final = 1 << 20  # bytes


def cache_folder() -> Path:
    """The folder `ssiam` in the user's cache folder, for files that can be made again.

    That is ``$XDG_CACHE_HOME/ssiam``, by default ``~/.cache/ssiam``. It may not exist. For a
    user without a home folder it is a path that cannot be created.
    """
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path("~/.cache").expanduser()) / "ssiam"
    except RuntimeError:  # neither $HOME nor an entry in the password file
        return Path(os.devnull) / "ssiam"


def sha256(path: Path) -> str:
    """SHA-256 digest of a file's bytes, 64 hexadecimal digits."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def weights_sha256(weights: Path, runtime: str = "openvino") -> str:
    """Digest of the files that a runtime reads from a file or folder of weights, 64 digits.

    Of one file it is the `sha256`. Several .onnx files of a folder are combined in the order of
    their names, which count too; a .toml file, with those in its folder.

    Raises
    ------
    WeightsError
        There is no file of weights, or one cannot be read.
    """
    files = [weights]
    if weights.suffix == ".toml" and weights.is_file():  # with the network that it describes
        files = [weights, *sorted(weights.parent.glob("*.onnx"))]
    elif weights.is_dir() or (weights.suffix == ".onnx" and weights.is_file()):
        folder = weights if weights.is_dir() else weights.parent
        kinds = ("*.pth", "*.onnx") if runtime == "torch" else ("*.onnx", "*.pth")
        files = next((found for kind in kinds if (found := sorted(folder.glob(kind)))), [])
    if not files:
        raise WeightsError(f"weights folder {weights} holds no .onnx and no .pth file")
    try:
        digests = [(path.name, sha256(path)) for path in files]
    except OSError as error:
        raise WeightsError(f"weights {error.filename} cannot be read: {error.strerror}") from error
    if len(digests) == 1:
        return digests[0][1]
    return hashlib.sha256(repr(digests).encode()).hexdigest()


def fingerprint(paths: Iterable[Path], key: str) -> str:
    """A digest of the files' names, sizes and modification times, and of `key`.

    It has 32 hexadecimal digits. The files themselves are not read.
    """
    stats = [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in paths]
    return hashlib.sha256(f"{stats} {key}".encode()).hexdigest()[:32]


def damaged_error(path: Path) -> WeightsError:
    """The error for an ONNX file that cannot be read although its first bytes are right."""
    return WeightsError(
        f"weights {path} cannot be read: the file is damaged or cut short "
        f"({path.stat().st_size} bytes); download it again"
    )


def input_shape_error(path: Path, shape: tuple[int, ...]) -> WeightsError:
    """The error for a network that does not accept an input of this shape."""
    return WeightsError(
        f"{path} does not take an input of shape {shape}: these are weights of another network"
    )


def not_arrays_error(path: Path) -> WeightsError:
    """The error for a network whose inputs or outputs have no fixed shape."""
    return WeightsError(
        f"weights {path} have inputs or outputs without a fixed shape: export the network with one"
    )


def not_int8_error(path: Path) -> WeightsError:
    """The error for a network that should run in int8 but has no quantized layers."""
    return WeightsError(
        f"weights {path} are not in int8: export them with "
        "ssiam weights export NAME FILE --precision int8 --pictures VIDEO"
    )


def not_run_error(path: Path, error: Exception) -> WeightsError:
    """The error for a network that cannot be run on its inputs."""
    return WeightsError(f"weights {path} cannot be run on these inputs ({one_line(error)})")
