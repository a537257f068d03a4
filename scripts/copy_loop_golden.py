"""Copy the golden arrays that the tests of the tracking loops need to tests/golden/loops.

    python scripts/copy_loop_golden.py

Reads the folder `golden` in the folder of the environment variable SSIAM_SHARED, by default
`shared` next to the checkout. Writes a file for each tracker, video and OpenCV version, in which
crops are replaced by their hashes, and a file of function outputs that the tests compare.
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
OMITTED = ("mask_in_img_t5", "versions")

# Arrays of the loops with networks, which have seeded weights.
NETWORK_ARRAYS = (
    *("bbox", "score", "best_idx", "margin", "polygon", "s_x"),
    *("box_1based", "center_yx", "target_sz_hw"),
)

# Arrays of functions.npz, and those of functions_cv4.npz that depend on the OpenCV version.
FUNCTIONS = re.compile(
    r"(subwindow_foolwood_\d+_sha256|siamfc_(cases|crop_\d+_sha256).*|subwindow_cases|anchors_\d+"
    r"|convert_.*|mask_.*|siammask_(e_)?box_.*|paste_.*)$"
)
VERSION_DEPENDENT = re.compile(r"(siammask_(e_)?box_.*|paste_\d+)$")
STRIDE = 7  # every n-th candidate of decoded arrays is copied


def main() -> None:
    """Write all files."""
    TARGET.mkdir(parents=True, exist_ok=True)
    for path in sorted((SHARED / "golden").glob("loop_stub_*.npz")):
        arrays = dict(np.load(path))
        # Boxes do not depend on the OpenCV version, polygons do.
        if "polygon" in arrays or not path.stem.endswith("_cv4"):
            write(path.stem.removeprefix("loop_stub_"), compact(arrays))
    for path in sorted((SHARED / "golden").glob("loop_net_*.npz")):
        arrays = dict(np.load(path))
        present = {key: arrays[key] for key in NETWORK_ARRAYS if key in arrays}
        write(path.stem.removeprefix("loop_"), present)
    for name, pattern in (("functions", FUNCTIONS), ("functions_cv4", VERSION_DEPENDENT)):
        functions = np.load(SHARED / "golden" / f"{name}.npz")
        keys = filter(pattern.match, functions)
        write(name, {key: subsample(key, functions[key]) for key in keys})
    total = sum(path.stat().st_size for path in TARGET.iterdir())
    print(f"{TARGET}: {total / 1000:.0f} kB")


def compact(arrays: dict[str, Any]) -> dict[str, Any]:
    """The arrays of a loop, the large ones replaced by their hashes or omitted."""
    result = {key: value for key, value in arrays.items() if key not in (*HASHED, *OMITTED)}
    result["opencv"] = str(arrays["versions"][1]).split(".")[0]  # major version
    for key in HASHED:
        if key in arrays:
            result[f"{key}_sha256"] = sha256(arrays[key])
    return result


def subsample(key: str, value: Any) -> Any:
    """Every 7th candidate of decoded arrays; other arrays unchanged."""
    return value[..., ::STRIDE] if key.startswith("convert_") else value


def sha256(array: Any) -> str:
    """Hash of an array's bytes in C order."""
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def write(name: str, arrays: dict[str, Any]) -> None:
    """Write a compressed file."""
    np.savez_compressed(TARGET / f"{name}.npz", **arrays)


if __name__ == "__main__":
    main()
