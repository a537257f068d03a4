"""Put the networks of two runs of `ssiam train` into the package, as the default tracker's.

    python scripts/ship_lite.py runs/tracker runs/mask [--out src/ssiam/models/lite]

Writes the three ONNX pieces, the weights from which training can start (weights.pth of the tracker,
mask.pth of the mask network), and network.json.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from ssiam.runtime.files import sha256
from ssiam.runtime.manifest import Manifest, atomic_export
from ssiam.trackers.lite import NETWORK, SHIPPED
from ssiam.training.settings import MASK_WEIGHTS, WEIGHTS


def main() -> None:
    """Copy the files of both runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tracker", type=Path, help="folder of the tracker's run")
    parser.add_argument("mask", type=Path, help="folder of the mask network's run")
    parser.add_argument("--out", type=Path, default=SHIPPED, help="folder to write")
    arguments = parser.parse_args()
    files = {
        "template.onnx": arguments.tracker / "template.onnx",
        "search.onnx": arguments.tracker / "search.onnx",
        "mask.onnx": arguments.mask / "mask.onnx",
        WEIGHTS: arguments.tracker / WEIGHTS,
        MASK_WEIGHTS: arguments.mask / WEIGHTS,
    }
    with atomic_export(arguments.out, beside=(WEIGHTS, MASK_WEIGHTS)) as temporary:
        for name, path in files.items():
            shutil.copyfile(path, temporary / name)
        digest = sha256(temporary / WEIGHTS)
        Manifest("lite", NETWORK, digest, ("template", "search", "mask")).write(temporary)


if __name__ == "__main__":
    main()
