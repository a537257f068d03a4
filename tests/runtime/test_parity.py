"""Every golden network on every runtime against the reference implementation's arrays.

With the environment variable SSIAM_SLOW the second SiamMask is exported as well.
"""

import numpy as np
import pytest

from helpers.rule_weights import GOLDEN, crop
from ssiam.runtime import Running

pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers.network_models import NETWORKS, SLOW, checkpoint, exported, folder
from ssiam.runtime.export import distance
from ssiam.runtime.pieces import load_pieces
from ssiam.trackers.siammask import refinement_windows

TOLERANCE = 1e-3  # of an array's greatest magnitude
REFINED = [(12, 12), (0, 0), (24, 24), (5, 17)]  # rows and columns


@pytest.mark.parametrize("runtime", ["torch", "onnxruntime", "openvino"])
@pytest.mark.parametrize("golden", NETWORKS)
def test_outputs_are_the_references(golden, runtime, monkeypatch):
    if runtime == "onnxruntime":
        pytest.importorskip("onnxruntime")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder() / "cache"))
    if golden.startswith("foolwood") and runtime != "torch" and not SLOW:
        pytest.skip("the same network as siammask_r50_l3: set SSIAM_SLOW to export it too")
    weights = checkpoint(golden) if runtime == "torch" else exported(golden)
    pieces = load_pieces(weights, NETWORKS[golden][1], Running(runtime))
    theirs = np.load(GOLDEN / f"{golden}.npz")
    for name, array in outputs(pieces).items():
        values = array.ravel()[:: theirs[f"{name}__stride"]]
        assert distance(values, theirs[name]) < TOLERANCE, name


def outputs(pieces):
    """Arrays by the names of the golden ones."""
    count, _, side, _ = pieces["search"].input_shapes[0]
    search = np.repeat(crop(2, side), count, axis=0)
    maps = pieces["search"](search, *pieces["template"](crop(1, 127)))
    assert [each.shape for each in maps] == pieces["search"].output_shapes
    if len(maps) == 1:
        return {"response": maps[0][:1]}
    found = dict(zip(("cls", "loc", "mask_corr_feature"), maps, strict=False))
    if "refine" in pieces:
        for cell in REFINED:
            windows = refinement_windows(maps[2], maps[3:], cell)
            found[f"refine_{cell[0]}_{cell[1]}"] = pieces["refine"](*windows)[0]
    return found
