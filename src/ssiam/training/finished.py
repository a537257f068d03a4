"""What a run leaves behind: the weights, and the pieces that a tracker runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from ssiam.errors import ArgumentError
from ssiam.networks import inference_graphs, write_onnx
from ssiam.networks.box_mask import BOX_MASK_CROP, BoxMaskNetwork
from ssiam.networks.lite import LiteNetwork
from ssiam.networks.lite2 import Lite2Network
from ssiam.networks.nanotrack import WIDTH
from ssiam.outputs import NamedPath, check_distinct, make_folder, output_error
from ssiam.runtime.exported import OPSET, RECORD, Exported, put
from ssiam.runtime.files import sha256
from ssiam.training.checkpoints import CHECKPOINT, read_state, write_file
from ssiam.training.ema import AnyNetwork
from ssiam.training.metrics import METRICS
from ssiam.training.network_settings import WEIGHTS, NetworkSettings
from ssiam.training.settings import TrainSettings

__all__ = ["NETWORK", "WEIGHTS", "write_network", "write_so_far"]

NETWORK: Final = "lite"  # in the record beside the pieces
NETWORK2: Final = "lite2"
_PIECES: Final = ("template", "search", "mask")
_KERNEL: Final = (1, 64, 96)
_CORE: Final = (1, 96, 4, 4)
_MASK_CROP: Final = (1, 3, BOX_MASK_CROP, BOX_MASK_CROP)


def check_run_outputs(
    settings: TrainSettings, option: str, folder: Path, inputs: Sequence[NamedPath]
) -> None:
    """Refuse a folder in which a run of these settings would replace what it reads.

    Parameters
    ----------
    settings : TrainSettings
    option : str
        That named the folder, for the message.
    folder : Path
    inputs : sequence of (str, Path)
        Further files that are read.

    Raises
    ------
    ArgumentError
        The weights to begin with, the teacher's, or a set of data are what would be replaced.
    """
    names = (CHECKPOINT, METRICS, WEIGHTS, *(f"{piece}.onnx" for piece in _PIECES), RECORD)
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
    """Write weights.pth, the pieces as ONNX (template and search, or mask) and the record of them.

    What was there before is replaced when all of them are whole.

    Raises
    ------
    MissingExtraError
        The package onnx is not installed.
    SinkError
        The folder cannot be written.
    """
    try:
        with TemporaryDirectory(dir=folder, prefix=".network-") as temporary:
            pieces = _write(network, Path(temporary))
            put(Path(temporary), folder, [WEIGHTS, *(f"{piece}.onnx" for piece in pieces)])
    except OSError as error:
        raise output_error(folder, error) from error


def _write(network: AnyNetwork, folder: Path) -> tuple[str, ...]:
    """Write everything; the names of the pieces."""
    write_file(folder / WEIGHTS, network.state_dict())
    if isinstance(network, BoxMaskNetwork):
        write_onnx(network, [_MASK_CROP], folder / "mask.onnx", opset=OPSET)
        masks = Exported("mask", "box_mask", sha256(folder / WEIGHTS), ("mask",))
        masks.write(folder)
        return masks.pieces
    graphs = inference_graphs(network)
    name = NETWORK
    kernels: list[tuple[int, ...]] = [_KERNEL]
    if isinstance(network, Lite2Network):
        context = (1, max(len(network.relation.blocks), 1), 2, WIDTH, _KERNEL[1])
        name, kernels = NETWORK2, [_KERNEL, _KERNEL, _CORE, _CORE, context, context]
        graphs["search"].input_names += ("recent",)
    shapes = {
        "template": [network.template_shape],
        "search": [network.search_shape, *kernels],
    }
    for piece, graph in graphs.items():
        write_onnx(graph, shapes[piece], folder / f"{piece}.onnx", opset=OPSET)
    record = Exported(NETWORK, name, sha256(folder / WEIGHTS), tuple(graphs))
    record.write(folder)
    return record.pieces


def write_so_far(settings: TrainSettings, run: Path, folder: Path) -> int:
    """Write what a run has learnt up to its last checkpoint, as `write_network`; that step.

    Raises
    ------
    ArgumentError
        There is no run of these settings.
    WeightsError
        Its checkpoint is damaged.
    SinkError
        The folder cannot be made or written.
    """
    state = read_state(run, settings)
    if state is None:
        raise ArgumentError(f"{run} holds no run: give the folder of one with --out")
    network = built(settings.network)
    network.load_state_dict(state["average"])
    make_folder(folder)
    write_network(network.eval(), folder)
    return int(state["step"])


def built(settings: NetworkSettings) -> AnyNetwork:
    """The network of the settings, with random weights."""
    if settings.kind == "mask":
        return BoxMaskNetwork()
    if settings.kind == "lite2":
        return Lite2Network(settings.attention)
    return LiteNetwork(settings.blocks, light=settings.light)
