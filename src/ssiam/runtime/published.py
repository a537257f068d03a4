"""Where the authors of the trackers publish their networks' weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["PUBLISHED", "Publication"]


@dataclass(frozen=True)
class Publication:
    """One file of weights, as its authors publish it.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    network : str
        Whose weights they are, in this package's names; trackers with one network may still have
        a file each.
    where : str
        Address, or page that links to it.
    file : str
        Its name there.
    licence : str
        Of the weights.
    size : str
        As far as the authors or their page tell it.
    local : str
        Folder in which it is kept here, that of the tracker whose file it is.
    """

    network: str
    where: str
    file: str
    licence: str
    local: str
    size: str = "unknown"


_ZOO: Final = "github.com/STVIR/pysot, MODEL_ZOO.md (Google Drive, Baidu)"
_OXFORD: Final = "http://www.robots.ox.ac.uk/~qwang/"
_SIAMFC: Final = (
    "github.com/huanglianghua/siamfc-pytorch (Google Drive 1UdxuBQ1qtisoWYFZxLgMFJ9mJtGVw6n4)"
)
_MASK: Final = "siammask_r50_l3"


def _zoo(network: str) -> Publication:
    return Publication(network, _ZOO, "model.pth", "CC BY-SA 3.0", network)


def _oxford(tracker: str, file: str) -> Publication:
    return Publication(_MASK, _OXFORD + file, file, "MIT", tracker)


def _nanotrack(tracker: str) -> Publication:
    where = "github.com/HonglinChu/SiamTrackers"
    return Publication(tracker, where, "two .onnx files", "Apache-2.0", tracker)


PUBLISHED: Final[dict[str, Publication]] = {
    "nanotrack_v1": _nanotrack("nanotrack_v1"),
    "nanotrack_v2": _nanotrack("nanotrack_v2"),
    "nanotrack_v3": _nanotrack("nanotrack_v3"),
    "siamfc": Publication(
        "siamfc", _SIAMFC, "siamfc_alexnet_e50.pth", "MIT", "siamfc", "about 9.4 MB"
    ),
    "siamrpn_alex_dwxcorr": _zoo("siamrpn_alex_dwxcorr"),
    "siamrpn_mobilev2_l234_dwxcorr": _zoo("siamrpn_mobilev2_l234_dwxcorr"),
    "siamrpn_r50_l234_dwxcorr": _zoo("siamrpn_r50_l234_dwxcorr"),
    "siamrpn_r50_l234_dwxcorr_otb": _zoo("siamrpn_r50_l234_dwxcorr_otb"),
    "siammask_r50_l3": _zoo(_MASK),
    # SiamMask_E has no weights of its own: its authors name pysot's (README, issues 9 and 12).
    "siammask_e": _zoo(_MASK),
    "siammask_e_unrefined": _zoo(_MASK),
    "siammask_vot": _oxford("siammask_vot", "SiamMask_VOT.pth"),
    "siammask_vot18": _oxford("siammask_vot18", "SiamMask_VOT_LD.pth"),
    "siammask_davis": _oxford("siammask_davis", "SiamMask_DAVIS.pth"),
}
