"""The files of a run: its checkpoint, and the exported network that a tracker loads."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Final, TypeAlias

import torch

from ssiam.errors import ArgumentError, WeightsError
from ssiam.geometry import short_repr
from ssiam.networks import inference_graphs, write_onnx
from ssiam.networks.box_mask import BOX_MASK_CROP, BoxMaskNetwork
from ssiam.networks.checkpoints import read_torch_file
from ssiam.networks.nanotrack import WIDTH
from ssiam.outputs import NamedPath, atomic_write, check_distinct, leftover_parts
from ssiam.parsing import parse_json
from ssiam.runtime.files import sha256
from ssiam.runtime.manifest import MANIFEST_FILE, OPSET, Manifest, atomic_export, leftover_exports
from ssiam.toml_tables import from_table
from ssiam.trackers.lite import NETWORK
from ssiam.training.metrics import METRICS
from ssiam.training.settings import WEIGHTS, TrainSettings
from ssiam.training.students import AnyNetwork, build_network
from ssiam.unfinished import remove_abandoned

__all__ = [
    "CHECKPOINT",
    "WEIGHTS",
    "check_run_outputs",
    "leftovers",
    "read_checkpoint",
    "write_checkpoint",
    "write_network",
    "write_network_so_far",
    "write_pth",
]

CHECKPOINT: Final = "checkpoint.pth"

# What content of another form raises
_DAMAGES: Final = (AttributeError, KeyError, RecursionError, TypeError, ValueError)

State: TypeAlias = dict[str, Any]

_PIECES: Final = ("template", "search", "mask")
# Input shapes of the pieces: template kernel of a head, its core, crop of the mask network.
_KERNEL: Final = (1, 64, 96)
_CORE: Final = (1, 96, 4, 4)
_MASK_CROP: Final = (1, 3, BOX_MASK_CROP, BOX_MASK_CROP)


# Settings that version 0.1.0 had for a former network, by table.
_REMOVED: Final = {
    "network": ("blocks", "light", "learns", "stem_steps", "trained_levels"),
    "optimiser": ("stem_lr",),
    "losses": ("mask",),
    "teacher": ("features",),
}


def write_checkpoint(folder: Path, settings: TrainSettings, state: Mapping[str, Any]) -> None:
    """Write a run's state, which consists of tensors, numbers, strings and containers of them.

    Raises
    ------
    SinkError
        The file cannot be written; the previous checkpoint is kept.
    """
    content = {"settings": json.dumps(settings.identity(), sort_keys=True), **state}
    write_pth(folder / CHECKPOINT, content)


def read_checkpoint(folder: Path, settings: TrainSettings) -> State | None:
    """The state of the run in a folder; None if there is no checkpoint.

    Raises
    ------
    WeightsError
        The file is damaged, or not a checkpoint.
    ArgumentError
        It belongs to a run with other settings; the message names the first difference.
    """
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    try:
        content = read_torch_file(path)
        theirs = _with_defaults(parse_json(content.pop("settings")))
        difference = _difference(theirs, _as_json(settings))
    except (WeightsError, *_DAMAGES) as error:
        raise _damaged(path) from error
    if difference:
        raise ArgumentError(
            f"{folder} holds a run with other settings ({difference}): "
            "give another folder with --out, or those settings"
        )
    return dict(content)


def _damaged(path: Path) -> WeightsError:
    return WeightsError(
        f"checkpoint {path} is damaged: remove it to train from the start, or restore a copy"
    )


def write_pth(path: Path, content: Any) -> None:
    """Write an object with `torch.save`; if the process is killed, the old file is unchanged.

    Raises
    ------
    SinkError
        The file cannot be written.
    """
    # If the disk is full, PyTorch's error does not name the cause; that of a plain file does.
    data = BytesIO()
    torch.save(content, data)
    with atomic_write(path, "wb", hidden=True) as file:
        file.write(data.getbuffer())


def _as_json(settings: TrainSettings) -> Any:
    return json.loads(json.dumps(settings.identity()))


def _with_defaults(values: Any) -> Any:
    """The settings of a stored run, with defaults for those that are newer than the run.

    In version 0.1.0 the network of "lite" was called "lite2", and there were settings for another.
    """
    try:
        if values["network"]["kind"] in ("lite2", "mask"):
            for table, names in _REMOVED.items():
                for name in names:
                    (values[table] or {}).pop(name, None)
            if values["network"]["kind"] == "mask":
                values["network"].pop("frozen_steps", None)  # unused; its default was another
            values["network"]["kind"] = values["network"]["kind"].replace("lite2", "lite")
        return _as_json(from_table(TrainSettings, _without_none(values)))
    except (ArgumentError, AttributeError, KeyError, TypeError):  # of another version
        return values


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(each) for key, each in value.items() if each is not None}
    return [_without_none(each) for each in value] if isinstance(value, list) else value


def _difference(theirs: Any, ours: Any, name: str = "") -> str:
    """The first value that differs, with its name; empty if all are equal."""
    if isinstance(theirs, list) and isinstance(ours, list):
        if len(theirs) != len(ours):
            return f"{name} are {len(theirs)} there and {len(ours)} here"
        pairs = zip(theirs, ours, strict=True)
        differences = (_difference(*pair, f"{name}[{i}]") for i, pair in enumerate(pairs))
    elif isinstance(theirs, dict) and isinstance(ours, dict):
        differences = (
            _difference(theirs.get(key), ours.get(key), f"{name}.{key}" if name else key)
            for key in sorted(theirs.keys() | ours.keys())
        )
    else:
        if theirs == ours:
            return ""
        return f"{name} is {short_repr(theirs)} there and {short_repr(ours)} here"
    return next(filter(None, differences), "")


def check_run_outputs(
    settings: TrainSettings, option: str, folder: Path, inputs: Sequence[NamedPath]
) -> None:
    """Reject a folder in which a run would replace its own inputs.

    Parameters
    ----------
    settings : TrainSettings
    option : str
        Command-line option that gave the folder, for messages.
    folder : Path
    inputs : sequence of (str, Path)
        Further input files.

    Raises
    ------
    ArgumentError
        An output is the file of the initial weights, of a teacher, or of a training set.
    """
    names = (CHECKPOINT, METRICS, WEIGHTS, *(f"{piece}.onnx" for piece in _PIECES), MANIFEST_FILE)
    outputs = [(option, folder), *((option, folder / name) for name in names)]
    check_distinct(outputs, [*inputs, *_inputs(settings)])


def _inputs(settings: TrainSettings) -> Iterable[NamedPath]:
    for weights in (settings.network.begin_path, settings.network.weights_path):
        if weights is not None:
            yield "the weights", weights
    for teacher in (settings.teacher.weights, settings.teacher.fear) if settings.teacher else ():
        if teacher is not None:
            for path in (Path(teacher), *Path(teacher).glob("*")):
                yield "the teacher", path
    for source in settings.sources:
        yield "the training data", Path(source.path)


def write_network(network: AnyNetwork, folder: Path) -> None:
    """Write weights.pth, the ONNX pieces (template and search, or mask) and network.json.

    The folder is created if it does not exist. Existing files are replaced after all new ones are
    complete.

    Raises
    ------
    MissingExtraError
        The package onnx is not installed.
    SinkError
        The folder cannot be written.
    """
    with atomic_export(folder, beside=(WEIGHTS,)) as temporary:
        _write_pieces(network, temporary)


def leftovers(folder: Path) -> list[Path]:
    """Incomplete files in a run's folder, of runs that are still running or of earlier versions.

    Those of killed runs are removed.
    """
    names = (CHECKPOINT, METRICS)
    parts = [part for name in names for part in leftover_parts(folder / name, hidden=True)]
    parts = remove_abandoned(parts)
    # Earlier versions called the part of a checkpoint by the number of the process.
    numbered = sorted(folder.glob(f".{CHECKPOINT}.[0-9]*"))
    return [*parts, *numbered, *leftover_exports(folder)]


def _write_pieces(network: AnyNetwork, folder: Path) -> None:
    """Write all files, the manifest last."""
    write_pth(folder / WEIGHTS, network.state_dict())
    if isinstance(network, BoxMaskNetwork):
        write_onnx(network, [_MASK_CROP], folder / "mask.onnx", opset=OPSET)
        record = Manifest("mask", "box_mask", sha256(folder / WEIGHTS), ("mask",))
        record.write(folder)
        return
    graphs = inference_graphs(network)
    graphs["search"].input_names += ("recent",)
    context = (1, max(len(network.relation.blocks), 1), 2, WIDTH, _KERNEL[1])
    shapes = {
        "template": [network.template_shape],
        "search": [network.search_shape, _KERNEL, _KERNEL, _CORE, _CORE, context, context],
    }
    for piece, graph in graphs.items():
        write_onnx(graph, shapes[piece], folder / f"{piece}.onnx", opset=OPSET)
    record = Manifest("lite", NETWORK, sha256(folder / WEIGHTS), tuple(graphs))
    record.write(folder)


def write_network_so_far(settings: TrainSettings, run: Path, folder: Path) -> int:
    """Write the averaged network of a run's last checkpoint, as `write_network`.

    Returns
    -------
    int
        Number of steps that the run has done.

    Raises
    ------
    ArgumentError
        There is no run with these settings.
    WeightsError
        Its checkpoint is damaged.
    SinkError
        The folder cannot be created or written.
    """
    state = read_checkpoint(run, settings)
    if state is None:
        raise ArgumentError(f"{run} holds no run: give the folder of one with --out")
    network = build_network(settings.network)
    try:
        network.load_state_dict(state["average"])
        step = int(state["step"])
    except (*_DAMAGES, OverflowError, RuntimeError) as error:
        raise _damaged(run / CHECKPOINT) from error
    write_network(network.eval(), folder)
    return step
