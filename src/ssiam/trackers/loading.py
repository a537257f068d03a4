"""Trackers that have networks, built from weights that the user has."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Literal, TypeAlias

from ssiam.errors import WeightsError
from ssiam.runtime import MODEL_ZOO, PublishedWeights, RuntimeOptions
from ssiam.trackers import siammask, siamrpn
from ssiam.trackers.siamfc import SiamFc, SiamFcName, SiamFcNetworks
from ssiam.trackers.siammask import SiamMask, SiamMaskName, SiamMaskNetworks, SiamMaskParameters
from ssiam.trackers.siamrpn import SiamRpn, SiamRpnName, SiamRpnNetworks, SiamRpnParameters

SiameseName: TypeAlias = Literal[SiamFcName, SiamRpnName, SiamMaskName]

_PARAMETERS: Final[dict[str, SiamRpnParameters]] = {
    name: parameters
    for name, parameters in (*siamrpn.PARAMETERS.items(), *siammask.PARAMETERS.items())
}


def siamese_tracker(
    name: SiameseName, weights: Path, running: RuntimeOptions
) -> SiamFc | SiamRpn | SiamMask:
    """A tracker of the paper's.

    Parameters
    ----------
    name : str
    weights : Path
        The authors' .pth file, or a folder of exported .onnx files; see
        `ssiam.runtime.loading.load_pieces`, also for the errors.
    running : RuntimeOptions
    """
    from ssiam.runtime.loading import load_pieces

    pieces = load_pieces(weights, MODEL_ZOO[name].network, running)
    template, search = pieces["template"], pieces["search"]
    if name == "siamfc":
        return SiamFc(SiamFcNetworks(template, search))
    parameters = _PARAMETERS[name]
    if isinstance(parameters, SiamMaskParameters):
        return SiamMask(SiamMaskNetworks(template, search, pieces["refine"]), parameters)
    return SiamRpn(SiamRpnNetworks(template, search), parameters)


def needed_weights(name: str, weights: Path | None) -> Path:
    """`weights`, or those that were imported for the tracker; `WeightsError` if there are none."""
    if weights is not None:
        return weights
    publication = MODEL_ZOO[name]
    found = imported(publication)
    if found is None:
        raise WeightsError(
            f"tracker {name} needs weights: its authors publish {publication.file} at "
            f"{publication.source}; give its path"
        )
    return found


def imported(publication: PublishedWeights) -> Path | None:
    """Where weights have been imported, in the folders of `weight_folders`; None if nowhere."""
    folders = [folder / publication.folder for folder in weight_folders()]
    return next((folder for folder in folders if folder.is_dir()), None)


def weight_folders() -> tuple[Path, ...]:
    """Folders in which weights are looked for: the user's own, and `weights` where one stands."""
    from ssiam.runtime.files import cache_folder

    return cache_folder() / "weights", Path("weights")
