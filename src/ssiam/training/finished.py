"""What a run leaves behind: the weights, and the pieces that a tracker runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from ssiam.errors import ArgumentError, SinkError
from ssiam.networks import inference_graphs, write_onnx
from ssiam.networks.lite import LiteNetwork
from ssiam.outputs import NamedPath, check_apart, output_error
from ssiam.runtime.exported import OPSET, RECORD, Exported, put
from ssiam.runtime.files import sha256
from ssiam.training.checkpoints import CHECKPOINT, read_state, write_file
from ssiam.training.metrics import METRICS
from ssiam.training.network_settings import WEIGHTS
from ssiam.training.settings import TrainSettings

__all__ = ["NETWORK", "WEIGHTS", "write_network", "write_so_far"]

NETWORK: Final = "lite"  # in the record beside the pieces
_PIECES: Final = ("template", "search")
_KERNEL: Final = (1, 64, 96)


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
    check_apart(outputs, [*inputs, *_inputs(settings)])


def _inputs(settings: TrainSettings) -> Iterable[NamedPath]:
    for weights in (settings.network.begin_path, settings.network.weights_path):
        if weights is not None:
            yield "the weights", weights
    if settings.teacher is not None:
        teacher = Path(settings.teacher.weights)
        for path in (teacher, *teacher.glob("*")):
            yield "the teacher", path
    for source in settings.sources:
        yield "the training data", Path(source.path)


def write_network(network: LiteNetwork, folder: Path) -> None:
    """Write weights.pth, template.onnx, search.onnx and the record of them.

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


def _write(network: LiteNetwork, folder: Path) -> tuple[str, ...]:
    """Write everything; the names of the pieces."""
    write_file(folder / WEIGHTS, network.state_dict())
    graphs = inference_graphs(network)
    inputs = ([network.template_shape], [network.search_shape, _KERNEL])
    shapes: dict[str, list[tuple[int, ...]]] = dict(zip(_PIECES, inputs, strict=True))
    for piece, graph in graphs.items():
        write_onnx(graph, shapes[piece], folder / f"{piece}.onnx", opset=OPSET)
    record = Exported(NETWORK, NETWORK, sha256(folder / WEIGHTS), tuple(graphs))
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
    network = LiteNetwork(settings.network.blocks, light=settings.network.light)
    network.load_state_dict(state["average"])
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SinkError(f"{folder} cannot be made: {error.strerror or error}") from error
    write_network(network.eval(), folder)
    return int(state["step"])
