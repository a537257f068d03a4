"""Published results, listed next to the measured ones; None where the source has no number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

Source: TypeAlias = Literal["paper", "siammask_e", "pysot", "SiamTrackers"]


@dataclass(frozen=True)
class Published:
    """One published row: a tracker on a year of VOT, supervised runs.

    Attributes
    ----------
    tracker : str
        As its source names it; "S-" means stabilized.
    year : int
    source : str
        "paper": Wang, Zhao and Su, "Real-time Tracking with Stabilized Frame", Table 1; where it
        prints only R, the number of lost targets follows from R. "siammask_e": the table of
        github.com/baoxinchen/siammask_e, with lost targets counted in its raw results.
        "pysot": the model zoo of github.com/STVIR/pysot. "SiamTrackers": the README of
        github.com/HonglinChu/SiamTrackers.
    accuracy, robustness, eao : float, optional
        pysot's conventions: robustness is lost targets per 100 frames.
    lost : int, optional
    fps : float, optional
        Frames per second, on the source's machine.
    label : str
        Folder name of results of the same tracker: `Entry.label` for trackers of this package, or a
        folder of siammask_e's raw results; empty if there are neither.
    """

    tracker: str
    year: int
    source: Source
    accuracy: float | None = None
    robustness: float | None = None
    eao: float | None = None
    lost: int | None = None
    fps: float | None = None
    label: str = ""


ROWS: Final = (
    Published("SiamFC", 2016, "paper", None, None, None, 71, 121),
    Published("S-SiamFC", 2016, "paper", None, None, None, 56, 58),
    Published("SiamRPN++", 2016, "paper", 0.643, 0.200, 0.461, 43, 34),
    Published("S-SiamRPN++", 2016, "paper", None, None, None, 40, 23),
    Published("SiamMask_E", 2016, "paper", None, None, None, 50, 55),
    Published("S-SiamMask_E", 2016, "paper", None, None, 0.463, 45, 33),
    Published("SiamFC", 2018, "paper", 0.479, 0.492, 0.224, 105, 121),
    Published("S-SiamFC", 2018, "paper", None, 0.450, None, 96, 58),
    Published("SiamRPN++", 2018, "paper", 0.600, 0.234, 0.415, 50, 34),
    Published("S-SiamRPN++", 2018, "paper", None, None, None, 49, 23),
    Published("SiamMask_E", 2018, "paper", 0.649, 0.267, 0.432, 57, 55),
    Published("S-SiamMask_E", 2018, "paper", None, 0.243, 0.449, 52, 33),
    Published("SiamFC", 2019, "paper", None, None, None, 137, 121),
    Published("S-SiamFC", 2019, "paper", None, None, None, 115, 58),
    Published("SiamRPN++", 2019, "paper", 0.595, 0.467, 0.290, 93, 34),
    Published("S-SiamRPN++", 2019, "paper", None, None, None, 89, 23),
    Published("SiamMask_E", 2019, "paper", None, None, None, 99, 55),
    Published("S-SiamMask_E", 2019, "paper", None, None, 0.309, 95, 33),
    Published("SiamRPN++", 2016, "siammask_e", 0.642, 0.196, 0.464, 42, 46, "model_SiamRPN"),
    Published("SiamMask", 2016, "siammask_e", 0.621, 0.214, 0.436, 46, 87, "model_SiamMask"),
    Published("SiamMask_E", 2016, "siammask_e", 0.645, 0.210, 0.452, 45, 85, "model_SiamMask_E"),
    Published(
        "SiamMask_E_Ref", 2016, "siammask_e", 0.677, 0.224, 0.466, 48, 80, "model_SiamMask_E_ref"
    ),
    Published("SiamRPN++", 2018, "siammask_e", 0.601, 0.234, 0.415, 50, 46, "model_SiamRPN"),
    Published("SiamMask", 2018, "siammask_e", 0.598, 0.248, 0.406, 53, 87, "model_SiamMask"),
    Published("SiamMask_E", 2018, "siammask_e", 0.627, 0.248, 0.427, 53, 85, "model_SiamMask_E"),
    Published(
        "SiamMask_E_Ref", 2018, "siammask_e", 0.655, 0.253, 0.446, 54, 80, "model_SiamMask_E_ref"
    ),
    Published("SiamRPN++", 2019, "siammask_e", 0.595, 0.467, 0.287, 93, 46, "model_SiamRPN"),
    Published("SiamMask", 2019, "siammask_e", 0.596, 0.467, 0.283, 93, 87, "model_SiamMask"),
    Published("SiamMask_E", 2019, "siammask_e", 0.625, 0.482, 0.298, 96, 85, "model_SiamMask_E"),
    Published(
        "SiamMask_E_Ref", 2019, "siammask_e", 0.652, 0.487, 0.309, 97, 80, "model_SiamMask_E_ref"
    ),
    Published("siamrpn_alex_dwxcorr", 2016, "pysot", 0.618, 0.238, 0.393, None, 180),
    Published("siamrpn_r50_l234_dwxcorr", 2016, "pysot", 0.642, 0.196, 0.464, None, 35),
    Published("siamrpn_mobilev2_l234_dwxcorr", 2016, "pysot", 0.624, 0.214, 0.455, None, 75),
    Published("siammask_r50_l3", 2016, "pysot", 0.634, 0.219, 0.455, None, 56),
    Published("siamrpn_alex_dwxcorr", 2018, "pysot", 0.576, 0.290, 0.352, None, 180),
    Published("siamrpn_r50_l234_dwxcorr", 2018, "pysot", 0.601, 0.234, 0.415, None, 35),
    Published("siamrpn_mobilev2_l234_dwxcorr", 2018, "pysot", 0.586, 0.229, 0.410, None, 75),
    Published("siammask_r50_l3", 2018, "pysot", 0.615, 0.248, 0.423, None, 56),
    Published("siamrpn_alex_dwxcorr", 2019, "pysot", 0.573, 0.547, 0.260, None, 180),
    Published("siamrpn_r50_l234_dwxcorr", 2019, "pysot", 0.595, 0.467, 0.287, None, 35),
    Published("siamrpn_mobilev2_l234_dwxcorr", 2019, "pysot", 0.580, 0.446, 0.292, None, 75),
    Published("siammask_r50_l3", 2019, "pysot", 0.597, 0.461, 0.283, None, 56),
    Published("NanoTrack V1", 2018, "SiamTrackers", eao=0.311, label="nanotrack_v1-off"),
    Published("NanoTrack V2", 2018, "SiamTrackers", eao=0.352, label="nanotrack_v2-off"),
    Published("NanoTrack V3", 2018, "SiamTrackers", eao=0.449, label="nanotrack_v3-off"),
    Published("NanoTrack V1", 2019, "SiamTrackers", eao=0.247, label="nanotrack_v1-off"),
    Published("NanoTrack V2", 2019, "SiamTrackers", eao=0.270, label="nanotrack_v2-off"),
    Published("NanoTrack V3", 2019, "SiamTrackers", eao=0.296, label="nanotrack_v3-off"),
)

# Table 4 of the paper: lost targets of SiamMask_E by sequence of VOT2018, not stabilized.
ORIGINAL_LOST: Final = {
    "soccer2": 3,
    "soccer1": 4,
    "wiper": 2,
    "helicopter": 2,
    "blanket": 2,
    "rabbit": 2,
    "girl": 4,
    "book": 4,
}
ORIGINAL_YEAR: Final = 2018
