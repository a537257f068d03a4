"""How well a network tracks: success on sequences that it has never seen."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import fields
from fnmatch import fnmatchcase
from functools import partial
from itertools import islice
from typing import Final

import numpy as np
import torch

from ssiam.datasets import Sequence, open_dataset
from ssiam.evaluation.measures.success import Success, mean_success, success
from ssiam.networks import GraphRunner, PieceShapes, inference_graphs
from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.lite import LiteNetwork
from ssiam.networks.lite2 import Lite2Network
from ssiam.runtime import Network
from ssiam.stabilize import FrameView
from ssiam.trackers.lite import LiteNetworks, LiteTracker
from ssiam.trackers.lite2 import Lite2Networks, Lite2Tracker
from ssiam.training.augment import AugmentSettings
from ssiam.training.ema import AnyNetwork
from ssiam.training.mask_crops import MaskSampler
from ssiam.training.opening import SourceSettings, open_training_source
from ssiam.training.pair_settings import PairSettings
from ssiam.training.validation_settings import HeldOut, ValidationSettings

__all__ = ["held_out_sequences", "mask_overlap", "validate"]

_UNCHANGED: Final = AugmentSettings(*[0.0] * len(fields(AugmentSettings)))
_HALF: Final = 127  # of 255, a cell of which a half is covered


def validate(network: AnyNetwork, settings: ValidationSettings) -> dict[str, float]:
    """Success and precision of one pass over the held-out sequences, means of each dataset.

    Every sequence is started on its first box and tracked for as many frames as the settings
    say, without stabilization. The values of datasets without a name are called success and
    precision; those of the others, which may share one, have the name before that. A network of
    masks is measured by the mean overlap (IoU) of its masks, see `mask_overlap`.

    Raises
    ------
    DatasetError
        A dataset is missing or damaged.
    """
    if isinstance(network, BoxMaskNetwork):
        return {"mask_overlap": mask_overlap(network, settings)}
    tracker = _tracker(network)
    found: dict[str, list[Success]] = defaultdict(list)
    for each in settings.held_out:
        for sequence in held_out_sequences((each,)):
            count = min(len(sequence), settings.frames, len(sequence.truth))
            truth = np.array([sequence.box(t) for t in range(count)])
            found[each.name].append(success(_tracked(tracker, sequence, count), truth))
    values = {}
    for name, of_name in found.items():
        mean = mean_success(of_name)
        values[f"{name} success".lstrip()] = mean.auc
        values[f"{name} precision".lstrip()] = mean.precision
    return values


def mask_overlap(network: BoxMaskNetwork, settings: ValidationSettings) -> float:
    """Mean overlap (IoU) of the masks of boxes that are as little exact as a tracker's.

    The datasets' kind is a layout of training data with masks, "davis" if none is named; `frames`
    crops are drawn of each, always the same.
    """
    found: list[float] = []
    for each in settings.held_out:
        source = open_training_source(
            SourceSettings(each.kind or "davis", each.path, only=each.only)
        )
        sampler = MaskSampler([source], PairSettings(augment=_UNCHANGED))
        batch = sampler.batch(0, settings.frames)
        with torch.inference_mode():
            logits = network(torch.from_numpy(batch.crop).float())[:, 0].numpy()
        inside, mask = logits > 0, batch.mask > _HALF
        found.extend((inside & mask).sum((1, 2)) / (inside | mask).sum((1, 2)))
    return float(np.mean(found))


def held_out_sequences(held_out: tuple[HeldOut, ...]) -> Iterator[Sequence]:
    """The sequences of the datasets, of those that the patterns take."""
    for each in held_out:
        dataset = open_dataset(each.path, each.kind, split=each.split)
        for name in dataset.sequences:
            if not each.only or any(fnmatchcase(name, pattern) for pattern in each.only):
                yield dataset.sequences[name]


def _tracked(
    tracker: LiteTracker | Lite2Tracker, sequence: Sequence, count: int
) -> list[tuple[float, ...]]:
    """The boxes of a sequence's first frames."""
    frames = islice(sequence.images(), count)
    tracker.init(FrameView(next(frames)), sequence.box(0))
    return [sequence.box(0), *(tracker.track(FrameView(frame)).box for frame in frames)]


def _tracker(network: LiteNetwork | Lite2Network) -> LiteTracker | Lite2Tracker:
    """A tracker on the network's pieces in PyTorch; success does not look at masks."""
    graphs = inference_graphs(network, sliced=False)
    runners: dict[str, Network] = {
        piece: GraphRunner(graphs[piece].eval(), partial(PieceShapes, [], []))
        for piece in ("template", "search")
    }
    if isinstance(network, Lite2Network):
        return Lite2Tracker(Lite2Networks(runners["template"], runners["search"]))
    return LiteTracker(LiteNetworks(runners["template"], runners["search"]), masks=False)
