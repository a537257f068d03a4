"""`warn_of_several`: OpenCV's wheels overwrite each other."""

from __future__ import annotations

import warnings
from importlib.metadata import PackageNotFoundError, distribution
from typing import Final

# Only one may be installed: https://pypi.org/project/opencv-python, "Installation and Usage".
_WHEELS: Final = (
    "opencv-python",
    "opencv-python-headless",
    "opencv-contrib-python",
    "opencv-contrib-python-headless",
)


def warn_of_several() -> None:
    """Warn with one line if several of OpenCV's four distributions are installed.

    All four write the same folder cv2: the last one that was installed is imported. A program
    whose opencv-python was overwritten by a headless one has no ``cv2.imshow``. Silence it with
    ``warnings.filterwarnings("ignore", module="ssiam")`` or ``PYTHONWARNINGS=ignore:several``.
    """
    installed = [name for name in _WHEELS if _is_installed(name)]
    if len(installed) > 1:
        warnings.warn_explicit(
            f"several OpenCV packages are installed ({', '.join(installed)}): they overwrite each "
            "other, and the headless ones have no cv2.imshow; keep one (docs/how-to/install.md)",
            RuntimeWarning,
            filename="ssiam",
            lineno=1,
            module="ssiam",
        )


def _is_installed(name: str) -> bool:
    try:
        distribution(name)
    except PackageNotFoundError:
        return False
    return True
