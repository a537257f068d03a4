"""ONNX files: their inputs and nodes, what is recorded, and what is refused."""

import importlib.util
import json

import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from helpers.network_models import checkpoint, exported  # noqa: E402
from helpers.synthetic import golden_video  # noqa: E402
from ssiam.errors import (  # noqa: E402
    ArgumentError,
    MissingExtraError,
    SinkError,
    WeightsError,
)
from ssiam.networks import build_network, inference_graphs, write_onnx  # noqa: E402
from ssiam.runtime import RuntimeOptions, export, load_network  # noqa: E402
from ssiam.runtime.files import sha256  # noqa: E402
from ssiam.runtime.loading import load_pieces  # noqa: E402
from ssiam.runtime.manifest import Manifest  # noqa: E402
from ssiam.stabilize import FrameView  # noqa: E402
from ssiam.trackers.siamese import crop_tensor  # noqa: E402

ALEX = "siamrpn_alex_dwxcorr"


def export_alex(folder, **changes):
    return export.export_network(
        checkpoint(ALEX), folder, **{"name": ALEX, "network": ALEX, **changes}
    )


def test_kernels_are_inputs_and_no_convolution_has_them_as_weights():
    graph = onnx.load(exported(ALEX) / "search.onnx").graph
    shapes = {
        each.name: tuple(d.dim_value for d in each.type.tensor_type.shape.dim)
        for each in graph.input
    }
    assert shapes == {
        "search_crop": (1, 3, 287, 287),
        "cls_kernel": (1, 256, 4, 4),
        "loc_kernel": (1, 256, 4, 4),
    }
    assert [each.name for each in graph.output] == ["cls", "loc"]
    constants = {each.name for each in graph.initializer}
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    assert convolutions
    assert all(node.input[1] in constants for node in convolutions)


def test_the_record_says_what_the_files_are():
    record = json.loads((exported(ALEX) / "network.json").read_text())
    assert record["name"] == record["network"] == ALEX
    assert record["sha256"] == sha256(checkpoint(ALEX))
    assert (record["pieces"], record["precision"]) == (["template", "search"], "f32")
    assert onnx.load(exported(ALEX) / "search.onnx").opset_import[0].version == record["opset"]


def test_files_that_differ_from_pytorch_are_not_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "TOLERANCE", 0.0)
    with pytest.raises(WeightsError, match=r"template piece .* differs from PyTorch by .* kept"):
        export_alex(tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "error", "complaint"),
    [
        pytest.param(
            {"network": "siamfc"}, WeightsError, f"those of {ALEX}, not of siamfc", id="another"
        ),
        pytest.param({"precision": "int8"}, ArgumentError, "needs images", id="no pictures"),
    ],
)
def test_what_cannot_be_exported(tmp_path, changes, error, complaint):
    with pytest.raises(error, match=complaint) as caught:
        export_alex(tmp_path, **changes)
    assert "\n" not in str(caught.value)


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(SinkError, match="file/out cannot be written"):
        export_alex(tmp_path / "file" / "out")


def test_the_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("ssiam.networks.export.find_spec", lambda name: None)
    with torch.device("meta"):
        graph = inference_graphs(build_network(ALEX))["template"]
    with pytest.raises(MissingExtraError, match=r"onnx is not installed.*ssiam\[torch\]"):
        write_onnx(graph, [(1, 3, 127, 127)], tmp_path / "x.onnx", opset=17)


@pytest.mark.skipif(
    importlib.util.find_spec("onnxruntime") is None, reason="int8 needs onnxruntime"
)
def test_int8_runs_alike_on_both_runtimes_and_near_f32(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("ssiam.runtime.quantization._CROPS", 6)
    frames, _ = golden_video("A", 4)
    assert export_alex(tmp_path / "int8", precision="int8", pictures=frames).precision == "int8"
    assert Manifest.read(tmp_path / "int8").precision == "int8"
    view = FrameView(frames[3])
    crops = [view.crop((110, 120), side, out, (0, 0, 0)) for side, out in ((90, 127), (203, 287))]
    template, search = map(crop_tensor, crops)
    maps = {}
    for runtime, folder in (
        ("openvino", exported(ALEX)),
        ("openvino", tmp_path / "int8"),
        ("onnxruntime", tmp_path / "int8"),
    ):
        running = RuntimeOptions(runtime, precision="f32" if folder == exported(ALEX) else "int8")
        pieces = load_pieces(folder, ALEX, running)
        maps[runtime, running.precision] = pieces["search"](search, *pieces["template"](template))
    exact, ours = maps["openvino", "f32"], maps["openvino", "int8"]
    for i, theirs in enumerate(maps["onnxruntime", "int8"]):
        assert export.distance(ours[i], theirs) < 0.05
        assert 1e-4 < export.distance(ours[i], exact[i]) < 0.25
    size = (exported(ALEX) / "search.onnx").stat().st_size
    assert (tmp_path / "int8" / "search.onnx").stat().st_size < 0.4 * size


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_int8_is_not_claimed_for_f32_files(runtime):
    pytest.importorskip(runtime)
    with pytest.raises(WeightsError, match="not in int8: export them so"):
        load_network(exported(ALEX) / "search.onnx", runtime=runtime, precision="int8")
    with pytest.raises(ArgumentError, match="not in int8: export"):
        load_pieces(exported(ALEX), ALEX, RuntimeOptions(runtime, precision="int8"))
