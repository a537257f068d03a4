"""Names and shapes of the inference pieces, and the package that their export needs."""

import pytest

torch = pytest.importorskip("torch")

from ssiam.errors import ArgumentError, MissingExtraError  # noqa: E402
from ssiam.networks import NETWORKS, build_network, inference_graphs, write_onnx  # noqa: E402

MAPS = [(1, 10, 25, 25), (1, 20, 25, 25)]
CORR = (1, 256, 25, 25)
KERNEL = (1, 256, 5, 5)
SIAMRPN = (["template", "search"], [KERNEL] * 6, MAPS)
PIECES = {
    "siamfc": (["template", "search"], [(1, 256, 6, 6)], [(3, 1, 17, 17)]),
    "siamrpn_alex_dwxcorr": (
        *(["template", "search"], [(1, 256, 4, 4)] * 2),
        [(1, 10, 21, 21), (1, 20, 21, 21)],
    ),
    "siamrpn_mobilev2_l234_dwxcorr": SIAMRPN,
    "siamrpn_r50_l234_dwxcorr": SIAMRPN,
    "siamrpn_r50_l234_dwxcorr_otb": SIAMRPN,
    "siammask_r50_l3": (
        *(["template", "search", "refine"], [KERNEL] * 3),
        [*MAPS, CORR, (1, 64, 125, 125), (1, 256, 63, 63), (1, 512, 31, 31)],
    ),
    "siammask_base": (["template", "search", "mask"], [KERNEL] * 3, [*MAPS, CORR]),
}


@pytest.mark.parametrize("sliced", [True, False], ids=["sliced", "convolved"])
@pytest.mark.parametrize("name", NETWORKS)
def test_template_and_search(name, sliced):
    with torch.device("meta"):
        network = build_network(name)
        graphs = inference_graphs(network, sliced=sliced)
        kernels = graphs["template"](torch.zeros(network.template_shape))
        responses = graphs["search"](torch.zeros(network.search_shape), *kernels)
    assert (list(graphs), _shapes(kernels), _shapes(responses)) == PIECES[name]
    assert len(graphs["template"].output_names) == len(kernels)
    assert graphs["search"].input_names == ("search_crop", *graphs["template"].output_names)
    assert len(graphs["search"].output_names) == len(responses)


def test_masks():
    with torch.device("meta"):
        refine = inference_graphs(build_network("siammask_r50_l3"))["refine"]
        shapes = [(1, 64, 61, 61), (1, 256, 31, 31), (1, 512, 15, 15), (1, 256, 1, 1)]
        assert refine(*map(torch.zeros, shapes)).shape == (1, 127 * 127)
        mask = inference_graphs(build_network("siammask_base"))["mask"]
        assert mask(torch.zeros(1, 256, 1, 1)).shape == (1, 63 * 63, 1, 1)


def test_an_unknown_network_is_refused():
    with pytest.raises(ArgumentError, match="unknown network 'siamcar': choose from siamfc, "):
        build_network("siamcar")


def test_the_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("ssiam.networks.export.find_spec", lambda name: None)
    with torch.device("meta"):
        graph = inference_graphs(build_network("siamrpn_alex_dwxcorr"))["template"]
    with pytest.raises(MissingExtraError, match=r"onnx is not installed.*ssiam\[torch\]"):
        write_onnx(graph, [(1, 3, 127, 127)], tmp_path / "x.onnx", opset=17)


def _shapes(tensors):
    return [tuple(tensor.shape) for tensor in tensors]
