"""Networks and runs: ONNX files on both runtimes, exported folders, and the state of a training."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from fuzz.target import Target, in_file
from helpers.onnx_networks import small_network
from ssiam.runtime import RuntimeOptions, load_network, load_pieces
from ssiam.training.checkpoints import CHECKPOINT, read_checkpoint, write_checkpoint
from ssiam.training.data.registry import SourceSettings
from ssiam.training.metrics import METRICS, Metrics
from ssiam.training.optimizer import build_optimizer
from ssiam.training.settings import NetworkSettings, TrainSettings
from ssiam.training.trainer import load_optimizer

_RUN_ELEMENTS = 1 << 16  # of the arrays of a network that is run, not only loaded


def network_targets(folder: Path) -> Iterable[Target]:
    """ONNX files, network.json with its pieces, checkpoint.pth and metrics.csv of a run."""
    folder.mkdir(parents=True)
    seeds = (small_network(), small_network(opset=9))
    for runtime in ("openvino", "onnxruntime"):
        read = in_file(folder / f"{runtime}.onnx", _loads(runtime))
        yield Target(f"ONNX on {runtime}", seeds, read, 2)
    pieces = folder / "pieces"
    pieces.mkdir()
    (pieces / "template.onnx").write_bytes(small_network())
    (pieces / "search.onnx").write_bytes(small_network(kernel=True))
    manifest = {"name": "lite", "network": "lite2", "sha256": "0" * 64, "opset": 17, "ssiam": "1"}
    manifest |= {"pieces": ["template", "search"], "precision": "f32"}

    def read_pieces(path: Path) -> None:
        load_pieces(path.parent, "lite2", RuntimeOptions())

    texts = (json.dumps(manifest).encode(),)
    yield Target(
        "network.json with pieces", texts, in_file(pieces / "network.json", read_pieces), 1
    )
    yield from _run_targets(folder / "run")


def _loads(runtime: Any) -> Callable[[Path], None]:
    def load(path: Path) -> None:
        network = load_network(path, runtime=runtime)
        shapes = network.input_shapes + network.output_shapes
        # Sides of outputs that depend on the input are None.
        if all(np.prod([side or 1 for side in shape]) <= _RUN_ELEMENTS for shape in shapes):
            network(*[np.zeros(shape, np.float32) for shape in network.input_shapes])

    return load


def _run_targets(folder: Path) -> Iterable[Target]:
    folder.mkdir()
    settings = TrainSettings((SourceSettings("davis", "x"),), network=NetworkSettings("mask"))
    network = torch.nn.Linear(3, 2)
    optimizer = build_optimizer(_Student(network), settings.optimiser)
    sum(each.sum() for each in network.parameters()).backward()
    optimizer.step()
    state = optimizer.state_dict()
    state["state"] = {key: state["state"][key] for key in list(state["state"])[:2]}
    small = {"step": 6, "random": torch.zeros(4, dtype=torch.uint8), "optimiser": state}
    write_checkpoint(folder, settings, {**small, "optimiser": {}})
    file = folder / CHECKPOINT
    seeds = (file.read_bytes(),)

    def read(path: Path) -> None:
        read_checkpoint(path.parent, settings)

    yield Target("checkpoint of a run", seeds, in_file(file, read), 4)

    def resume(data: bytes) -> None:
        try:
            key, index, name, value = json.loads(data)
            changed = copy.deepcopy(state["param_groups"])
            if key == "groups":
                changed[index][name] = value
            content = {"param_groups": changed, "state": dict(state["state"])}
            if key == "state":
                content["state"][index] = {**state["state"][0], name: torch.tensor(value)}
        except Exception:  # no change of a state
            return
        load_optimizer(optimizer, content)

    changes = (b'["groups", 0, "lr", 0.5]', b'["state", 0, "step", 3.0]')
    yield Target("state of an optimizer", changes, resume, 4)

    def read_metrics(path: Path) -> None:
        with Metrics(path.parent, 5):
            shutil.rmtree(path.parent / "tensorboard", ignore_errors=True)

    rows = b"step,name,value\n1,loss,0.5\n7,loss,0.25\n"
    yield Target("metrics.csv", (rows,), in_file(folder / "m" / METRICS, read_metrics), 1)


class _Student(torch.nn.Module):
    """What `build_optimizer` needs of a student."""

    def __init__(self, network: torch.nn.Module) -> None:
        super().__init__()
        self.network = network

    def parameter_groups(self) -> list[tuple[list[torch.nn.Parameter], float]]:
        return [(list(self.network.parameters()), 1.0)]
