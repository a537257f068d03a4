"""The authors' checkpoints, with all their key names and file formats."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from helpers.network_files import constant_state, save_checkpoint  # noqa: E402
from ssiam.networks import read_checkpoint  # noqa: E402

ALEX = "siamrpn_alex_dwxcorr"
HEAD = "rpn_head.loc.head.3.bias"
CONV5 = "backbone.features.14.weight"
OLDER_SIAMFC = {
    "backbone.conv1": ("feature.0", "feature.1"),
    "backbone.conv2": ("feature.4", "feature.5"),
    "backbone.conv3": ("feature.8", "feature.9"),
    "backbone.conv4": ("feature.11", "feature.12"),
    "backbone.conv5": ("feature.14",),
}


@pytest.mark.parametrize(
    ("checkpoint", "network", "original_key", "key"),
    [
        pytest.param(*row, id=row[0])
        for row in (
            ("siamfc_alexnet_e50", "siamfc", *["backbone.conv5.0.bias"] * 2),
            (ALEX, ALEX, CONV5, CONV5),
            ("siamrpn_alex_dwxcorr_16gpu", ALEX, "backbone.layer5.0.weight", CONV5),
            *(
                (name, name, *["rpn_head.rpn4.loc.head.3.bias"] * 2)
                for name in (
                    "siamrpn_mobilev2_l234_dwxcorr",
                    "siamrpn_r50_l234_dwxcorr",
                    "siamrpn_r50_l234_dwxcorr_otb",
                )
            ),
            ("siammask_r50_l3", "siammask_r50_l3", *["refine_head.post2.bias"] * 2),
            (
                *("SiamMask_foolwood_sharp", "siammask_r50_l3"),
                *("refine_model.v2.2.weight", "refine_head.v2.2.weight"),
            ),
            (
                *("SiamMask_foolwood_base", "siammask_base"),
                *("mask_model.mask.head.3.bias", "mask_head.head.3.bias"),
            ),
        )
    ],
)
def test_authors_checkpoints(tmp_path, checkpoint, network, original_key, key):
    state = constant_state(checkpoint)
    name, loaded = read_checkpoint(save_checkpoint(tmp_path / "model.pth", state))
    assert name == network
    assert not loaded.training
    assert torch.equal(loaded.state_dict()[key], state[original_key])
    weights = [value for value in loaded.state_dict().values() if value.is_floating_point()]
    originals = [value for key, value in state.items() if _is_weight(key)]
    assert sorted(map(_first_element, weights)) == sorted(map(_first_element, originals))


def test_siamfc_of_got10k(tmp_path):
    state = constant_state("siamfc_alexnet_e50")
    older = {_older(key): value for key, value in state.items()}
    name, network = read_checkpoint(save_checkpoint(tmp_path / "model.pth", older))
    assert name == "siamfc"
    for key in filter(_is_weight, state):
        assert torch.equal(network.state_dict()[key], state[key])


@pytest.mark.parametrize("zipped", [True, False], ids=["zip", "legacy"])
@pytest.mark.parametrize(
    "content",
    [
        pytest.param(lambda state: state, id="bare"),
        pytest.param(lambda state: dict(state, _epoch=20), id="with a number beside the weights"),
        pytest.param(lambda state: {"epoch": 20, "state_dict": state}, id="snapshot"),
        pytest.param(lambda state: {"model": state}, id="under model"),
        pytest.param(lambda state: {f"module.{k}": v for k, v in state.items()}, id="DataParallel"),
        pytest.param(
            lambda state: {"state_dict": {f"module.{k}": v for k, v in state.items()}},
            id="snapshot of DataParallel training",
        ),
        pytest.param(
            lambda state: {"state_dict": state, "best_acc": np.float64(0.5)},
            id="with a NumPy scalar",
        ),
        pytest.param(
            lambda state: {k: v for k, v in state.items() if _is_weight(k)}, id="of PyTorch 0.4"
        ),
        pytest.param(
            lambda state: {k: v.double() for k, v in state.items()}, id="of double precision"
        ),
    ],
)
def test_containers(tmp_path, content, zipped):
    state = constant_state(ALEX)
    path = save_checkpoint(tmp_path / "model.pth", content(state), zipped=zipped)
    name, network = read_checkpoint(path)
    assert name == ALEX
    assert torch.equal(network.state_dict()[CONV5], state[CONV5])
    assert {value.dtype for value in network.parameters()} == {torch.float32}
    assert not any(value.is_meta for value in network.state_dict().values())


def _first_element(value):
    return float(value.flatten()[0])


def _is_weight(key):
    return not key.endswith("num_batches_tracked")


def _older(key):
    stage, index, leaf = key.rsplit(".", 2)
    return f"{OLDER_SIAMFC[stage][int(index)]}.{leaf}"
