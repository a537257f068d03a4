"""Speed of the paper's trackers, compared with their reference implementations in PyTorch.

    python benchmarks/speed/networks.py [--frames N] [--threads N] [--trackers A,B] [--runtimes A,B]

The time of an update includes crop, network and post-processing. The plain form follows the
reference implementations: eager PyTorch in float32; trackers with anchors compute their kernels
from the template features in every frame with gradients recorded, and SiamMask computes its unused
head of 3969 channels. All forms process each frame in turn, so that changes of the machine's speed
affect all of them. "Stabilized" is the first runtime with the paper's stabilization of each frame
(ORB, flow, fit, a crop from the stabilized view), to compare with the paper's stabilized speeds.
The weights are random, which does not change the time.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, get_args

import cv2
import numpy as np
import torch

from ssiam import FrameView
from ssiam.errors import check_choice
from ssiam.geometry import Image
from ssiam.motion import CameraMotion
from ssiam.networks import NetworkName, SiameseNetwork, build_network
from ssiam.runtime import MODEL_ZOO, Network, RuntimeOptions, Tensor
from ssiam.runtime.openvino import supports_bf16
from ssiam.stabilize import Stabilizer, StabilizerConfig
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.registry import SiameseName, load_siamese_tracker
from ssiam.trackers.siamfc import SiamFc, SiamFcNetworks
from ssiam.trackers.siammask import PARAMETERS as MASK_PARAMETERS
from ssiam.trackers.siammask import SiamMask, SiamMaskNetworks
from ssiam.trackers.siamrpn import PARAMETERS, SiamRpn, SiamRpnNetworks

PAPER_FPS = {  # alone, stabilized; GTX 1080 Ti
    "siamfc": (121, 58),
    "siamrpn_r50_l234_dwxcorr": (34, 23),
    "siammask_e": (55, 33),
}
STABILIZED = ", stabilized"  # end of the name of a form
TRACKERS = ("siamrpn_r50_l234_dwxcorr", "siammask_e", "siamfc")
WARM_UP = 3  # frames that do not count
SIZE = (640, 360)
BOX = (290.0, 150.0, 70.0, 60.0)


class Plain:
    """A piece of a network as the references run it; shapes and counts are unused."""

    input_shapes: ClassVar[list[tuple[int, ...]]] = []
    output_shapes: ClassVar[list[tuple[int, ...]]] = []
    convolution_count = 0

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """Outputs for float32 inputs."""
        results = self._function(*map(torch.from_numpy, inputs))
        return [each.detach().numpy() for each in results]


def plain_pieces(network: Any, name: str) -> dict[str, Network]:
    """Pieces of a `SiameseNetwork`; `template` returns features instead of kernels."""
    if name == "siamfc":  # the reference does not record gradients
        template = torch.no_grad()(network.template)
        search = torch.no_grad()(lambda crop, kernel: network.search(crop, [kernel]))
        return {"template": Plain(template), "search": Plain(search)}

    def features(crop: torch.Tensor) -> list[torch.Tensor]:
        found: list[torch.Tensor] = network.neck.template(network.backbone(crop))
        return found

    def responses(crop: torch.Tensor, *templates: torch.Tensor) -> tuple[torch.Tensor, ...]:
        kernels = network.rpn_head.kernels(templates)
        if hasattr(network, "mask_head"):
            kernels.append(network.mask_head.kernel(templates[0]))
        found: tuple[torch.Tensor, ...] = network.search(crop, kernels)
        if hasattr(network, "mask_head"):
            network.masks(found[2])  # of all cells, which the tracker does not use
        return found

    pieces: dict[str, Network] = {"template": Plain(features), "search": Plain(responses)}
    if hasattr(network, "refine_head"):
        pieces["refine"] = Plain(lambda *windows: [network.refine_head(*windows)])
    return pieces


def plain_tracker(name: SiameseName, network: SiameseNetwork) -> CompleteTracker:
    """The tracker with the plain pieces of a network."""
    pieces = plain_pieces(network, name)
    if name == "siamfc":
        return SiamFc(SiamFcNetworks(**pieces))
    if name in MASK_PARAMETERS:
        return SiamMask(SiamMaskNetworks(**pieces), MASK_PARAMETERS[name])
    return SiamRpn(
        SiamRpnNetworks(**pieces), PARAMETERS[check_choice("tracker", name, list(PARAMETERS))]
    )


def forms(name: SiameseName, runtimes: list[str], threads: int) -> dict[str, CompleteTracker]:
    """The tracker in each form, by the name of the form."""
    torch.manual_seed(0)
    torch.set_num_threads(threads)
    key: NetworkName = MODEL_ZOO[name].network  # type: ignore[assignment]
    network = build_network(key)
    found: dict[str, CompleteTracker] = {"plain": plain_tracker(name, network)}
    with TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder  # random weights are not worth keeping
        path = Path(folder) / "model.pth"
        torch.save(network.state_dict(), path)
        for form in runtimes:
            runtime, _, precision = form.partition(" ")
            running = RuntimeOptions(runtime, threads, precision)  # type: ignore[arg-type]
            found[form] = load_siamese_tracker(name, path, running)
    return found


def frames(count: int) -> list[Image]:
    """An image with small shifts."""
    random = np.random.default_rng(0)
    coarse = random.integers(0, 256, (45, 80, 3)).astype(np.uint8)
    image = np.asarray(cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC), np.uint8)
    return [np.roll(image, (t % 3, t % 5), axis=(0, 1)) for t in range(count)]


class PaperView:
    """The view of each frame that the paper's method makes for a tracker."""

    def __init__(self, image: Image) -> None:
        config = StabilizerConfig("paper")
        self._camera = CameraMotion(config.keypoints, config.fit, model="rigid")
        self._stabilizer, self._border = Stabilizer(config), config.border
        self._camera.update(image)

    def __call__(self, image: Image) -> FrameView:
        """The stabilized view; the target's box is left out of the motion."""
        motion = self._camera.update(image, exclude=BOX)
        return FrameView(image, self._stabilizer.update(motion), self._border)


def measure(
    trackers: dict[str, CompleteTracker], count: int, stabilized: str | None = None
) -> dict[str, float]:
    """Median milliseconds per frame of each form; position and size of the box are fixed.

    The form `stabilized` is measured with the paper's stabilization too.
    """
    images = frames(count + WARM_UP + 1)
    runs: dict[str, tuple[CompleteTracker, Callable[[Image], FrameView]]] = {
        form: (tracker, FrameView) for form, tracker in trackers.items()
    }
    if stabilized is not None:
        runs[stabilized + STABILIZED] = trackers[stabilized], PaperView(images[0])
    milliseconds: dict[str, list[float]] = {form: [] for form in runs}
    for tracker in trackers.values():
        tracker.init(FrameView(images[0]), BOX)
    for image in images[1:]:
        for form, (tracker, view) in runs.items():
            start = time.perf_counter()
            tracker.seek(view(image), BOX)
            milliseconds[form].append(1e3 * (time.perf_counter() - start))
    return {form: float(np.median(times[WARM_UP:])) for form, times in milliseconds.items()}


def vector_extensions() -> str:
    """The vector and matrix instructions of this CPU."""
    path = Path("/proc/cpuinfo")
    flags = path.read_text().split() if path.exists() else []
    found = [name for name in ("avx2", "avx512f", "avx512_bf16", "amx_bf16") if name in flags]
    return f"{', '.join(found) or 'unknown'}; AMX: {'yes' if 'amx_bf16' in found else 'no'}"


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
    print(f"CPU: {vector_extensions()}; {arguments.threads} threads, {arguments.frames} frames\n")
    if not supports_bf16():
        runtimes = [each for each in runtimes if "bf16" not in each]
        print("bf16 is left out: this CPU does not support it.\n")
    print(
        "| tracker | form | ms per frame | frames per second | times the plain form | paper, GPU |"
    )
    print("|---|---|---|---|---|---|")
    for text in arguments.trackers.split(","):
        name = check_choice("tracker", text, get_args(SiameseName))
        trackers = forms(name, runtimes, arguments.threads)
        ms = measure(trackers, arguments.frames, stabilized=runtimes[0])
        alone, stabilized = PAPER_FPS.get(name, ("", ""))
        for form, value in ms.items():
            cells = f"{value:.1f} | {1e3 / value:.1f} | {ms['plain'] / value:.2f}"
            paper = stabilized if form.endswith(STABILIZED) else alone
            print(f"| {name} | {form} | {cells} | {paper} |", flush=True)


if __name__ == "__main__":
    main()
