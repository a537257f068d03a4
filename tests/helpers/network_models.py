"""Checkpoint files and exports of networks with seeded weights, made once per test run."""

import atexit
import os
import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from helpers.network_files import save_checkpoint, seeded_state

SLOW = bool(os.environ.get("SSIAM_SLOW"))  # whether to run the slow tests

NETWORKS = {  # golden file: checkpoint of its weights, network
    "siamfc": ("siamfc_alexnet_e50", "siamfc"),
    "siamrpn_alex_dwxcorr": ("siamrpn_alex_dwxcorr", "siamrpn_alex_dwxcorr"),
    "siamrpn_mobilev2_l234_dwxcorr": ("siamrpn_mobilev2_l234_dwxcorr",) * 2,
    "siamrpn_r50_l234_dwxcorr": ("siamrpn_r50_l234_dwxcorr",) * 2,
    "siammask_r50_l3": ("siammask_r50_l3",) * 2,
    "foolwood_siammask_sharp": ("SiamMask_foolwood_sharp", "siammask_r50_l3"),
}


@cache
def folder() -> Path:
    """A folder that is removed at the end of the test run."""
    path = Path(mkdtemp(prefix="ssiam-tests-"))
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


@cache
def checkpoint(golden: str) -> Path:
    """The .pth file of a network, by the name of its golden file."""
    name, _ = NETWORKS[golden]
    return save_checkpoint(folder() / f"{golden}.pth", seeded_state(name))


@cache
def exported(golden: str) -> Path:
    """The folder of a network's .onnx files, by the name of its golden file."""
    from ssiam.runtime.export import export_network

    _, network = NETWORKS[golden]
    export_network(checkpoint(golden), folder() / golden, name=network, network=network)
    return folder() / golden
