"""Copy what the tests of the tracking loops need out of the reference data.

    python scripts/copy_loop_golden.py

Reads `golden` of the folder SSIAM_SHARED (../shared beside the checkout if it is not set), and
writes tests/golden/loops: one file for each tracker, video and OpenCV version, with the crops
replaced by their hashes, and the functions' outputs as far as the tests look at them.
"""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path
from typing import Any

import numpy as np

CHECKOUT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("SSIAM_SHARED", CHECKOUT.parent / "shared"))
TARGET = CHECKOUT / "tests" / "golden" / "loops"

HASHED = ("z_crop_u8", "x_crop_t1_u8_s2", "x_crop_tlast_u8_s2")
LEFT_OUT = ("mask_in_img_t5", "versions")

# Of the loops on networks with weights by rule.
NET = (
    *("bbox", "score", "best_idx", "margin", "polygon", "s_x"),
    *("box_1based", "center_yx", "target_sz_hw"),
)

# Of functions.npz and functions_cv4.npz.
FUNCTIONS = re.compile(
    r"(subwindow_foolwood_\d+_sha256|siamfc_(cases|crop_\d+_sha256).*|subwindow_cases|anchors_\d+"
    r"|convert_.*|mask_.*|siammask_(e_)?box_.*|paste_.*)$"
)
OF_THE_VERSION = re.compile(r"(siammask_(e_)?box_.*|paste_\d+)$")
STRIDE = 7  # of the decoded candidates


def main() -> None:
    """Write all files anew."""
    TARGET.mkdir(parents=True, exist_ok=True)
    for path in sorted((SHARED / "golden").glob("loop_stub_*.npz")):
        arrays = dict(np.load(path))
        if "polygon" in arrays or not path.stem.endswith("_cv4"):  # boxes are the same with all
            write(path.stem.removeprefix("loop_stub_"), loop(arrays))
    for path in sorted((SHARED / "golden").glob("loop_net_*.npz")):
        arrays = dict(np.load(path))
        write(path.stem.removeprefix("loop_"), {key: arrays[key] for key in NET if key in arrays})
    for name, wanted in (("functions", FUNCTIONS), ("functions_cv4", OF_THE_VERSION)):
        functions = np.load(SHARED / "golden" / f"{name}.npz")
        write(name, {key: thinned(key, functions[key]) for key in functions if wanted.match(key)})
    total = sum(path.stat().st_size for path in TARGET.iterdir())
    print(f"{TARGET}: {total / 1000:.0f} kB")


def loop(arrays: dict[str, Any]) -> dict[str, Any]:
    """A loop's arrays without the large ones."""
    kept = {key: value for key, value in arrays.items() if key not in (*HASHED, *LEFT_OUT)}
    kept["opencv"] = str(arrays["versions"][1]).split(".")[0]  # major version
    for key in HASHED:
        if key in arrays:
            kept[f"{key}_sha256"] = sha256(arrays[key])
    return kept


def thinned(key: str, value: Any) -> Any:
    """Every seventh candidate of the decoded ones, all else as it is."""
    return value[..., ::STRIDE] if key.startswith("convert_") else value


def sha256(array: Any) -> str:
    """Hash of an array's values in C order."""
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def write(name: str, arrays: dict[str, Any]) -> None:
    """One compressed file."""
    np.savez_compressed(TARGET / f"{name}.npz", **arrays)


if __name__ == "__main__":
    main()
