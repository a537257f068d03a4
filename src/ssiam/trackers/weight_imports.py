"""`import_weights`: store weights that their authors publish where the trackers find them."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Final, NamedTuple, get_args

from ssiam.errors import WeightsError, check_choice
from ssiam.outputs import check_distinct, make_folder, output_error
from ssiam.runtime import MODEL_ZOO, RuntimeOptions
from ssiam.runtime.files import cache_folder, sha256, weights_sha256
from ssiam.runtime.manifest import MANIFEST_FILE, Manifest, find_export
from ssiam.trackers.fear import FearNetworks, fear_pair
from ssiam.trackers.nanotrack import NanoTrackName, NanoTrackNetworks, onnx_pair
from ssiam.unfinished import staging_folder

_SIAMMASK: Final = "siammask_r50_l3"
_DIGITS: Final = 12  # of a SHA-256, in messages


class ImportedWeights(NamedTuple):
    """Weights that were stored.

    Attributes
    ----------
    network : str
    tracker : str
    folder : Path
    """

    network: str
    tracker: str
    folder: Path


def import_weights(
    source: Path, tracker: str | None = None, folder: Path | None = None, *, replace: bool = False
) -> ImportedWeights:
    """Recognize weights, check them, and store them for the trackers.

    A .pth file is copied and exported to ONNX. Other weights in the same place are kept.

    Parameters
    ----------
    source : Path
        The authors' .pth file, their folder of it, a folder of the two .onnx files of NanoTrack or
        FEAR-XS, or a folder that `ssiam weights export` has written.
    tracker : str, optional
        For weights that several trackers could use. By default the one with the network's name;
        for the files of SiamMask's authors the one that their names say.
    folder : Path, optional
        Folder of all weights. By default ``weights`` in the user's cache folder.
    replace : bool
        Replace other weights of the tracker.

    Raises
    ------
    WeightsError
        The weights are missing, damaged, unknown or of another network than the tracker's, several
        trackers could use them, or other weights would be replaced.
    MissingExtraError
        PyTorch or onnx, which a .pth file needs, is not installed.
    SinkError
        The folder cannot be written.
    """
    file = _checkpoint_in(source)
    network = _network_of(file)
    name = _tracker_of(file, network) if tracker is None else tracker
    if tracker is not None:
        check_choice("tracker with weights", tracker, tuple(MODEL_ZOO))
    if name not in MODEL_ZOO:
        raise WeightsError(f"weights {file} are those of {network}, which no tracker uses")
    if MODEL_ZOO[name].network != network:
        raise WeightsError(
            f"weights {file} are those of {network}, but {name} has {MODEL_ZOO[name].network}"
        )
    target = (folder or cache_folder() / "weights") / MODEL_ZOO[name].folder
    _store(file, network, name, target, replace)
    return ImportedWeights(network, name, target)


def _checkpoint_in(source: Path) -> Path:
    """The only .pth file of a folder as the authors publish it, else the path itself."""
    if source.is_dir() and find_export(source) is None and not any(source.glob("*.onnx")):
        files = sorted(source.glob("*.pth"))
        if len(files) != 1:
            raise WeightsError(
                f"weights folder {source} holds {len(files)} .pth files: give one of them"
            )
        return files[0]
    return source


def _network_of(file: Path) -> str:
    """Name of the network in a checkpoint, an exported folder or NanoTrack's folder."""
    exported = find_export(file)
    if exported is not None:
        return Manifest.read(exported).network
    if _is_fear(file):
        FearNetworks.load(file, RuntimeOptions())  # raises: they are damaged or of another network
        return "fear_xs"
    if file.suffix == ".onnx":
        raise WeightsError(
            f"weights {file} are ONNX without a {MANIFEST_FILE} beside them: give the folder of "
            "NanoTrack's or FEAR-XS's two files, or the file to a tracker directly"
        )
    if file.is_dir():
        return _nanotrack_of(file)
    from ssiam.networks import read_checkpoint

    return read_checkpoint(file).name


def _is_fear(path: Path) -> bool:
    """Whether this is the folder of FEAR-XS's two .onnx files, or one of them."""
    is_named = path.name.startswith("fear_") and path.suffix == ".onnx"
    return (path.is_dir() and any(path.glob("fear_*.onnx"))) or (path.is_file() and is_named)


def _nanotrack_of(path: Path) -> str:
    """The version of NanoTrack's pair of .onnx files."""
    onnx_pair(path)  # raises: there are not two
    options, reasons = RuntimeOptions(), []
    for name in get_args(NanoTrackName):
        try:
            NanoTrackNetworks.load(name, path, options)
        except WeightsError as error:
            reasons.append(error)
        else:
            return str(name)
    raise reasons[-1]


def _tracker_of(file: Path, network: str) -> str:
    """The tracker that a network's file is for, if nobody says it."""
    exported = find_export(file)
    if exported is not None:
        return Manifest.read(exported).name
    if network != _SIAMMASK:
        return network
    from ssiam.networks.checkpoints import is_of_siammask_authors

    if not is_of_siammask_authors(file):
        return network
    trackers = {
        publication.file: name
        for name, publication in MODEL_ZOO.items()
        if publication.network == network and publication.files
    }
    if file.name not in trackers:
        raise WeightsError(
            f"weights {file} are of SiamMask's authors, who publish {', '.join(trackers)}: "
            f"give --tracker, one of {', '.join(trackers.values())}"
        )
    return trackers[file.name]


def _store(file: Path, network: str, name: str, target: Path, replace: bool) -> None:
    exported = find_export(file)
    if not replace:
        _check_not_others(file, target)
    if exported is not None:
        pieces = [exported / f"{piece}.onnx" for piece in Manifest.read(exported).pieces]
        copy_files([*pieces, exported / MANIFEST_FILE], target)
    elif network.startswith("nanotrack"):
        copy_files(onnx_pair(file), target)
    elif network == "fear_xs":
        copy_files(fear_pair(file), target)
    else:
        from ssiam.runtime.export import export_network

        names = (*(f"{piece}.onnx" for piece in ("template", "search", "refine")), MANIFEST_FILE)
        outputs = [("--folder", target), *(("--folder", target / each) for each in names)]
        check_distinct(outputs, [("the weights", file)])
        export_network(file, target, name=name, network=network)
        copy_files([file], target, f"{network}.pth")


def _check_not_others(file: Path, target: Path) -> None:
    """Raise `WeightsError` if the folder holds weights of another file."""
    held, given = _origin(target), _origin(file)
    if held is not None and held != given:
        raise WeightsError(
            f"{target} holds other weights (SHA-256 {held[:_DIGITS]}..., those of {file} have "
            f"{(given or '')[:_DIGITS]}...): give --replace to replace them"
        )


def _origin(path: Path) -> str | None:
    """Digest of the file that weights were made of, with int8 told apart; None without weights."""
    folder = find_export(path)
    if folder is not None:
        manifest = Manifest.read(folder)
        return manifest.sha256 + ("" if manifest.precision == "f32" else f" {manifest.precision}")
    if path.is_file() and path.suffix != ".onnx":
        return sha256(path)
    try:
        return weights_sha256(path)
    except WeightsError:
        return None


def copy_files(files: Iterable[Path], folder: Path, name: str | None = None) -> None:
    """Copy files into a folder; existing ones are replaced after all copies are complete.

    Raises
    ------
    SinkError
        The folder cannot be written.
    """
    make_folder(folder)
    try:
        with staging_folder(folder, ".import-") as temporary:
            for file in files:
                target = folder / (name or file.name)
                if not (target.exists() and target.samefile(file)):
                    shutil.copyfile(file, temporary / target.name)
            for staged in sorted(temporary.iterdir(), key=lambda path: path.name == MANIFEST_FILE):
                staged.replace(folder / staged.name)
    except OSError as error:
        raise output_error(folder, error) from error
