"""The packages whose trackers the adapters of `ssiam.integrations` are made for.

ultralytics and boxmot are under the AGPL: they are installed for tests and measurements only. Both
are installed without what only their networks need.
"""

from __future__ import annotations

from benchmarks.common.data import CHECKOUT
from benchmarks.common.environments import Requirements

ENVIRONMENTS = CHECKOUT / "build" / "hosts"
_OPENCV = "opencv-contrib-python-headless>=4.11,<5"  # hosts ask for opencv-python, the same modules
_ALL = ("hypothesis>=6.100", "pytest>=9.0.3", _OPENCV)
_TORCH = "torch==2.13.0"  # newer ones bring gigabytes of CUDA along
_SUPERVISION = ("pydeprecate>=0.9,<0.14", "scipy>=1.13.1", "supervision==0.31.2")
_TRACKERS = Requirements((*_ALL, *_SUPERVISION, "rich>=15"), bare=("trackers==2.6.1",))
_NEEDS_OF_ULTRALYTICS = (
    *("lapx>=0.5.5", "matplotlib", "numpy>=2.2", "pillow", "polars", "psutil", "pyyaml"),
    "requests",
)
_NEEDS_OF_BOXMOT = ("filterpy", "lapx>=0.5.5", "numpy>=2.2", "pyyaml", "rich>=15")

REQUIREMENTS = {
    "norfair": Requirements((*_ALL, "norfair==2.3.0")),
    "ultralytics": Requirements(
        (*_ALL, _TORCH, *_NEEDS_OF_ULTRALYTICS),
        bare=("torchvision==0.28.0", "ultralytics==8.4.190"),
    ),
    "boxmot": Requirements((*_ALL, _TORCH, *_NEEDS_OF_BOXMOT), bare=("boxmot==25.0.0",)),
    "trackers": _TRACKERS,
    "supervision": _TRACKERS,  # it has no tracker
}
