"""Time of a frame with several targets, and what a batch of search crops would save.

    python benchmarks/speed/targets.py [--tracker lite] [--counts 1 2 4 8] [--rounds 6]

The first table is `TrackerGroup` with `predict` on frames of 640x360 pixels: whole frames, all
numbers of targets in turn in one process, on one thread; the targets are boxes of equal size. The
others are lite's search network alone, compiled by OpenVINO for batches of several crops and their
templates: the time of a crop, in float32 and, where the CPU has it, bfloat16. Process times; the
least of all rounds, which changes less with the load of the machine than the median. Needs the
folder of test data (see benchmarks/common/data.py), and PyTorch for the batches.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.loading import load
from benchmarks.common.tables import head, line
from benchmarks.speed.default_tracker import WARM_UP, scaled_clip
from ssiam import TrackerGroup
from ssiam.geometry import Image
from ssiam.networks.checkpoints import read_state_dict
from ssiam.networks.lite import LiteNetwork
from ssiam.runtime.openvino import CORE, ov, supports_bf16
from ssiam.trackers.lite import SEARCH_SIDE, SHIPPED
from ssiam.trackers.siamese import TEMPLATE_SIDE

SIDES = 80.0, 60.0  # px, width and height of a target
COLUMNS = 4  # targets side by side


def boxes(count: int) -> list[tuple[float, float, float, float]]:
    """Boxes of `count` targets, row by row."""
    cells = [divmod(index, COLUMNS) for index in range(count)]
    return [(60 + 140.0 * column, 70 + 140.0 * row, *SIDES) for row, column in cells]


def group_seconds(group: TrackerGroup, images: list[Image], count: int) -> float:
    """Least process time of a frame in one round, seconds."""
    group.init(images[0], boxes(count))
    times = []
    for image in images[1:]:
        start = time.process_time()
        group.update(image)
        times.append(time.process_time() - start)
    return min(times[WARM_UP:])


def batched_search(network: LiteNetwork, size: int, precision: str) -> Callable[[], Any]:
    """An inference of `size` crops, each with a template of its own."""

    class Search(torch.nn.Module):
        def forward(self, crop: torch.Tensor, *kernels: torch.Tensor) -> tuple[torch.Tensor, ...]:
            return tuple(network.search(crop, kernels))

    with torch.inference_mode():
        kernels = network.template(255 * torch.rand(size, 3, TEMPLATE_SIDE, TEMPLATE_SIDE))
    inputs = [255 * torch.rand(size, 3, SEARCH_SIDE, SEARCH_SIDE), *kernels, kernels[-1]]
    inputs = [each.clone() for each in inputs]
    shapes = [list(each.shape) for each in inputs]
    model = ov.convert_model(Search().eval(), example_input=tuple(inputs), input=shapes)
    settings = {"INFERENCE_NUM_THREADS": 1, "NUM_STREAMS": 1, "INFERENCE_PRECISION_HINT": precision}
    request = CORE.compile_model(model, "CPU", settings).create_infer_request()
    arrays = [each.numpy() for each in inputs]
    return lambda: request.infer(arrays, share_inputs=True, share_outputs=True)


def inference_seconds(infer: Callable[[], Any]) -> float:
    """Least process time of ten inferences, seconds."""
    times = []
    for _ in range(10):
        start = time.process_time()
        infer()
        times.append(time.process_time() - start)
    return min(times)


def least(work: Mapping[int, Callable[[], float]], rounds: int) -> dict[int, float]:
    """The least result of each function over several rounds, in turn."""
    found = dict.fromkeys(work, np.inf)
    for _ in range(rounds):
        for count, measure in work.items():
            found[count] = min(found[count], measure())
    return found


def report(title: str, seconds: Mapping[int, float], counts: Sequence[int]) -> None:
    """Print the times, and their ratios to that of one."""
    print(head([title, "ms", "ms each", "of one"]))
    for count in counts:
        ratio = seconds[count] / seconds[counts[0]] * counts[0]
        milliseconds = 1e3 * seconds[count]
        print(line([count, f"{milliseconds:.1f}", f"{milliseconds / count:.2f}", f"{ratio:.2f}"]))
    print()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tracker", default="lite")
    parser.add_argument("--counts", nargs="+", type=int, default=[1, 2, 4, 8])
    parser.add_argument("--rounds", type=int, default=6)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    images, _ = scaled_clip()
    group = TrackerGroup(load(options.tracker))
    frames = {n: lambda n=n: group_seconds(group, images, n) for n in options.counts}
    report("targets", least(frames, options.rounds), options.counts)
    network = LiteNetwork().eval().requires_grad_(False)
    network.load_state_dict(read_state_dict(SHIPPED / "weights.pth"))
    for precision in ("f32", "bf16") if supports_bf16() else ("f32",):
        searches = {n: batched_search(network, n, precision) for n in options.counts}
        crops = {n: lambda f=f: inference_seconds(f) for n, f in searches.items()}
        report(f"crops in a batch, {precision}", least(crops, options.rounds), options.counts)


if __name__ == "__main__":
    main()
