"""Memory of SiamRPN++ with ResNet-50 on OpenVINO: the process with one target and with eight.

    python benchmarks/speed/network_memory.py [--tracker NAME] [--runtime NAME] [--frames N]

Each figure is the peak resident size of a separate process that only loads the exported network and
tracks. The weights, which are random, are exported in another process, because on Linux a process
inherits the peak size of its parent. The goals: below 900 MB with one target, and less than 1.3
times as much with eight.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import ssiam
from ssiam.runtime import MODEL_ZOO

TARGETS = (1, 8)
SIZE = (640, 360)


def track(name: str, weights: Path, runtime: str, targets: int, frames: int) -> None:
    """Track targets in an image of noise, and print the peak size of the process in MB."""
    random = np.random.default_rng(0)
    image = random.integers(0, 256, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    group = ssiam.TrackerGroup(
        ssiam.load_tracker(name, weights=weights, runtime=runtime)  # type: ignore[arg-type]
    )
    group.init(image, [(40.0 + 60 * i, 100.0, 50.0, 60.0) for i in range(targets)])
    for _ in range(frames):
        group.update(image)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def exported(name: str, folder: Path) -> Path:
    """Export the tracker's network with random weights into a folder."""
    import torch

    from ssiam.networks import build_network
    from ssiam.runtime.export import export_network

    torch.manual_seed(0)
    network = MODEL_ZOO[name].network
    path = folder / "model.pth"
    torch.save(build_network(network).state_dict(), path)  # type: ignore[arg-type]
    export_network(path, folder, name=name, network=network)
    return folder


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracker", default="siamrpn_r50_l234_dwxcorr")
    parser.add_argument("--runtime", default="openvino")
    parser.add_argument("--frames", type=int, default=5)
    parser.add_argument("--targets", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--weights", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    name, runtime = arguments.tracker, arguments.runtime
    if arguments.targets:
        track(name, arguments.weights, runtime, arguments.targets, arguments.frames)
        return
    print("| tracker | targets | peak size, MB |\n|---|---|---|")
    sizes = []
    with TemporaryDirectory() as folder:
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            weights = pool.submit(exported, name, Path(folder)).result()
        for targets in TARGETS:
            more = ["--targets", str(targets), "--weights", str(weights)]
            command = [sys.executable, __file__, *sys.argv[1:], *more]
            environment = {**os.environ, "XDG_CACHE_HOME": folder}
            done = subprocess.run(
                command, check=True, capture_output=True, text=True, env=environment
            )
            sizes.append(float(done.stdout))
            print(f"| {name} | {targets} | {sizes[-1]:.0f} |", flush=True)
    print(f"\nratio {sizes[-1] / sizes[0]:.2f}")


if __name__ == "__main__":
    main()
