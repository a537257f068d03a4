"""How near the paper's networks come to what this CPU can calculate in float32.

    python benchmarks/network_limit.py [--frames N] [--threads N] [--trackers A,B]

Counts the multiplications and additions of a search, and compares whole tracked frames (as
benchmarks/networks.py measures them) with a product of two large matrices on as many threads,
before and after: nothing that calculates the same numbers can be much quicker than that.
"""

from __future__ import annotations

import argparse
import time

import cv2
import numpy as np
import torch
from torch.utils.flop_counter import FlopCounterMode

from networks import TRACKERS, forms, measure
from ssiam.networks import NetworkName, build_network
from ssiam.runtime import PUBLISHED
from ssiam.trackers.registry import SiameseName

SIDE = 2048  # of the matrices
REPEATS = 8
RUNTIMES = ["openvino f32", "onnxruntime f32"]


def product_speed() -> float:
    """Greatest 1e9 operations a second of a product of two matrices."""
    left, right = torch.randn(2, SIDE, SIDE).unbind()
    took = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        left @ right
        took.append(time.perf_counter() - start)
    return 2e-9 * SIDE**3 / min(took)


def operations(name: SiameseName) -> float:
    """1e9 operations of a search, its kernels at hand."""
    wanted: NetworkName = PUBLISHED[name].network  # type: ignore[assignment]
    network = build_network(wanted).eval()
    with torch.no_grad():
        kernels = network.template(torch.zeros(network.template_shape))
        with FlopCounterMode(display=False) as counter:
            network.search(torch.zeros(network.search_shape), kernels)
    return 1e-9 * counter.get_total_flops()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=15)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--trackers", default=",".join(TRACKERS))
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    print(
        "| tracker | 1e9 operations | form | ms a frame | 1e9 operations a second | of a product |"
    )
    print("|---|---|---|---|---|---|")
    for name in arguments.trackers.split(","):
        trackers = forms(name, RUNTIMES, arguments.threads)
        torch.set_num_threads(arguments.threads)  # less are left by what makes the pieces
        before = product_speed()
        took = measure(trackers, arguments.frames)
        fastest = float(np.mean([before, product_speed()]))
        count = operations(name)
        for form, ms in took.items():
            speed = 1e3 * count / ms
            cells = f"{count:.1f} | {form} | {ms:.1f} | {speed:.0f} | {100 * speed / fastest:.0f} %"
            print(f"| {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
