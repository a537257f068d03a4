"""`ssiam weights`: list the networks, import authors' .pth files and export them to ONNX."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Annotated, Final, Literal
from urllib.parse import urlsplit

from cyclopts import App, Parameter
from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)

from ssiam.errors import ArgumentError, WeightsError, check_choice
from ssiam.geometry import Image
from ssiam.outputs import NamedPath, check_distinct, make_folder
from ssiam.runtime import MODEL_ZOO, PublishedWeights
from ssiam.runtime.download import ReceivedBytes, download
from ssiam.runtime.files import cache_folder
from ssiam.runtime.manifest import MANIFEST_FILE, Manifest
from ssiam.runtime.model_zoo import OTHER_WEIGHTS, PublishedFile, how_to_get_weights
from ssiam.trackers import registry
from ssiam.trackers.lite import NETWORK, SHIPPED
from ssiam.trackers.weight_imports import copy_files, import_weights
from ssiam.video.source_files import check_distinct_from_source

_PIECES: Final = ("template", "search", "refine", "mask")  # a network has some of them
_CALIBRATION_IMAGES: Final = 64  # read for calibration, evenly spaced

weights = App(name="weights", help="List, download, import and export the weights of the trackers.")


@weights.command(name="list")
def show(*, folder: Path | None = None) -> None:
    """List the trackers' weights: which are available, and where their authors publish them.

    Nothing is downloaded; see ssiam weights get.

    Parameters
    ----------
    folder
        Folder to search. By default the folder of ssiam weights import, and ./weights.
    """
    print("lite: included in the package")
    folders = registry.weights_folders() if folder is None else (folder,)
    for tracker, publication in MODEL_ZOO.items():
        _print_publication(tracker, publication, registry.find_weights(publication, folders))
    print("Without a tracker that runs them:")
    for name, publication in OTHER_WEIGHTS.items():
        _print_publication(name, publication, registry.find_weights(publication, folders))
        print(f"  use: {publication.use}")


def _print_publication(name: str, publication: PublishedWeights, found: Path | None) -> None:
    print(f"{name}: {'not available' if found is None else _description(found)}")
    print(f"  published: {publication.file} at {publication.source}")
    print(f"  size {publication.size}, license {publication.license}")
    for line in _digests(publication, found):
        print(f"  {line}")


@weights.command(name="get")
def get(name: str, /, *, folder: Path | None = None) -> None:
    """Download weights that their authors publish at a direct address, and import them.

    An interrupted download continues where it stopped. Size and SHA-256 are checked where they are
    known. Proxies are those of the environment (https_proxy). Nothing in the files is run.

    Parameters
    ----------
    name
        The tracker: nanotrack_..., siammask_..., siamfc (needs gdown, for Google Drive). Also
        vittrack and fear_xs_coreml, which no tracker of ssiam runs: their files are only stored.
    folder
        Folder to store them in. By default the folder weights in the user's cache folder.
    """
    known = {**MODEL_ZOO, **OTHER_WEIGHTS}
    published = known[check_choice("tracker with weights", name, tuple(known))]
    if not published.files:
        raise WeightsError(f"{name}: there is no direct address; {how_to_get_weights(name)}")
    store = folder or cache_folder() / "weights"
    found = registry.find_weights(published, [store])
    if found is not None:
        print(f"{name}: {_description(found)}, nothing to do")
        return
    arrived = cache_folder() / "downloads" / name
    for file in published.files:
        if not (arrived / file.name).is_file():
            _download(file, arrived)
        print(f"{file.address}: {(arrived / file.name).stat().st_size} bytes")
    try:
        if name in OTHER_WEIGHTS:
            target = store / published.folder
            copy_files([arrived / file.name for file in published.files], target)
            print(f"stored in {target}, license {published.license}; use: {published.use}")
        else:
            source = arrived if len(published.files) > 1 else arrived / published.files[0].name
            stored = import_weights(source, name, folder)
            print(f"stored in {stored.folder} for {name}, license {published.license}")
    except WeightsError:
        shutil.rmtree(arrived, ignore_errors=True)  # so that the next call downloads it again
        raise
    shutil.rmtree(arrived, ignore_errors=True)


def _download(file: PublishedFile, folder: Path) -> None:
    if urlsplit(file.address).hostname != "drive.google.com":
        with _progress_bar(file) as progress:
            download(file, folder, progress)
        return
    try:
        import gdown
    except ImportError:
        raise WeightsError(
            f"{file.name} is at {file.address} (Google Drive): pip install gdown, or get it there "
            "and give it to ssiam weights import"
        ) from None
    make_folder(folder)
    part = folder / f"{file.name}.part"
    if gdown.download(file.address, str(part), quiet=True, resume=True) is None:
        raise WeightsError(f"{file.address}: gdown brought no file; get {file.name} there")
    part.replace(folder / file.name)


@contextmanager
def _progress_bar(file: PublishedFile) -> Iterator[ReceivedBytes]:
    """A progress bar on standard error, if that is a terminal."""
    console = Console(file=sys.stderr)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress_bar:
        task = progress_bar.add_task(file.name, total=file.size)

        def show(received: int, total: int | None) -> None:
            progress_bar.update(task, completed=received, total=total)

        yield show


@weights.command(name="import")
def import_(
    file: Path,
    /,
    *,
    tracker: str | None = None,
    folder: Path | None = None,
    replace: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Import weights as their authors publish them: identify, check and store them.

    A .pth file is copied and exported to ONNX, which every runtime accepts; PyTorch is needed only
    for the import. Other weights of the tracker are kept unless --replace is given.

    Parameters
    ----------
    file
        The .pth file, the authors' folder of it, the folder of the two .onnx files of NanoTrack or
        FEAR-XS, or a folder written by ssiam weights export.
    tracker
        Tracker for which they are stored, if several have the same network (siammask_...). By
        default the tracker that is named like the network, or like the file of SiamMask's authors.
    folder
        Folder to store them in. By default the folder weights in the user's cache folder.
    replace
        Replace other weights of the tracker.
    """
    stored = import_weights(file, tracker, folder, replace=replace)
    print(f"{file}: {stored.network}")
    print(f"stored in {stored.folder} for {stored.tracker}")


@weights.command(name="export")
def export(
    name: str,
    file: Path | None = None,
    /,
    *,
    out: Path = Path("weights"),
    precision: Literal["f32", "int8"] = "f32",
    calibration_source: Annotated[
        str | None, Parameter(name="--pictures", allow_leading_hyphen=True)
    ] = None,
) -> None:
    """Export the network of an authors' .pth file to ONNX, for OpenVINO and ONNX Runtime.

    The exported files are stored only if their outputs agree with PyTorch's. lite is in ONNX
    already: this writes it in int8.

    Parameters
    ----------
    name
        The tracker: lite, siamfc, siamrpn_..., siammask_...
    file
        The .pth file; for lite the folder of a network that ssiam train has written, by default
        the one in the package.
    out
        Folder in which a folder named after the tracker is written.
    precision
        int8 quantizes the parts that run on every frame, and needs --pictures.
    calibration_source
        Video or folder of images to calibrate int8 on, similar to those that will be tracked.
    """
    known = [each for each in MODEL_ZOO if not each.startswith(("nanotrack", "fear"))]
    tracker = check_choice("tracker to export", name, ("lite", *known))
    if tracker == "lite":
        if precision != "int8":
            raise ArgumentError("lite is in ONNX already: give --precision int8")
        file = file or SHIPPED
    elif file is None:
        raise ArgumentError(f"{tracker}: give the authors' .pth file after the name")
    _check_folder("--out", out / tracker, [("the weights", file)], calibration_source)
    images = [] if calibration_source is None else _calibration_images(calibration_source)
    network = _export(file, out / tracker, tracker, precision, images)
    print(f"{file}: {network}, {precision}, written to {out / tracker}")


def _export(
    file: Path, target: Path, name: str, precision: Literal["f32", "int8"], images: Sequence[Image]
) -> str:
    """Write the files; returns the name of the network."""
    from ssiam.runtime.export import export_network, quantize_export

    if name == "lite":
        return quantize_export(file, target, NETWORK, images).network
    network = MODEL_ZOO[name].network
    export_network(file, target, name=name, network=network, precision=precision, images=images)
    return network


def _calibration_images(source: str) -> list[Image]:
    """Frames of a source, spread over all of it if its length is known."""
    from ssiam.video import open_source

    with open_source(source) as frames:
        step = max((frames.length or 0) // _CALIBRATION_IMAGES, 1)
        found = [frame.image for frame in islice(frames, 0, step * _CALIBRATION_IMAGES, step)]
    if not found:
        raise ArgumentError(f"--pictures {source}: contains no images")
    return found


def _digests(publication: PublishedWeights, folder: Path | None) -> list[str]:
    """Lines with the SHA-256 of the files: the authors', else that of the imported file."""
    stated = [
        f"{file.name}: {file.size} bytes, SHA-256 {file.sha256}"
        for file in publication.files
        if file.sha256 is not None
    ]
    if stated or folder is None or not (folder / MANIFEST_FILE).is_file():
        return stated or ["SHA-256 not stated by the authors; that of the first import is kept"]
    return [f"SHA-256 of the imported file {Manifest.read(folder).sha256}"]


def _description(folder: Path) -> str:
    """Short description of a folder of weights."""
    kinds = [path.name for path in sorted(folder.glob("*.pth"))]
    if (folder / MANIFEST_FILE).is_file():
        kinds.append(f"ONNX {Manifest.read(folder).precision}")
    elif any(folder.glob("*.onnx")):
        kinds.append("ONNX")
    elif any(folder.glob("*.mlmodel")):
        kinds.append("Core ML")
    return f"{folder} ({', '.join(kinds) or 'empty'})"


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
