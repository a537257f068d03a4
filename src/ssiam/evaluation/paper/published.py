"""Published results, listed next to the measured ones: the paper's Tables 1 to 4, and others.

The paper is Wang, Zhao and Su, "Real-time Tracking with Stabilized Frame" (2020). Its R is lost
targets per 100 frames, as pysot-toolkit computes it: each R of Table 1 times the frames of the
dataset is a whole number of lost targets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

from ssiam.trackers import TrackerName

Source: TypeAlias = Literal["paper", "siammask_e", "pysot", "SiamTrackers"]

# Frames of each year's sequences.
FRAMES: Final = {2016: 21455, 2018: 21356, 2019: 19935}


class Measures(NamedTuple):
    """Measures of a tracker on a dataset, by pysot's conventions; None where there is no number.

    Attributes
    ----------
    accuracy : float, optional
        Mean overlap while tracking, 0 to 1.
    robustness : float, optional
        Lost targets per 100 frames.
    eao : float, optional
        Expected average overlap, 0 to 1.
    fps : float, optional
        Frames per second, on the source's machine.
    """

    accuracy: float | None = None
    robustness: float | None = None
    eao: float | None = None
    fps: float | None = None


class LostTargets(NamedTuple):
    """A row of Table 4.

    Attributes
    ----------
    stabilizes : bool
        Whether the threshold judge stabilizes the sequence.
    original, stabilized : int
        Lost targets of SiamMask_E alone, and with S-Siam.
    """

    stabilizes: bool
    original: int
    stabilized: int


@dataclass(frozen=True)
class Published:
    """One published row: a tracker on a year of VOT, supervised runs.

    Attributes
    ----------
    tracker : str
        As its source names it; "S-" means stabilized.
    year : int
    source : str
        "paper": Table 1. "siammask_e": the table of github.com/baoxinchen/siammask_e, with lost
        targets counted in its raw results. "pysot": the model zoo of github.com/STVIR/pysot.
        "SiamTrackers": the README of github.com/HonglinChu/SiamTrackers.
    accuracy, robustness, eao : float, optional
        As in `Measures`.
    lost : int, optional
        Lost targets; for the paper they follow from R.
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

    @property
    def measures(self) -> Measures:
        """The row's A, R, EAO and speed."""
        return Measures(self.accuracy, self.robustness, self.eao, self.fps)


# The paper's trackers by their names in the paper.
PAPER_TRACKERS: Final[dict[str, TrackerName]] = {
    "SiamFC": "siamfc",
    "SiamRPN++": "siamrpn_r50_l234_dwxcorr",
    "SiamMask_E": "siammask_e",
}

# Trackers with the networks of the paper's, but other weights, backbones or boxes, and the one of
# the paper's that they are set beside.
RELATED_TRACKERS: Final[dict[str, TrackerName]] = {
    "siamrpn_r50_l234_dwxcorr_otb": "siamrpn_r50_l234_dwxcorr",
    "siamrpn_mobilev2_l234_dwxcorr": "siamrpn_r50_l234_dwxcorr",
    "siamrpn_alex_dwxcorr": "siamrpn_r50_l234_dwxcorr",
    "siammask_r50_l3": "siammask_e",
    "siammask_e_unrefined": "siammask_e",
    "siammask_vot": "siammask_e",
    "siammask_vot18": "siammask_e",
    "siammask_davis": "siammask_e",
}

# Table 1: tracker, stabilized, fps, and A, R, EAO on VOT2019, VOT2018 and VOT2016.
_TABLE1_YEARS: Final = (2019, 2018, 2016)
_TABLE1: Final = (
    ("SiamFC", False, 121, (0.477, 0.687, 0.204), (0.479, 0.492, 0.224), (0.512, 0.331, 0.301)),
    ("SiamFC", True, 58, (0.459, 0.577, 0.207), (0.467, 0.450, 0.231), (0.487, 0.261, 0.328)),
    ("SiamRPN++", False, 34, (0.595, 0.467, 0.290), (0.600, 0.234, 0.415), (0.643, 0.200, 0.461)),
    ("SiamRPN++", True, 23, (0.594, 0.446, 0.293), (0.600, 0.229, 0.425), (0.641, 0.186, 0.475)),
    ("SiamMask_E", False, 55, (0.646, 0.497, 0.303), (0.649, 0.267, 0.432), (0.669, 0.233, 0.450)),
    ("SiamMask_E", True, 33, (0.637, 0.477, 0.309), (0.637, 0.243, 0.449), (0.655, 0.210, 0.463)),
)
TABLE1: Final = tuple(
    Published(
        f"S-{name}" if stabilized else name,
        year,
        "paper",
        *measures,
        lost=round(measures[1] * FRAMES[year] / 100),
        fps=fps,
        label=f"{PAPER_TRACKERS[name]}-{'paper' if stabilized else 'off'}",
    )
    for name, stabilized, fps, *by_year in _TABLE1
    for year, measures in zip(_TABLE1_YEARS, by_year, strict=True)
)

# The tracker and dataset of Tables 2, 3 and 4.
ABLATION_TRACKER: Final = "SiamMask_E"
ABLATION_YEAR: Final = 2018

# Table 2: keypoint generators.
TABLE2: Final = {
    "gftt": Measures(0.642, 0.249, 0.441, 30),
    "orb": Measures(0.637, 0.243, 0.449, 33),
    "brisk": Measures(0.625, 0.283, 0.390, 38),
    "mser": Measures(0.635, 0.245, 0.444, 34),
    "harris": Measures(0.636, 0.270, 0.412, 39),
}

# Table 3: thresholds of eq. 6, pixels (THx1 = 2 THy1), pixels per frame (THx2 = 2 THy2), radians.
TABLE3: Final = {
    "THx1 = 2 THy1": {
        60.0: Measures(0.637, 0.243, 0.449),
        80.0: Measures(0.640, 0.260, 0.435),
        100.0: Measures(0.645, 0.277, 0.418),
    },
    "THx2 = 2 THy2": {
        20.0: Measures(0.637, 0.243, 0.449),
        40.0: Measures(0.639, 0.251, 0.436),
        80.0: Measures(0.630, 0.272, 0.402),
    },
    "THa": {
        0.1: Measures(0.641, 0.270, 0.413),
        0.3: Measures(0.637, 0.243, 0.449),
        0.5: Measures(0.634, 0.244, 0.439),
        1.0: Measures(0.625, 0.264, 0.410),
    },
}

# Table 4: lost targets by sequence of VOT2018.
TABLE4: Final = {
    "soccer2": LostTargets(True, 3, 0),
    "soccer1": LostTargets(True, 4, 3),
    "wiper": LostTargets(True, 2, 1),
    "helicopter": LostTargets(True, 2, 1),
    "blanket": LostTargets(True, 2, 1),
    "rabbit": LostTargets(True, 2, 3),
    "girl": LostTargets(False, 4, 4),
    "book": LostTargets(False, 4, 4),
}

# Other sources than the paper.
OTHER_ROWS: Final = (
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
