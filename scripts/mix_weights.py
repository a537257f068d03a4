"""Average the weights of two runs of `ssiam train`, the second fine-tuned from the first.

    python scripts/mix_weights.py runs/rivals runs/turned --out runs/mixed

The average can keep what the second run has learned and forget less of the first (model soups,
Wortsman et al., ICML 2022).
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ssiam.networks.checkpoints import read_state_dict
from ssiam.networks.lite import LiteNetwork
from ssiam.training.checkpoints import WEIGHTS, write_network


def main() -> None:
    """Write the averaged weights and the exported network."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=Path, help="folder of a run")
    parser.add_argument("second", type=Path, help="folder of a run")
    parser.add_argument("--share", type=float, default=0.5, help="weight of the second run, 0 to 1")
    parser.add_argument("--out", type=Path, required=True, help="folder to write")
    arguments = parser.parse_args()
    first, second = (
        read_state_dict(folder / WEIGHTS) for folder in (arguments.first, arguments.second)
    )
    mixed = {
        name: first[name].lerp(value, arguments.share) if value.is_floating_point() else value
        for name, value in second.items()
    }
    network = LiteNetwork()
    network.load_state_dict(mixed)
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_network(network.eval(), arguments.out)


if __name__ == "__main__":
    main()
