"""`ssiam weights`: list the networks, import authors' .pth files and export them to ONNX."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Final, Literal

from cyclopts import App, Parameter

from ssiam.errors import ArgumentError, WeightsError, check_choice
from ssiam.geometry import Image
from ssiam.outputs import NamedPath, check_distinct, output_error
from ssiam.runtime import MODEL_ZOO
from ssiam.runtime.files import cache_folder
from ssiam.runtime.manifest import MANIFEST_FILE, Manifest, find_export
from ssiam.trackers import registry
from ssiam.video.source_files import check_distinct_from_source

_PIECES: Final = ("template", "search", "refine", "mask")  # a network has some of them
_CALIBRATION_IMAGES: Final = 64  # read for calibration, evenly spaced

weights = App(name="weights", help="List, import and export the weights of the trackers.")


@weights.command(name="list")
def show(*, folder: Path | None = None) -> None:
    """List the trackers' weights: which are available, and where their authors publish them.

    Nothing is downloaded.

    Parameters
    ----------
    folder
        Folder to search. By default the folder of ssiam weights import, and ./weights.
    """
    print("lite: included in the package")
    folders = registry.weights_folders() if folder is None else (folder,)
    for tracker, publication in MODEL_ZOO.items():
        found = [each / publication.folder for each in folders]
        local = next((_description(path) for path in found if path.is_dir()), "not available")
        print(f"{tracker}: {local}")
        print(f"  published: {publication.file} at {publication.source}")
        print(f"  size {publication.size}, license {publication.license}")


@weights.command(name="import")
def import_(
    file: Path,
    /,
    *,
    tracker: str | None = None,
    folder: Path | None = None,
) -> None:
    """Import an authors' .pth file: identify it, check it, and store it for the trackers.

    The file is copied and exported to ONNX, which every runtime accepts; PyTorch is needed only
    for the import.

    Parameters
    ----------
    file
        The .pth file, or a folder written by ssiam weights export.
    tracker
        Tracker for which they are stored, if several have the same network (siammask_...). By
        default the tracker that is named like the network.
    folder
        Folder to store them in. By default the folder weights in the user's cache folder.
    """
    network = _network_of(file)
    name = network if tracker is None else tracker
    if name not in MODEL_ZOO:
        raise WeightsError(f"weights {file} are those of {network}, which no tracker uses")
    if MODEL_ZOO[name].network != network:
        raise WeightsError(
            f"weights {file} are those of {network}, but {name} has {MODEL_ZOO[name].network}"
        )
    print(f"{file}: {network}")
    target = (folder or cache_folder() / "weights") / MODEL_ZOO[name].folder
    exported = find_export(file)
    if exported is None:
        _check_folder("--folder", target, [("the weights", file)])
        _export(file, target, name, "f32", ())
        _copy_files([file], target, f"{network}.pth")
    else:
        pieces = [exported / f"{piece}.onnx" for piece in Manifest.read(exported).pieces]
        _copy_files([*pieces, exported / MANIFEST_FILE], target)
    print(f"stored in {target}")


@weights.command(name="export")
def export(
    name: str,
    file: Path,
    /,
    *,
    out: Path = Path("weights"),
    precision: Literal["f32", "int8"] = "f32",
    calibration_source: Annotated[
        str | None, Parameter(name="--pictures", allow_leading_hyphen=True)
    ] = None,
) -> None:
    """Export the network of an authors' .pth file to ONNX, for OpenVINO and ONNX Runtime.

    The exported files are stored only if their outputs agree with PyTorch's.

    Parameters
    ----------
    name
        The tracker: siamfc, siamrpn_..., siammask_...
    file
        The .pth file.
    out
        Folder in which a folder named after the tracker is written.
    precision
        int8 quantizes the parts that run on every frame, and needs --pictures.
    calibration_source
        Video or folder of images to calibrate int8 on, similar to those that will be tracked.
    """
    known = [each for each in MODEL_ZOO if not each.startswith("nanotrack")]
    tracker = check_choice("tracker with a .pth file", name, known)
    _check_folder("--out", out / tracker, [("the weights", file)], calibration_source)
    images = [] if calibration_source is None else _calibration_images(calibration_source)
    _export(file, out / tracker, tracker, precision, images)
    print(f"{file}: {MODEL_ZOO[tracker].network}, {precision}, written to {out / tracker}")


def _export(
    file: Path, target: Path, name: str, precision: Literal["f32", "int8"], images: Sequence[Image]
) -> None:
    from ssiam.runtime.export import export_network

    network = MODEL_ZOO[name].network
    export_network(file, target, name=name, network=network, precision=precision, images=images)


def _network_of(file: Path) -> str:
    """Name of the network in a checkpoint or an exported folder."""
    folder = find_export(file)
    if folder is not None:
        return Manifest.read(folder).network
    if file.suffix == ".onnx":
        raise WeightsError(
            f"weights {file} are ONNX without a {MANIFEST_FILE} beside them: they need no import, "
            "give them to a tracker directly"
        )
    from ssiam.networks import read_checkpoint

    return read_checkpoint(file).name


def _calibration_images(source: str) -> list[Image]:
    """Frames of a source, spread over all of it if its length is known."""
    from ssiam.video import open_source

    with open_source(source) as frames:
        step = max((frames.length or 0) // _CALIBRATION_IMAGES, 1)
        found = [frame.image for frame in islice(frames, 0, step * _CALIBRATION_IMAGES, step)]
    if not found:
        raise ArgumentError(f"--pictures {source}: contains no images")
    return found


def _description(folder: Path) -> str:
    """Short description of a folder of weights."""
    kinds = [path.name for path in sorted(folder.glob("*.pth"))]
    if (folder / MANIFEST_FILE).is_file():
        kinds.append(f"ONNX {Manifest.read(folder).precision}")
    elif any(folder.glob("*.onnx")):
        kinds.append("ONNX")
    return f"{folder} ({', '.join(kinds) or 'empty'})"


def _copy_files(files: Iterable[Path], folder: Path, name: str | None = None) -> None:
    """Copy files into a folder; existing ones are replaced after all copies are complete."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder, prefix=".import-") as temporary:
            for file in files:
                target = folder / (name or file.name)
                if not (target.exists() and target.samefile(file)):
                    shutil.copyfile(file, Path(temporary, target.name))
            for staged in sorted(
                Path(temporary).iterdir(), key=lambda path: path.name == MANIFEST_FILE
            ):
                staged.replace(folder / staged.name)
    except OSError as error:
        raise output_error(folder, error) from error


def _check_folder(
    option: str, folder: Path, inputs: list[NamedPath], source: str | None = None
) -> None:
    """Refuse a folder in which the export would replace its own input."""
    names = (*(f"{piece}.onnx" for piece in _PIECES), MANIFEST_FILE)
    outputs = [(option, folder), *((option, folder / name) for name in names)]
    if source is None:
        check_distinct(outputs, inputs)
    else:
        check_distinct_from_source(outputs, source, inputs)
