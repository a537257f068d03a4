"""Training on bright squares; as a script, a run that a test can kill."""

import sys
from pathlib import Path

import numpy as np
import torch

from helpers.synthetic import generator
from ssiam.networks.backbones.efficientnet_lite import EfficientNetLite0
from ssiam.networks.lite import LiteNetwork
from ssiam.training.data.batches import Batch
from ssiam.training.settings import NetworkSettings, OptimizerSettings, TrainSettings
from ssiam.training.trainer import train

SQUARE = 56  # px, in both crops


def weights_file(folder):
    """Random weights of the network of `lite`."""
    torch.manual_seed(0)
    path = folder / "random.pth"
    torch.save(LiteNetwork().state_dict(), path)
    return path


def backbone_file(folder):
    """Random weights of the mask network's backbone in a file of the published form."""
    torch.manual_seed(0)
    path = folder / "backbone.pth"
    torch.save(EfficientNetLite0().state_dict(), path)
    return path


def batch(step, size):
    """Pairs of a square on noise; the last of several is negative."""
    r = generator(step)
    template = r.integers(60, 120, (size, 3, 127, 127)).astype(np.uint8)
    search = r.integers(60, 120, (size, 3, 255, 255)).astype(np.uint8)
    template[:, 2, 63 - SQUARE // 2 : 63 + SQUARE // 2, 63 - SQUARE // 2 : 63 + SQUARE // 2] = 250
    box = np.zeros((size, 4), np.float32)
    present = np.arange(size) < max(size - 1, 1)
    for i in np.flatnonzero(present):
        dx, dy = r.integers(-15, 16, 2) * 4 + 1
        x, y = 127 + dx - SQUARE // 2, 127 + dy - SQUARE // 2
        search[i, 2, y : y + SQUARE, x : x + SQUARE] = 250
        box[i] = dx, dy, SQUARE, SQUARE
    return Batch(template, search, box, present, np.ones(size, np.float32))


def settings(weights, **changes):
    network = NetworkSettings(begin=str(weights), frozen_steps=3)
    optimizer = OptimizerSettings(lr=2e-3, warm_up=2)
    short = {"steps": 6, "batch": 2, "log_every": 1, "checkpoint_minutes": 0.0, "sources": ()}
    return TrainSettings(**{**short, "network": network, "optimiser": optimizer, **changes})


def run(folder, weights, **changes):
    """Train to the end in a folder and print each step."""
    run_settings = settings(weights, **changes)

    def batches(steps):
        return (batch(step, run_settings.batch) for step in steps)

    def report(step, values):
        print(step, flush=True)

    train(run_settings, batches, folder, report)


if __name__ == "__main__":
    run(Path(sys.argv[1]), Path(sys.argv[2]))
