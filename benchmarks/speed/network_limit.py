"""Throughput of the paper's networks as a share of this CPU's float32 throughput.

    python benchmarks/speed/network_limit.py [--frames N] [--threads N] [--trackers A,B]

Counts the multiplications and additions of a search, and compares the time of complete tracker
updates (as in benchmarks/speed/networks.py) with a product of two large matrices on as many
threads, before and after. The matrix product is close to the maximum throughput.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import get_args

import cv2
import numpy as np
import torch
from torch.utils.flop_counter import FlopCounterMode

from ssiam.errors import check_choice
from ssiam.networks import NetworkName, build_network
from ssiam.runtime import MODEL_ZOO
from ssiam.trackers.registry import SiameseName

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.speed.networks import TRACKERS, forms, measure

SIDE = 2048  # of the matrices
REPEATS = 8
RUNTIMES = ["openvino f32", "onnxruntime f32"]


def matmul_speed() -> float:
    """Maximum throughput of a product of two matrices, 1e9 operations per second."""
    left, right = torch.randn(2, SIDE, SIDE).unbind()
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        left @ right
        seconds.append(time.perf_counter() - start)
    return 2e-9 * SIDE**3 / min(seconds)


def operations(name: SiameseName) -> float:
    """1e9 operations of a search, without those of the template."""
    key: NetworkName = MODEL_ZOO[name].network  # type: ignore[assignment]
    network = build_network(key).eval()
    with torch.no_grad():
        kernels = network.template(torch.zeros(network.template_shape))
        with FlopCounterMode(display=False) as counter:
            network.search(torch.zeros(network.search_shape), kernels)
    return float(1e-9 * counter.get_total_flops())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=15)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--trackers", default=",".join(TRACKERS))
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    print("| tracker | 1e9 operations | form | ms per frame | 1e9 operations / s | of a product |")
    print("|---|---|---|---|---|---|")
    for text in arguments.trackers.split(","):
        name = check_choice("tracker", text, get_args(SiameseName))
        trackers = forms(name, RUNTIMES, arguments.threads)
        torch.set_num_threads(arguments.threads)  # exporting the pieces lowers it
        before = matmul_speed()
        milliseconds = measure(trackers, arguments.frames)
        fastest = float(np.mean([before, matmul_speed()]))
        count = operations(name)
        for form, ms in milliseconds.items():
            speed = 1e3 * count / ms
            cells = f"{count:.1f} | {form} | {ms:.1f} | {speed:.0f} | {100 * speed / fastest:.0f} %"
            print(f"| {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
