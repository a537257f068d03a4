"""Each network on weights by rule against the reference implementation's arrays."""

import numpy as np
import pytest

from helpers.rule_weights import GOLDEN, crop

torch = pytest.importorskip("torch")

from helpers.network_files import rule_state, saved  # noqa: E402
from ssiam.networks import inference_graphs, read_checkpoint  # noqa: E402
from ssiam.networks.checkpoints import load_weights  # noqa: E402
from ssiam.trackers.siammask import refinement_windows  # noqa: E402

TOLERANCE = 1e-4  # of an array's greatest magnitude
REFINED = [(12, 12), (0, 0), (24, 24), (5, 17)]  # rows and columns

CHECKPOINTS = {  # golden file: names of its weights, network
    "siamfc": ("siamfc_alexnet_e50", "siamfc"),
    "siamrpn_alex_dwxcorr": ("siamrpn_alex_dwxcorr", "siamrpn_alex_dwxcorr"),
    "siamrpn_mobilev2_l234_dwxcorr": ("siamrpn_mobilev2_l234_dwxcorr",) * 2,
    "siamrpn_r50_l234_dwxcorr": ("siamrpn_r50_l234_dwxcorr",) * 2,
    "siammask_r50_l3": ("siammask_r50_l3",) * 2,
    "foolwood_siammask_sharp": ("SiamMask_foolwood_sharp", "siammask_r50_l3"),
}


@pytest.fixture(scope="module", params=CHECKPOINTS)
def arrays(request, tmp_path_factory):
    """The reference's arrays and ours, from the inference pieces of one network."""
    torch.set_num_threads(1)
    keys, name = CHECKPOINTS[request.param]
    path = saved(tmp_path_factory.mktemp("weights") / "model.pth", rule_state(keys))
    recognised, network = read_checkpoint(path)
    path.unlink()
    assert recognised == name
    with torch.inference_mode():
        ours = {key: value.numpy() for key, value in _run(name, network).items()}
    return np.load(GOLDEN / f"{request.param}.npz"), ours


def test_values_are_the_references(arrays):
    theirs, ours = arrays
    names = [key.removesuffix("__stride") for key in theirs if key.endswith("__stride")]
    assert set(names) == set(ours), "an array without a counterpart"
    for name in names:
        values = ours[name].ravel()[:: theirs[f"{name}__stride"]]
        assert distance(values, theirs[name]) < TOLERANCE, name


def test_statistics_are_the_references(arrays):
    theirs, ours = arrays
    for name, array in ours.items():
        values = array.astype(np.float64)
        sums = [values.mean(), values.std(), values.min(), values.max(), np.abs(values).sum()]
        assert np.allclose(sums, theirs[f"{name}__stats"], rtol=1e-5, atol=1e-5), name


@pytest.mark.parametrize("keys", ["siamfc_alexnet_e50", "siamrpn_alex_dwxcorr", "siammask_r50_l3"])
def test_the_whole_is_its_pieces(keys):
    _, network = load_weights(rule_state(keys))
    template = torch.from_numpy(crop(1, 127))
    search = torch.from_numpy(crop(2, network.search_shape[-1], network.search_shape[0]))
    graphs = inference_graphs(network)
    with torch.inference_mode():
        whole = network(template, search)
        pieces = list(graphs["search"](search, *graphs["template"](template)))
        if keys == "siammask_r50_l3":
            cell = (..., slice(5, 6), slice(17, 18))
            pieces[2], whole = network.masks(pieces[2][cell]), (*whole[:2], whole[2][cell])
    for ours, theirs in zip(pieces, whole, strict=False):
        assert distance(ours.numpy(), theirs.numpy()) < TOLERANCE


def distance(ours, theirs):
    """Greatest difference as a share of the greatest magnitude."""
    return np.abs(ours - theirs.reshape(ours.shape)).max() / np.abs(theirs).max()


def _run(name, network):
    levels = []
    hook = network.backbone.register_forward_hook(lambda *call: levels.append(call[2]))
    template = torch.from_numpy(crop(1, 127))
    search = torch.from_numpy(crop(2, network.search_shape[-1]))
    graphs = inference_graphs(network)
    pieces = graphs["search"](search, *graphs["template"](template))
    hook.remove()
    if name == "siamfc":
        return _siamfc(network, template, levels, pieces)
    found = _siamrpn(network, levels, pieces)
    if name == "siammask_r50_l3":
        found |= _siammask(network, graphs["refine"], pieces)
    return found


def _siamfc(network, template, levels, pieces):
    found = {"zf": levels[0], "xf": levels[1], "response": pieces[0]}
    features = template
    for name, stage in network.backbone.named_children():
        features = stage(features)
        found[f"z_{name}"] = features
    return found


def _siamrpn(network, levels, pieces):
    found = {"cls": pieces[0], "loc": pieces[1]}
    for letter, features in zip("zx", levels, strict=True):
        found |= {f"backbone_{letter}{i}": level for i, level in enumerate(features)}
    return found | {f"zf{i}": level for i, level in enumerate(network.neck.template(levels[0]))}


def _siammask(network, refine, pieces):
    masks = network.masks(pieces[2])
    found = {
        "mask_9_6_6": masks[:, ::9, ::6, ::6],
        "mask_full_at_12_12": masks[0, :, 12, 12],
        "mask_corr_feature": pieces[2],
    }
    corr, *features = [piece.numpy() for piece in pieces[2:]]
    for row, column in REFINED:
        windows = refinement_windows(corr, features, (row, column))
        found[f"refine_{row}_{column}"] = refine(*map(torch.from_numpy, windows))
    return found
