"""The weights published by the trackers' authors, and their sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = [
    "MODEL_ZOO",
    "OTHER_WEIGHTS",
    "PublishedFile",
    "PublishedWeights",
    "how_to_get_weights",
]


@dataclass(frozen=True)
class PublishedFile:
    """One file of weights, and what is known of it.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
    address : str
        Of the file itself, for a download.
    size : int or None
        Bytes; None if the authors do not state it.
    sha256 : str or None
        64 hexadecimal digits; None if the authors do not state it.
    """

    name: str
    address: str
    size: int | None = None
    sha256: str | None = None


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
    files : tuple of PublishedFile
        The files, if they have direct addresses.
    authors_folders : tuple of str
        Other names of the folder: those in the authors' repositories.
    use : str
        What the files are for, if no tracker of this package runs them.
    """

    network: str
    source: str
    file: str
    license: str
    folder: str
    size: str = "unknown"
    files: tuple[PublishedFile, ...] = ()
    authors_folders: tuple[str, ...] = ()
    use: str = ""


_DRIVE_FOLDER: Final = "https://drive.google.com/drive/folders/"
# Folders of pysot's MODEL_ZOO.md on Google Drive, by network; each has a model.pth.
_PYSOT: Final = {
    "siamrpn_alex_dwxcorr": "1t62x56Jl7baUzPTo0QrC4jJnwvPZm-2m",
    "siamrpn_mobilev2_l234_dwxcorr": "1JB94pZTvB1ZByU-qSJn4ZAIfjLWE5EBJ",
    "siamrpn_r50_l234_dwxcorr": "1Q4-1563iPwV6wSf_lBHDj5CPFiGSlEPG",
    "siamrpn_r50_l234_dwxcorr_otb": "1Cx_oHu6o0gNeH7F9zZrgevfAGdyWC4D5",
    "siammask_r50_l3": "1YbPUQVTYw_slAvk_DchvRY-7B6rnSXP9",
}
_OXFORD: Final = "http://www.robots.ox.ac.uk/~qwang/"
# The repository as of 2023-10-26. Sizes and digests are those of the files in this commit.
_SIAMTRACKERS: Final = (
    "https://raw.githubusercontent.com/HonglinChu/SiamTrackers/"
    "248663fde6bf7c40190cf10ee396d5662919ecd3"
)
_SIAMFC_DRIVE: Final = "https://drive.google.com/uc?id=1UdxuBQ1qtisoWYFZxLgMFJ9mJtGVw6n4"
_SIAMFC: Final = (
    "github.com/huanglianghua/siamfc-pytorch (Google Drive 1UdxuBQ1qtisoWYFZxLgMFJ9mJtGVw6n4)"
)
_SIAMMASK: Final = "siammask_r50_l3"
# The commit that OpenCV's samples/python/tracker.py names. Size and digest are those of its Git LFS
# pointer.
_OPENCV_ZOO: Final = (
    "https://github.com/opencv/opencv_zoo/raw/fef72f8fa7c52eaf116d3df358d24e6e959ada0e/"
    "models/object_tracking_vittrack/"
)
# The repository as of 2024-06-04. Sizes and digests are those of the files in this commit.
_FEAR: Final = (
    "https://raw.githubusercontent.com/PinataFarms/FEARTracker/"
    "0a3bd039918909c79c1b7e55a4bfb7807520abde/evaluate/FEARDemo/FEARDemo/"
)


def _pysot(network: str) -> PublishedWeights:
    source = f"{_DRIVE_FOLDER}{_PYSOT[network]} (github.com/STVIR/pysot, MODEL_ZOO.md)"
    return PublishedWeights(network, source, "model.pth", "CC BY-SA 3.0", network)


def _oxford(tracker: str, file: str) -> PublishedWeights:
    files = (PublishedFile(file, _OXFORD + file),)
    return PublishedWeights(_SIAMMASK, _OXFORD + file, file, "MIT", tracker, files=files)


def _nanotrack(tracker: str, *files: tuple[str, int, str]) -> PublishedWeights:
    folder = tracker.replace("_", "")
    address = f"{_SIAMTRACKERS}/NanoTrack/models/{folder}/"
    return PublishedWeights(
        tracker,
        "github.com/HonglinChu/SiamTrackers",
        "two .onnx files",
        "Apache-2.0",
        tracker,
        f"{sum(size for _, size, _ in files)} bytes",
        tuple(PublishedFile(name, address + name, size, digest) for name, size, digest in files),
        (folder,),
    )


MODEL_ZOO: Final[dict[str, PublishedWeights]] = {
    "nanotrack_v1": _nanotrack(
        "nanotrack_v1",
        (
            "nanotrack_backbone_sim.onnx",
            767819,
            "f6fdf311bdc846510c2f9f0b2b8159c7e0cf5d80ed18c9079faeb32db460cba9",
        ),
        (
            "nanotrack_head_sim.onnx",
            392202,
            "4c987e5121cc400b6175f2168c30c84857864fe36d5e7a14df0c27e8e5b9540d",
        ),
    ),
    "nanotrack_v2": _nanotrack(
        "nanotrack_v2",
        (
            "nanotrack_backbone_sim.onnx",
            1056849,
            "530bdd0cd00f19afab79a863e71ba71e3312395a5dc9151af675082bdaaa2fc4",
        ),
        (
            "nanotrack_head_sim.onnx",
            726198,
            "0d8c0637be849f092cc7236cae02e55c8b9455ebe37ba50601d6115db4247cd9",
        ),
    ),
    "nanotrack_v3": _nanotrack(
        "nanotrack_v3",
        (
            "nanotrack_backbone.onnx",
            1431635,
            "50be1320abf9384fd3479ea829f95e244cf3f3838190c5ab60c750fb8c1ce828",
        ),
        (
            "nanotrack_head.onnx",
            1183740,
            "75357903be3f4817c965af16cb5a11fd32b1467f597a408405a98635ac63f61d",
        ),
    ),
    "fear_xs": PublishedWeights(
        "fear_xs",
        "github.com/PinataFarms/FEARTracker (as Core ML, which ssiam weights get fear_xs_coreml "
        "brings; to be converted to fear_template.onnx and fear_search.onnx)",
        "fear_xs/fear_template.onnx",
        "MIT",
        "fear_xs",
        "about 5.4 MB as ONNX",
    ),
    "siamfc": PublishedWeights(
        *("siamfc", _SIAMFC, "siamfc_alexnet_e50.pth", "MIT", "siamfc", "about 9.4 MB"),
        (PublishedFile("siamfc_alexnet_e50.pth", _SIAMFC_DRIVE),),
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

OTHER_WEIGHTS: Final[dict[str, PublishedWeights]] = {
    "vittrack": PublishedWeights(
        "vittrack",
        "github.com/opencv/opencv_zoo",
        "object_tracking_vittrack_2023sep.onnx",
        "Apache-2.0",
        "vittrack",
        "714726 bytes",
        (
            PublishedFile(
                "object_tracking_vittrack_2023sep.onnx",
                f"{_OPENCV_ZOO}object_tracking_vittrack_2023sep.onnx",
                714726,
                "2990f0b7cd44d92afa48cd97db6de7be113fc1d9594fddb74e2725c10478e91d",
            ),
        ),
        use="OpenCV's cv2.TrackerVit",
    ),
    "fear_xs_coreml": PublishedWeights(
        "fear_xs",
        "github.com/PinataFarms/FEARTracker",
        "two Core ML files",
        "MIT",
        "fear_xs_coreml",
        "4235685 bytes",
        (
            PublishedFile(
                "TrackerInit.mlmodel",
                f"{_FEAR}TrackerInit.mlmodel",
                1529755,
                "4e14305e2f35fd8d48da86d0b1bc81d174cd2b3984bfc0a3aefae5bdd47fb44d",
            ),
            PublishedFile(
                "Tracker.mlmodel",
                f"{_FEAR}Tracker.mlmodel",
                2705930,
                "2c01e12ee22f4effcbe0b4d68120b5ff99929c46280c0b9dca0c46230b7de47f",
            ),
        ),
        use=(
            "the tracker fear_xs and ssiam train, which read them as ONNX: convert them to "
            "fear_template.onnx and fear_search.onnx"
        ),
    ),
}
"""Published weights in a form that no tracker of this package runs."""


def how_to_get_weights(tracker: str) -> str:
    """The command that brings the weights of a tracker, and what it needs."""
    published = MODEL_ZOO[tracker]
    if published.files:
        return f"ssiam weights get {tracker}"
    return (
        f"get {published.file} at {published.source}, then: ssiam weights import "
        f"{published.file} --tracker {tracker}"
    )
