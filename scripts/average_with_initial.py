"""Average the weights of a tracker's run with the NanoTrack v3 weights from which it began.

    python scripts/average_with_initial.py runs/tracker weights/nanotrackv3/nanotrackv3.pth \
        --share 0.7 --out runs/averaged

The layers that NanoTrack v3 does not have keep their trained values, except for those whose output
is added to the features, which began at zero (WiSE-FT, Wortsman et al., CVPR 2022). Why:
docs/decisions/0009-lite-averaged-with-nanotrack-v3.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ssiam.networks.checkpoints import read_state_dict
from ssiam.networks.lite import LiteNetwork
from ssiam.networks.pretrained import load_lite
from ssiam.training.checkpoints import WEIGHTS, write_network

ADDED = ("relation.", "quality.")  # layers that NanoTrack v3 does not have
RESIDUAL = (".out.weight", ".out.bias", ".narrow.weight", ".narrow.bias")  # began at zero


def main() -> None:
    """Write the averaged weights and the exported network."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder of the run")
    parser.add_argument("initial", type=Path, help="nanotrackv3.pth")
    parser.add_argument("--share", type=float, default=0.7, help="of the trained weights, 0 to 1")
    parser.add_argument("--out", type=Path, required=True, help="folder to write")
    arguments = parser.parse_args()
    network = LiteNetwork()
    load_lite(network, arguments.initial)
    initial, trained = network.state_dict(), read_state_dict(arguments.run / WEIGHTS)
    averaged = {
        name: value
        if name.startswith(ADDED) and not name.endswith(RESIDUAL)
        else initial[name].lerp(value, arguments.share)
        for name, value in trained.items()
    }
    network.load_state_dict(averaged)
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_network(network.eval(), arguments.out)


if __name__ == "__main__":
    main()
