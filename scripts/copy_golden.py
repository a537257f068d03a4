"""Copy the golden arrays of the networks that the tests need to tests/golden/networks.

    python scripts/copy_golden.py

The arrays are outputs of the reference implementations with seeded weights. They are read from the
folder in the environment variable SSIAM_SHARED, by default `shared` next to the checkout. Every
`X__stride`-th value of an array X is copied, about 2000 values, and `X__stats` of all values: mean,
standard deviation, minimum, maximum and sum of magnitudes.
"""

from __future__ import annotations

import gzip
import json
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parents[1]
SHARED = Path(os.environ.get("SSIAM_SHARED", ROOT.parent / "shared"))
OUT = ROOT / "tests" / "golden" / "networks"

MAX_VALUES = 2000  # values of an array, approximately
NETWORKS = (
    "siamfc",
    "siamrpn_alex_dwxcorr",
    "siamrpn_mobilev2_l234_dwxcorr",
    "siamrpn_r50_l234_dwxcorr",
    "siammask_r50_l3",
    "foolwood_siammask_sharp",
)
STRIDES = {  # of the stored reference arrays, by the start of their names
    "backbone_z": 97,
    "backbone_x": 997,
    "xf": 7,
    "z_conv": 31,
    "mask_corr_feature": 5,
}
STATS_ONLY = ("mask_stats_only",)


def subsample(
    arrays: dict[str, NDArray[np.float64]], levels: int
) -> dict[str, NDArray[np.float64]]:
    """Every n-th value of the arrays that have statistics, with their strides and statistics."""
    result: dict[str, NDArray[np.float64]] = {}
    for name in [key.removesuffix("__stats") for key in arrays if key.endswith("__stats")]:
        result[f"{name}__stats"] = arrays[f"{name}__stats"]
        if name not in STATS_ONLY:
            values = arrays[name].ravel()
            step = max(values.size // MAX_VALUES, 1)
            result[name] = values[::step]
            result[f"{name}__stride"] = np.asarray(step * stored_stride(name, levels))
    return result


def stored_stride(name: str, levels: int) -> int:
    """Stride of a stored array. Template features are strided only if there are several levels."""
    if name.startswith("zf"):
        return 3 if levels > 1 else 1
    return next((stride for start, stride in STRIDES.items() if name.startswith(start)), 1)


def main() -> None:
    """Write the lists of keys and an .npz file per network."""
    OUT.mkdir(parents=True, exist_ok=True)
    lists = {}
    for path in sorted((SHARED / "keys").glob("*.json")):
        keys = json.loads(path.read_text())
        lists[path.stem] = {key: entry["shape"] for key, entry in keys.items()}
    text = json.dumps(lists, separators=(",", ":")).encode()
    (OUT / "keys.json.gz").write_bytes(gzip.compress(text, mtime=0))
    for name in NETWORKS:
        arrays = dict(np.load(SHARED / "golden" / f"{name}.npz"))
        levels = sum(key.startswith("zf") and key.endswith("__stats") for key in arrays)
        np.savez_compressed(OUT / f"{name}.npz", **subsample(arrays, levels))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
