"""Each network with seeded weights, compared with the reference implementation's arrays."""

import numpy as np
import pytest

from helpers.seeded_weights import GOLDEN, noise_crop

torch = pytest.importorskip("torch")

from helpers.network_files import save_checkpoint, seeded_state  # noqa: E402
from helpers.network_models import NETWORKS  # noqa: E402
from ssiam.networks import inference_graphs, read_checkpoint  # noqa: E402
from ssiam.networks.checkpoints import network_from_state_dict  # noqa: E402
from ssiam.trackers.siammask import refinement_windows  # noqa: E402

TOLERANCE = 1e-4  # of an array's largest magnitude
REFINED = [(12, 12), (0, 0), (24, 24), (5, 17)]  # rows and columns


@pytest.fixture(scope="module", params=NETWORKS)
def arrays(request, tmp_path_factory):
    """Golden arrays of a network, and those of its inference pieces."""
    torch.set_num_threads(1)
    checkpoint, name = NETWORKS[request.param]
    path = save_checkpoint(
        tmp_path_factory.mktemp("weights") / "model.pth", seeded_state(checkpoint)
    )
    recognized, network = read_checkpoint(path)
    path.unlink()
    assert recognized == name
    with torch.inference_mode():
        actual = {key: value.numpy() for key, value in _run(name, network).items()}
    return np.load(GOLDEN / f"{request.param}.npz"), actual


def test_values_match_the_reference(arrays):
    golden, actual = arrays
    names = [key.removesuffix("__stride") for key in golden if key.endswith("__stride")]
    assert set(names) == set(actual)
    for name in names:
        values = actual[name].ravel()[:: golden[f"{name}__stride"]]
        assert distance(values, golden[name]) < TOLERANCE, name


def test_statistics_match_the_reference(arrays):
    golden, actual = arrays
    for name, array in actual.items():
        values = array.astype(np.float64)
        statistics = [values.mean(), values.std(), values.min(), values.max(), np.abs(values).sum()]
        assert np.allclose(statistics, golden[f"{name}__stats"], rtol=1e-5, atol=1e-5), name


@pytest.mark.parametrize(
    "checkpoint", ["siamfc_alexnet_e50", "siamrpn_alex_dwxcorr", "siammask_r50_l3"]
)
def test_the_pieces_match_the_network(checkpoint):
    _, network = network_from_state_dict(seeded_state(checkpoint))
    template = torch.from_numpy(noise_crop(1, 127))
    search = torch.from_numpy(noise_crop(2, network.search_shape[-1], network.search_shape[0]))
    graphs = inference_graphs(network)
    with torch.inference_mode():
        whole = network(template, search)
        pieces = list(graphs["search"](search, *graphs["template"](template)))
        if checkpoint == "siammask_r50_l3":
            cell = (..., slice(5, 6), slice(17, 18))
            pieces[2], whole = network.masks(pieces[2][cell]), (*whole[:2], whole[2][cell])
    for piece, expected in zip(pieces, whole, strict=False):
        assert distance(piece.numpy(), expected.numpy()) < TOLERANCE


def distance(actual, expected):
    """Largest difference, relative to the largest expected magnitude."""
    return np.abs(actual - expected.reshape(actual.shape)).max() / np.abs(expected).max()


def _run(name, network):
    levels = []
    hook = network.backbone.register_forward_hook(lambda *call: levels.append(call[2]))
    template = torch.from_numpy(noise_crop(1, 127))
    search = torch.from_numpy(noise_crop(2, network.search_shape[-1]))
    graphs = inference_graphs(network)
    pieces = graphs["search"](search, *graphs["template"](template))
    hook.remove()
    if name == "siamfc":
        return _siamfc(network, template, levels, pieces)
    outputs = _siamrpn(network, levels, pieces)
    if name == "siammask_r50_l3":
        outputs |= _siammask(network, graphs["refine"], pieces)
    return outputs


def _siamfc(network, template, levels, pieces):
    outputs = {"zf": levels[0], "xf": levels[1], "response": pieces[0]}
    features = template
    for name, stage in network.backbone.named_children():
        features = stage(features)
        outputs[f"z_{name}"] = features
    return outputs


def _siamrpn(network, levels, pieces):
    outputs = {"cls": pieces[0], "loc": pieces[1]}
    for letter, features in zip("zx", levels, strict=True):
        outputs |= {f"backbone_{letter}{i}": level for i, level in enumerate(features)}
    return outputs | {f"zf{i}": level for i, level in enumerate(network.neck.template(levels[0]))}


def _siammask(network, refine, pieces):
    masks = network.masks(pieces[2])
    outputs = {
        "mask_9_6_6": masks[:, ::9, ::6, ::6],
        "mask_full_at_12_12": masks[0, :, 12, 12],
        "mask_corr_feature": pieces[2],
    }
    corr, *features = [piece.numpy() for piece in pieces[2:]]
    for row, column in REFINED:
        patches = refinement_windows(corr, features, (row, column))
        outputs[f"refine_{row}_{column}"] = refine(*map(torch.from_numpy, patches))
    return outputs
