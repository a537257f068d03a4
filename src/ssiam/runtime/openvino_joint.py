"""Networks on OpenVINO that have most of their weights in common, which are held once."""

from __future__ import annotations

import ctypes
import logging
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from ssiam.runtime.files import cache_folder
from ssiam.runtime.network import Precision
from ssiam.runtime.openvino import CORE, OpenVinoNetwork, ov, read_model

_LOG = logging.getLogger(__name__)
_VERSION: Final = ov.__version__.partition("-")[0]


def load_together(
    paths: Sequence[Path], digest: str, threads: int = 1, precision: Precision = "f32"
) -> list[OpenVinoNetwork]:
    """Networks that have most of their weights in common, which are held in memory once.

    All are kept as one file in the user's cache folder, named by the `digest` that tells these
    .onnx files from others; where that cannot be, each is loaded alone. The rest is as
    `OpenVinoNetwork` has it, also the errors.
    """
    try:
        joint = _joint(paths, cache_folder() / "openvino" / f"{digest}-{_VERSION}.xml")
        models = [_part(joint, number) for number in range(len(paths))]
    except (OSError, RuntimeError) as error:
        _LOG.info("networks are not held together: %s", error)
        return [OpenVinoNetwork(path, None, threads, precision) for path in paths]
    networks = []
    for path, model in zip(paths, models, strict=True):
        networks.append(OpenVinoNetwork(path, None, threads, precision, model=model))
        _return_freed_memory()
    return networks


def _joint(paths: Sequence[Path], file: Path) -> ov.Model:
    """All the networks as one model, whose weights are in the file; written if need be."""
    with suppress(RuntimeError):  # missing or damaged
        return CORE.read_model(file)
    file.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=file.parent, prefix=".joint-") as temporary:
        written = Path(temporary, file.name)
        ov.serialize(_joined([read_model(path) for path in paths]), written)
        for suffix in (".bin", ".xml"):
            os.replace(written.with_suffix(suffix), file.with_suffix(suffix))
    _return_freed_memory()
    return CORE.read_model(file)


def _joined(models: Sequence[ov.Model]) -> ov.Model:
    """One model that has the inputs and outputs of each, their names after the model's number."""
    for number, model in enumerate(models):
        for node in (*model.get_parameters(), *model.get_results()):
            node.set_friendly_name(f"{number}/{node.get_friendly_name()}")
            node.get_output_tensor(0).set_names(set())
    results = [each for model in models for each in model.get_results()]
    return ov.Model(results, [each for model in models for each in model.get_parameters()])


def _part(joint: ov.Model, number: int) -> ov.Model:
    """One of the models of `_joined`; they share their weights."""
    ends = [
        [node for node in nodes if node.get_friendly_name().startswith(f"{number}/")]
        for nodes in (joint.get_results(), joint.get_parameters())
    ]
    return ov.Model(*ends)


def _return_freed_memory() -> None:
    """Give the system what reading and compiling took for a while; glibc would keep it."""
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)
