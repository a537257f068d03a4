"""Speed of the paper's trackers, whole frames, beside their references' way of running them.

    python benchmarks/networks.py [--frames N] [--threads N] [--trackers A,B] [--runtimes A,B]

A frame is crop, network and what follows it. The plain form is what the references do: PyTorch in
float32, eagerly; for the trackers with anchors the kernels computed anew from the template's
features on every frame, gradients recorded, and SiamMask's unused head of 3969 channels computed.
All forms take each frame in turn, so that whatever else the machine does meets all of them.
Weights are random: they cost the same time as the authors'.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import cv2
import numpy as np
import torch

from ssiam import FrameView
from ssiam.networks import NetworkName, SiameseNetwork, build_network
from ssiam.runtime import PUBLISHED, Network, Running, Tensor
from ssiam.runtime.openvino import computes_in_bf16
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.registry import SiameseName, load_siamese_tracker
from ssiam.trackers.siamfc import SiamFc, SiamFcNetworks
from ssiam.trackers.siammask import PARAMETERS as MASK_PARAMETERS
from ssiam.trackers.siammask import SiamMask, SiamMaskNetworks
from ssiam.trackers.siamrpn import PARAMETERS, SiamRpn, SiamRpnNetworks

PAPER_FPS = {"siamfc": 58, "siamrpn_r50_l234_dwxcorr": 23, "siammask_e": 33}  # GTX 1080 Ti
TRACKERS = ("siamrpn_r50_l234_dwxcorr", "siammask_e", "siamfc")
WARM = 3  # frames that are not counted
SIZE = (640, 360)
BOX = (290.0, 150.0, 70.0, 60.0)


class Plain:
    """A network's piece as the references run it; shapes and counts are not asked for."""

    input_shapes: ClassVar[list[tuple[int, ...]]] = []
    output_shapes: ClassVar[list[tuple[int, ...]]] = []
    convolutions = 0

    def __init__(self, answer: Callable[..., object]) -> None:
        self._answer = answer

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """Outputs for float32 inputs."""
        results = self._answer(*map(torch.from_numpy, inputs))
        return [each.detach().numpy() for each in results]  # type: ignore[attr-defined]


def plain_pieces(network: SiameseNetwork, name: str) -> dict[str, Network]:
    """Template, search and refine; what `template` gives are features, not kernels."""
    if name == "siamfc":  # its reference records no gradients
        template = torch.no_grad()(network.template)
        search = torch.no_grad()(lambda crop, kernel: network.search(crop, [kernel]))
        return {"template": Plain(template), "search": Plain(search)}

    def features(crop: torch.Tensor) -> list[torch.Tensor]:
        return network.neck.template(network.backbone(crop))

    def responses(crop: torch.Tensor, *templates: torch.Tensor) -> tuple[torch.Tensor, ...]:
        kernels = network.rpn_head.kernels(templates)
        if not hasattr(network, "mask_head"):
            return network.search(crop, kernels)
        kernels.append(network.mask_head.kernel(templates[0]))
        found = network.search(crop, kernels)
        network.masks(found[2])  # of all cells, of which none is used
        return found

    pieces: dict[str, Network] = {"template": Plain(features), "search": Plain(responses)}
    if hasattr(network, "refine_head"):
        pieces["refine"] = Plain(lambda *windows: [network.refine_head(*windows)])
    return pieces


def plain_tracker(name: SiameseName, network: SiameseNetwork) -> ViewTracker:
    """The tracker's loop on those pieces."""
    pieces = plain_pieces(network, name)
    if name == "siamfc":
        return SiamFc(SiamFcNetworks(**pieces))
    if name in MASK_PARAMETERS:
        return SiamMask(SiamMaskNetworks(**pieces), MASK_PARAMETERS[name])
    return SiamRpn(SiamRpnNetworks(**pieces), PARAMETERS[name])


def forms(name: SiameseName, runtimes: list[str], threads: int) -> dict[str, ViewTracker]:
    """The trackers that are compared, by the name of their form."""
    torch.manual_seed(0)
    torch.set_num_threads(threads)
    wanted: NetworkName = PUBLISHED[name].network  # type: ignore[assignment]
    network = build_network(wanted)
    found: dict[str, ViewTracker] = {"plain": plain_tracker(name, network)}
    with TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder  # random weights are not worth keeping
        path = Path(folder) / "model.pth"
        torch.save(network.state_dict(), path)
        for form in runtimes:
            runtime, _, precision = form.partition(" ")
            running = Running(runtime, threads, precision)  # type: ignore[arg-type]
            found[form] = load_siamese_tracker(name, path, running)
    return found


def frames(count: int) -> list[np.ndarray]:
    """A picture that shifts a little."""
    random = np.random.default_rng(0)
    coarse = random.integers(0, 256, (45, 80, 3)).astype(np.uint8)
    picture = cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)
    return [np.roll(picture, (t % 3, t % 5), axis=(0, 1)) for t in range(count)]


def measure(trackers: dict[str, ViewTracker], count: int) -> dict[str, float]:
    """Median milliseconds a frame of each form; the target is held at one place and size."""
    pictures = frames(count + WARM + 1)
    took: dict[str, list[float]] = {form: [] for form in trackers}
    for tracker in trackers.values():
        tracker.init(FrameView(pictures[0]), BOX)
    for picture in pictures[1:]:
        for form, tracker in trackers.items():
            start = time.perf_counter()
            tracker.seek(FrameView(picture), BOX)
            took[form].append(1e3 * (time.perf_counter() - start))
    return {form: float(np.median(times[WARM:])) for form, times in took.items()}


def abilities() -> str:
    """Which wide arithmetic this CPU has."""
    path = Path("/proc/cpuinfo")
    flags = path.read_text().split() if path.exists() else []
    there = [name for name in ("avx2", "avx512f", "avx512_bf16", "amx_bf16") if name in flags]
    return f"{', '.join(there) or 'unknown'}; AMX: {'yes' if 'amx_bf16' in there else 'no'}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--trackers", default=",".join(TRACKERS))
    parser.add_argument(
        "--runtimes", default="openvino f32,openvino bf16,onnxruntime f32,torch f32"
    )
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    runtimes = arguments.runtimes.split(",")
    print(f"CPU: {abilities()}; {arguments.threads} threads, {arguments.frames} frames\n")
    if not computes_in_bf16():
        runtimes = [each for each in runtimes if "bf16" not in each]
        print("This CPU has no bf16 arithmetic: bf16 is left out.\n")
    print("| tracker | form | ms a frame | frames a second | times the plain form | paper, GPU |")
    print("|---|---|---|---|---|---|")
    for name in arguments.trackers.split(","):
        ms = measure(forms(name, runtimes, arguments.threads), arguments.frames)
        for form, value in ms.items():
            cells = f"{value:.1f} | {1e3 / value:.1f} | {ms['plain'] / value:.2f}"
            print(f"| {name} | {form} | {cells} | {PAPER_FPS.get(name, '')} |", flush=True)


if __name__ == "__main__":
    main()
