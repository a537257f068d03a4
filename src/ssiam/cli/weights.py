"""`ssiam weights`: what networks are here, where the rest comes from, and .pth to ONNX."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final, Literal

from cyclopts import App, Parameter

from ssiam.errors import ArgumentError, SinkError, WeightsError, check_choice
from ssiam.outputs import NamedPath, check_apart
from ssiam.runtime import PUBLISHED
from ssiam.runtime.exported import RECORD, Exported, export_folder
from ssiam.runtime.files import cache_folder
from ssiam.trackers import registry
from ssiam.video.source_files import check_apart_from_source

_PIECES: Final = ("template", "search", "refine", "mask")  # of which a network has some
_PICTURES: Final = 64  # that are read for calibration, at equal distances

weights = App(name="weights", help="The networks' weights: list, import and export them.")


@weights.command(name="list")
def show(*, folder: Path | None = None) -> None:
    """List the trackers' weights: what is here, and where their authors publish them.

    Nothing is downloaded.

    Parameters
    ----------
    folder
        Where to look. By default the folder of ssiam weights import, and ./weights.
    """
    print("lite: came with the package")
    folders = registry.weights_folders() if folder is None else (folder,)
    for tracker, publication in PUBLISHED.items():
        found = [each / publication.local for each in folders]
        local = next((_told(path) for path in found if path.is_dir()), "not here")
        print(f"{tracker}: {local}")
        print(f"  published: {publication.file} at {publication.where}")
        print(f"  size {publication.size}, licence {publication.licence}")


@weights.command(name="import")
def import_(
    file: Path,
    /,
    *,
    tracker: str | None = None,
    folder: Path | None = None,
) -> None:
    """Recognise an authors' .pth file, check it, and keep it where the trackers look for it.

    It is copied and exported to ONNX, so that every runtime takes it; PyTorch is needed for the
    import alone.

    Parameters
    ----------
    file
        The .pth file, or a folder that ssiam weights export has written.
    tracker
        Whose weights they are, where several trackers have the same network (siammask_...).
        By default the tracker named as the network.
    folder
        Where they are kept. By default the folder weights in the user's cache folder.
    """
    network = _recognised(file)
    name = network if tracker is None else tracker
    if name not in PUBLISHED:
        raise WeightsError(f"weights {file} are those of {network}, for which there is no tracker")
    if PUBLISHED[name].network != network:
        raise WeightsError(
            f"weights {file} are those of {network}, but {name} has {PUBLISHED[name].network}"
        )
    print(f"{file}: {network}")
    target = (folder or cache_folder() / "weights") / PUBLISHED[name].local
    exported = export_folder(file)
    if exported is None:
        _check_apart("--folder", target, [("the weights", file)])
        _export(file, target, name, "f32", ())
        _copied([file], target, f"{network}.pth")
    else:
        pieces = [exported / f"{piece}.onnx" for piece in Exported.read(exported).pieces]
        _copied([*pieces, exported / RECORD], target)
    print(f"kept in {target}")


@weights.command(name="export")
def export(
    name: str,
    file: Path,
    /,
    *,
    out: Path = Path("weights"),
    precision: Literal["f32", "int8"] = "f32",
    pictures: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
) -> None:
    """Write a network of an authors' .pth file as ONNX, for OpenVINO and ONNX Runtime.

    The files are compared with PyTorch before they are kept.

    Parameters
    ----------
    name
        The tracker: siamfc, siamrpn_..., siammask_...
    file
        The .pth file.
    out
        Folder in which a folder named after the tracker is written.
    precision
        int8 computes in eight bits what is run on every frame.
    pictures
        For int8: video or folder of pictures like those that will be tracked in, from which the
        ranges of values are taken.
    """
    known = [each for each in PUBLISHED if not each.startswith("nanotrack")]
    tracker = check_choice("tracker with a .pth file", name, known)
    _check_apart("--out", out / tracker, [("the weights", file)], pictures)
    images = [] if pictures is None else _read(pictures)
    _export(file, out / tracker, tracker, precision, images)
    print(f"{file}: {PUBLISHED[tracker].network}, {precision}, written to {out / tracker}")


def _export(
    file: Path, target: Path, name: str, precision: Literal["f32", "int8"], pictures: Any
) -> None:
    from ssiam.runtime.export import export_network

    network = PUBLISHED[name].network
    export_network(file, target, name=name, network=network, precision=precision, pictures=pictures)


def _recognised(file: Path) -> str:
    """The network of a checkpoint or an exported folder."""
    folder = export_folder(file)
    if folder is not None:
        return Exported.read(folder).network
    if file.suffix == ".onnx":
        raise WeightsError(
            f"weights {file} are ONNX without a {RECORD} beside them: they need no import, "
            "give them to a tracker as they are"
        )
    from ssiam.networks import read_checkpoint

    return read_checkpoint(file).name


def _read(pictures: str) -> list[Any]:
    """Some frames of a source, spread over all of it where its length is known."""
    from ssiam.video import open_source

    with open_source(pictures) as frames:
        step = max((frames.length or 0) // _PICTURES, 1)
        found = [frame.image for frame in islice(frames, 0, step * _PICTURES, step)]
    if not found:
        raise ArgumentError(f"--pictures {pictures}: there are no pictures in it")
    return found


def _told(folder: Path) -> str:
    """What is in a folder of weights, in a few words."""
    kinds = [path.name for path in sorted(folder.glob("*.pth"))]
    if (folder / RECORD).is_file():
        kinds.append(f"ONNX {Exported.read(folder).precision}")
    elif any(folder.glob("*.onnx")):
        kinds.append("ONNX")
    return f"{folder} ({', '.join(kinds) or 'empty'})"


def _copied(files: Iterable[Path], folder: Path, name: str | None = None) -> None:
    """Copy files into a folder, in which they replace others when all of them are whole."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder, prefix=".import-") as temporary:
            for file in files:
                target = folder / (name or file.name)
                if not (target.exists() and target.samefile(file)):
                    shutil.copyfile(file, Path(temporary, target.name))
            for staged in sorted(Path(temporary).iterdir(), key=lambda path: path.name == RECORD):
                staged.replace(folder / staged.name)
    except OSError as error:
        raise SinkError(f"{folder} cannot be written: {error.strerror or error}") from error


def _check_apart(
    option: str, folder: Path, inputs: list[NamedPath], pictures: str | None = None
) -> None:
    """Refuse a folder in which the export would replace what it reads."""
    names = (*(f"{piece}.onnx" for piece in _PIECES), RECORD)
    outputs = [(option, folder), *((option, folder / name) for name in names)]
    if pictures is None:
        check_apart(outputs, inputs)
    else:
        check_apart_from_source(outputs, pictures, inputs)
