"""The weights published by the trackers' authors, and their sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["MODEL_ZOO", "PublishedWeights"]


@dataclass(frozen=True)
class PublishedWeights:
    """A file of weights published by its authors.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    network : str
        This package's name of the network. Trackers that share a network may differ in the file.
    source : str
        Address of the file, or of a page that links to it.
    file : str
        Name of the file at the source.
    license : str
        License of the weights.
    folder : str
        Name of the folder for imported weights, which is the name of a tracker that uses the file.
    size : str
        Size of the file, as stated at the source.
    """

    network: str
    source: str
    file: str
    license: str
    folder: str
    size: str = "unknown"


_PYSOT: Final = "github.com/STVIR/pysot, MODEL_ZOO.md (Google Drive, Baidu)"
_OXFORD: Final = "http://www.robots.ox.ac.uk/~qwang/"
_SIAMFC: Final = (
    "github.com/huanglianghua/siamfc-pytorch (Google Drive 1UdxuBQ1qtisoWYFZxLgMFJ9mJtGVw6n4)"
)
_SIAMMASK: Final = "siammask_r50_l3"


def _pysot(network: str) -> PublishedWeights:
    return PublishedWeights(network, _PYSOT, "model.pth", "CC BY-SA 3.0", network)


def _oxford(tracker: str, file: str) -> PublishedWeights:
    return PublishedWeights(_SIAMMASK, _OXFORD + file, file, "MIT", tracker)


def _nanotrack(tracker: str) -> PublishedWeights:
    source = "github.com/HonglinChu/SiamTrackers"
    return PublishedWeights(tracker, source, "two .onnx files", "Apache-2.0", tracker)


MODEL_ZOO: Final[dict[str, PublishedWeights]] = {
    "nanotrack_v1": _nanotrack("nanotrack_v1"),
    "nanotrack_v2": _nanotrack("nanotrack_v2"),
    "nanotrack_v3": _nanotrack("nanotrack_v3"),
    "siamfc": PublishedWeights(
        "siamfc", _SIAMFC, "siamfc_alexnet_e50.pth", "MIT", "siamfc", "about 9.4 MB"
    ),
    "siamrpn_alex_dwxcorr": _pysot("siamrpn_alex_dwxcorr"),
    "siamrpn_mobilev2_l234_dwxcorr": _pysot("siamrpn_mobilev2_l234_dwxcorr"),
    "siamrpn_r50_l234_dwxcorr": _pysot("siamrpn_r50_l234_dwxcorr"),
    "siamrpn_r50_l234_dwxcorr_otb": _pysot("siamrpn_r50_l234_dwxcorr_otb"),
    "siammask_r50_l3": _pysot(_SIAMMASK),
    # The authors of SiamMask_E use pysot's weights (their README, issues 9 and 12).
    "siammask_e": _pysot(_SIAMMASK),
    "siammask_e_unrefined": _pysot(_SIAMMASK),
    "siammask_vot": _oxford("siammask_vot", "SiamMask_VOT.pth"),
    "siammask_vot18": _oxford("siammask_vot18", "SiamMask_VOT_LD.pth"),
    "siammask_davis": _oxford("siammask_davis", "SiamMask_DAVIS.pth"),
}
"""Published weights by the name of the tracker that uses them."""
