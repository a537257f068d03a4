"""Copy the small part of the networks' golden arrays that the tests need into tests/golden.

    python scripts/copy_golden.py

The arrays are outputs of the reference implementations on weights by rule. They are read from the
folder that the environment variable SSIAM_SHARED names; the default is ../shared beside the
checkout. Each array X is thinned to some 2000 of its values: every `X__stride`-th of the whole.
`X__stats` of the whole (mean, standard deviation, least, greatest, sum of magnitudes) stays.
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

KEPT = 2000  # values of an array
NETWORKS = (
    "siamfc",
    "siamrpn_alex_dwxcorr",
    "siamrpn_mobilev2_l234_dwxcorr",
    "siamrpn_r50_l234_dwxcorr",
    "siammask_r50_l3",
    "foolwood_siammask_sharp",
)
STRIDES = {  # with which the reference's arrays are stored, by the start of their names
    "backbone_z": 97,
    "backbone_x": 997,
    "xf": 7,
    "z_conv": 31,
    "mask_corr_feature": 5,
}
STATS_ONLY = ("mask_stats_only",)


def thinned(
    arrays: dict[str, NDArray[np.float64]], levels: int
) -> dict[str, NDArray[np.float64] | int]:
    """The arrays that have statistics, each with its stride and its statistics."""
    kept: dict[str, NDArray[np.float64] | int] = {}
    for name in [key.removesuffix("__stats") for key in arrays if key.endswith("__stats")]:
        kept[f"{name}__stats"] = arrays[f"{name}__stats"]
        if name not in STATS_ONLY:
            values = arrays[name].ravel()
            step = max(values.size // KEPT, 1)
            kept[name] = values[::step]
            kept[f"{name}__stride"] = step * stored_stride(name, levels)
    return kept


def stored_stride(name: str, levels: int) -> int:
    """Stride with which an array is stored; template features only of several levels have one."""
    if name.startswith("zf"):
        return 3 if levels > 1 else 1
    return next((stride for start, stride in STRIDES.items() if name.startswith(start)), 1)


def main() -> None:
    """Write the key lists and an .npz a network."""
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
        np.savez_compressed(OUT / f"{name}.npz", **thinned(arrays, levels))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
