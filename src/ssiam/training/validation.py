"""Validation: success and precision of a network's tracker on held-out sequences."""

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

from ssiam.datasets import VideoSequence, open_dataset
from ssiam.evaluation.measures.success import Success, mean_success, success
from ssiam.networks import GraphRunner, PieceShapes, inference_graphs
from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.lite import LiteNetwork
from ssiam.runtime import Network
from ssiam.stabilize import FrameView
from ssiam.trackers.lite import LiteNetworks, LiteTracker
from ssiam.training.data.mask_sampling import MaskSampler
from ssiam.training.data.registry import SourceSettings, open_training_source
from ssiam.training.data.settings import AugmentSettings, PairSettings
from ssiam.training.settings import HeldOut, ValidationSettings
from ssiam.training.students import AnyNetwork

__all__ = ["held_out_sequences", "validate"]

_NO_AUGMENTATION: Final = AugmentSettings(*[0.0] * len(fields(AugmentSettings)))
_HALF_COVERED: Final = 127  # of 255


def validate(network: AnyNetwork, settings: ValidationSettings) -> dict[str, float]:
    """Success and precision of one pass over the held-out sequences, averaged per dataset name.

    Each sequence is initialized with its first box and tracked without stabilization. The metrics
    are called "success" and "precision", or "NAME success" and "NAME precision" if the dataset has
    a name.
    A mask network is validated by "mask_overlap", the mean IoU of its masks.

    Parameters
    ----------
    network : LiteNetwork or BoxMaskNetwork
    settings : ValidationSettings

    Raises
    ------
    DatasetError
        A dataset is missing or damaged.
    """
    if isinstance(network, BoxMaskNetwork):
        return {"mask_overlap": _mask_overlap(network, settings)}
    tracker = _tracker(network)
    by_name: dict[str, list[Success]] = defaultdict(list)
    for held_out in settings.held_out:
        for sequence in held_out_sequences(held_out):
            count = min(len(sequence), settings.frames, len(sequence.truth))
            truth = np.array([sequence.box(t) for t in range(count)])
            boxes = _track(tracker, sequence, count)
            by_name[held_out.name].append(success(boxes, truth))
    values = {}
    for name, results in by_name.items():
        mean = mean_success(results)
        values[f"{name} success".lstrip()] = mean.auc
        values[f"{name} precision".lstrip()] = mean.precision
    return values


def _mask_overlap(network: BoxMaskNetwork, settings: ValidationSettings) -> float:
    """Mean IoU of the masks of boxes with the errors of a tracker.

    `HeldOut.kind` is a layout of training data with masks here, "davis" by default. The same
    `ValidationSettings.frames` crops of each dataset are used every time.
    """
    overlaps: list[float] = []
    for held_out in settings.held_out:
        layout = held_out.kind or "davis"
        source = open_training_source(SourceSettings(layout, held_out.path, only=held_out.only))
        sampler = MaskSampler([source], PairSettings(augment=_NO_AUGMENTATION))
        batch = sampler.batch(0, settings.frames)
        with torch.inference_mode():
            logits = network(torch.from_numpy(batch.crop).float())[:, 0].numpy()
        inside, mask = logits > 0, batch.mask > _HALF_COVERED
        overlaps.extend((inside & mask).sum((1, 2)) / (inside | mask).sum((1, 2)))
    return float(np.mean(overlaps))


def held_out_sequences(held_out: HeldOut) -> Iterator[VideoSequence]:
    """The sequences of a dataset for validation; raises as `validate`."""
    dataset = open_dataset(held_out.path, held_out.kind, split=held_out.split)
    for name in dataset.sequences:
        if not held_out.only or any(fnmatchcase(name, pattern) for pattern in held_out.only):
            yield dataset.sequences[name]


def _track(tracker: LiteTracker, sequence: VideoSequence, count: int) -> list[tuple[float, ...]]:
    """The boxes of the first `count` frames; the first one is the true box."""
    frames = islice(sequence.images(), count)
    tracker.init(FrameView(next(frames)), sequence.box(0))
    return [sequence.box(0), *(tracker.update(FrameView(frame)).box for frame in frames)]


def _tracker(network: LiteNetwork) -> LiteTracker:
    """A tracker with the network in PyTorch, without masks."""
    graphs = inference_graphs(network, sliced=False)
    runners: dict[str, Network] = {
        piece: GraphRunner(graphs[piece].eval(), partial(PieceShapes, [], []))
        for piece in ("template", "search")
    }
    return LiteTracker(LiteNetworks(runners["template"], runners["search"]))
