"""`write_pack`: training data, held-out sequences and weights of a run in a small folder.

`ssiam train FOLDER/config.toml` trains from it on another machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.errors import ArgumentError, WeightsError
from ssiam.outputs import make_folder, output_error
from ssiam.trackers.fear import fear_pair
from ssiam.trackers.nanotrack import onnx_pair
from ssiam.training.config import config_text
from ssiam.training.data.packing import Files, PackedCrop, draw_crops, source_files, window_around
from ssiam.training.data.registry import SourceSettings, open_training_source
from ssiam.training.settings import SHIPPED_NAME, HeldOut, TrainSettings
from ssiam.training.validation import held_out_sequences

__all__ = ["PackSummary", "write_pack"]

CONFIG: Final = "config.toml"
_HELD_OUT_SHARE: Final = 0.25  # of the bytes that the weights leave
_HELD_OUT_FRAMES: Final = 20  # of each sequence at most
_RESERVE: Final = 20_000  # bytes of the config and the lists of sources


class PackSummary(NamedTuple):
    """What a pack holds.

    Attributes
    ----------
    crops, targets : int
        Crops of training data, and tracks and images that they show.
    sequences : int
        Held-out sequences.
    size : int
        Bytes of all files.
    """

    crops: int
    targets: int
    sequences: int
    size: int


def write_pack(settings: TrainSettings, folder: Path, megabytes: float = 40.0) -> PackSummary:
    """Write a pack.

    Targets are drawn as in training. The held-out sequences are cut to a fixed window around the
    target and to their first frames. Weights and teachers are copied.

    Parameters
    ----------
    settings : TrainSettings
        Of the network of "lite", with paths that can be opened from the working directory.
    folder : Path
        A new or empty folder. Its config.toml is written last.
    megabytes : float
        Limit of the sum of all files, in 10^6 bytes.

    Raises
    ------
    ArgumentError
        The folder holds files, the limit is too small, or the network is of another kind.
    DatasetError, WeightsError
        A set or weights are missing or damaged.
    SinkError
        The folder cannot be written.
    """
    if settings.network.kind != "lite":
        raise ArgumentError('a pack is for the network of kind "lite"; copy the sets of masks')
    if not 0 < megabytes < math.inf:
        raise ArgumentError(f"megabytes {megabytes} of a pack: give more than 0")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ArgumentError(f"{folder} exists and is not empty: give another folder for the pack")
    weights, packed = _weights(settings)
    limit = int(megabytes * 1e6)
    left = limit - _size(weights) - _RESERVE
    if left <= 0:
        raise ArgumentError(
            f"megabytes {megabytes:g} of a pack: its weights alone have "
            f"{_size(weights) / 1e6:.1f} MB; give more"
        )
    sequences, held_out = _held_out(settings, int(left * _HELD_OUT_SHARE))
    if packed.validation is not None:
        packed = replace(packed, validation=replace(packed.validation, held_out=held_out))
    sources = [open_training_source(each) for each in settings.sources]
    left -= sum(map(_size, sequences))
    crops = draw_crops(sources, settings.pairs.reach, settings.seed, left)
    while True:
        if not crops:
            raise ArgumentError(f"megabytes {megabytes:g} of a pack: no crop fits in; give more")
        packed, files = _with_crops(settings, packed, crops)
        for part in (weights, *sequences):
            files.update(part)
        files[CONFIG] = config_text(packed).encode()
        if _size(files) <= limit:
            break
        crops = crops[: -max(1, len(crops) // 100)]
    _write(folder, files)
    targets = {(crop.source, crop.kind, crop.scene, crop.index) for crop in crops}
    return PackSummary(len(crops), len(targets), len(sequences), _size(files))


def _weights(settings: TrainSettings) -> tuple[Files, TrainSettings]:
    """The files of initial weights and teachers, and the settings with their paths in the pack."""
    files: Files = {}
    network, teacher = settings.network, settings.teacher
    begin = network.begin_path
    if begin is not None and network.begin != SHIPPED_NAME:
        files["weights/begin.pth"] = _read(begin)
        network = replace(network, begin="weights/begin.pth")
    if teacher is not None:
        for path in onnx_pair(Path(teacher.weights)):
            files[f"weights/nanotrack/{path.name}"] = _read(path)
        teacher = replace(teacher, weights="weights/nanotrack")
        if teacher.fear is not None:
            for path in fear_pair(Path(teacher.fear)):
                files[f"weights/fear/{path.name}"] = _read(path)
            teacher = replace(teacher, fear="weights/fear")
    return files, replace(settings, network=network, teacher=teacher, relative=True)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise WeightsError(f"weights {path} cannot be read: {error.strerror}") from error


def _held_out(settings: TrainSettings, max_bytes: int) -> tuple[list[Files], tuple[HeldOut, ...]]:
    """Files of each held-out sequence that fits, and the datasets; each has an equal share."""
    tables = settings.validation.held_out if settings.validation is not None else ()
    found: list[Files] = []
    packed: list[HeldOut] = []
    for number, table in enumerate(tables):
        folder, left = f"held_out{number:02}", max_bytes / len(tables)
        for sequence in _shuffled(list(held_out_sequences(table)), settings.seed):
            assert settings.validation is not None
            count = min(settings.validation.frames, _HELD_OUT_FRAMES)
            name = sequence.name.replace("/", "_")
            files = _sequence_files(sequence, f"{folder}/{name}", count)
            left -= _size(files)
            if left < 0:
                break
            found.append(files)
            if not packed or packed[-1].path != folder:
                packed.append(HeldOut(folder, "got10k", name=table.name))
    return found, tuple(packed)


def _shuffled(sequences: list[VideoSequence], seed: int) -> Iterator[VideoSequence]:
    for index in np.random.default_rng(seed).permutation(len(sequences)):
        yield sequences[index]


def _sequence_files(sequence: VideoSequence, folder: str, count: int) -> Files:
    """The first frames of a sequence in the layout of GOT-10k, cut to a fixed window."""
    count = min(count, len(sequence), len(sequence.truth))
    images = list(islice(sequence.images(), count))
    boxes = [
        sequence.box(t) if np.isfinite(sequence.truth[t]).all() else None for t in range(count)
    ]
    height, width = images[0].shape[:2]
    window = window_around([box for box in boxes if box is not None], (width, height))
    files: Files = {}
    lines = []
    for number, (image, box) in enumerate(zip(images, boxes, strict=True), 1):
        files[f"{folder}/{number:08}.jpg"] = window.jpeg(image)
        lines.append(
            "nan,nan,nan,nan"
            if box is None
            else ",".join(f"{value:.2f}" for value in window.box(box))
        )
    files[f"{folder}/groundtruth.txt"] = ("\n".join(lines) + "\n").encode()
    files[f"{folder}/absence.label"] = b"".join(b"1\n" if box is None else b"0\n" for box in boxes)
    return files


def _with_crops(
    settings: TrainSettings, packed: TrainSettings, crops: Sequence[PackedCrop]
) -> tuple[TrainSettings, Files]:
    """The settings with the packed sources, and their files."""
    sources: list[SourceSettings] = []
    files: Files = {}
    for number, source in enumerate(settings.sources):
        own, own_files = source_files(
            source, number, (crop for crop in crops if crop.source == number)
        )
        sources += own
        files.update(own_files)
    return replace(packed, sources=tuple(sources)), files


def _write(folder: Path, files: Files) -> None:
    make_folder(folder)
    for name, data in files.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        except OSError as error:
            raise output_error(path, error) from error


def _size(files: Files) -> int:
    return sum(map(len, files.values()))
