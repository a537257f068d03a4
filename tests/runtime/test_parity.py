"""Every golden network on every runtime, compared with the reference implementation's arrays.

With the environment variable SSIAM_SLOW the second SiamMask is also exported.
"""

import numpy as np
import pytest

from helpers.seeded_weights import GOLDEN, noise_crop
from ssiam.runtime import RuntimeOptions

pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers.network_models import NETWORKS, SLOW, checkpoint, exported, folder
from ssiam.runtime.export import relative_difference
from ssiam.runtime.loading import load_pieces
from ssiam.trackers.siammask import refinement_windows

TOLERANCE = 1e-3  # see relative_difference
REFINED = [(12, 12), (0, 0), (24, 24), (5, 17)]  # rows and columns


@pytest.mark.parametrize("runtime", ["torch", "onnxruntime", "openvino"])
@pytest.mark.parametrize("golden", NETWORKS)
def test_outputs_match_the_reference(golden, runtime, monkeypatch):
    if runtime == "onnxruntime":
        pytest.importorskip("onnxruntime")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder() / "cache"))
    if golden.startswith("foolwood") and runtime != "torch" and not SLOW:
        pytest.skip("the same network as siammask_r50_l3: set SSIAM_SLOW to export it")
    weights = checkpoint(golden) if runtime == "torch" else exported(golden)
    pieces = load_pieces(weights, NETWORKS[golden][1], RuntimeOptions(runtime))
    reference = np.load(GOLDEN / f"{golden}.npz")
    for name, array in outputs(pieces).items():
        values = array.ravel()[:: reference[f"{name}__stride"]]
        assert relative_difference(values, reference[name]) < TOLERANCE, name


def outputs(pieces):
    """Outputs by the names of the golden arrays."""
    count, _, side, _ = pieces["search"].input_shapes[0]
    search = np.repeat(noise_crop(2, side), count, axis=0)
    maps = pieces["search"](search, *pieces["template"](noise_crop(1, 127)))
    assert [each.shape for each in maps] == pieces["search"].output_shapes
    if len(maps) == 1:
        return {"response": maps[0][:1]}
    arrays = dict(zip(("cls", "loc", "mask_corr_feature"), maps, strict=False))
    if "refine" in pieces:
        for cell in REFINED:
            patches = refinement_windows(maps[2], maps[3:], cell)
            arrays[f"refine_{cell[0]}_{cell[1]}"] = pieces["refine"](*patches)[0]
    return arrays
