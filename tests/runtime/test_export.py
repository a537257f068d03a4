"""Export to ONNX: nodes and inputs of the files, the manifest, int8, and errors."""

import importlib.util
import json

import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from helpers.network_models import checkpoint, exported  # noqa: E402
from helpers.synthetic import golden_video  # noqa: E402
from ssiam.errors import ArgumentError, SinkError, WeightsError  # noqa: E402
from ssiam.runtime import RuntimeOptions, export, load_network, load_pieces  # noqa: E402
from ssiam.runtime.files import sha256  # noqa: E402
from ssiam.runtime.manifest import Manifest  # noqa: E402
from ssiam.stabilize import FrameView  # noqa: E402
from ssiam.trackers.siamese import crop_tensor  # noqa: E402

ALEX = "siamrpn_alex_dwxcorr"


def export_alex(folder, **changes):
    return export.export_network(
        checkpoint(ALEX), folder, **{"name": ALEX, "network": ALEX, **changes}
    )


def test_kernels_are_inputs_and_no_weights_of_convolutions():
    graph = onnx.load(exported(ALEX) / "search.onnx").graph
    shapes = {
        entry.name: tuple(d.dim_value for d in entry.type.tensor_type.shape.dim)
        for entry in graph.input
    }
    assert shapes == {
        "search_crop": (1, 3, 287, 287),
        "cls_kernel": (1, 256, 4, 4),
        "loc_kernel": (1, 256, 4, 4),
    }
    assert [entry.name for entry in graph.output] == ["cls", "loc"]
    constants = {weight.name for weight in graph.initializer}
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    assert convolutions
    assert all(node.input[1] in constants for node in convolutions)


def test_the_manifest_describes_the_files():
    manifest = json.loads((exported(ALEX) / "network.json").read_text())
    assert list(manifest) == [
        *("name", "network", "sha256", "pieces", "precision", "opset", "ssiam")
    ]
    assert manifest["name"] == manifest["network"] == ALEX
    assert manifest["sha256"] == sha256(checkpoint(ALEX))
    assert (manifest["pieces"], manifest["precision"]) == (["template", "search"], "f32")
    opset = onnx.load(exported(ALEX) / "search.onnx").opset_import[0].version
    assert opset == manifest["opset"]


def test_the_form_of_the_cache_key_is_fixed():
    """Names of files in users' cache folders depend on it."""
    manifest = Manifest("a", "b", "c0", ("template", "search"), "int8", 17, "0.1")
    assert manifest.cache_key == (
        "Exported(name='a', network='b', sha256='c0', pieces=('template', 'search'), "
        "precision='int8', opset=17, ssiam='0.1')"
    )


def test_nothing_is_written_if_the_files_differ_from_pytorch(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "TOLERANCE", 0.0)
    message = r"template piece .* differs from PyTorch by .* nothing was written"
    with pytest.raises(WeightsError, match=message):
        export_alex(tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        pytest.param(
            {"network": "siamfc"},
            WeightsError,
            f"those of {ALEX}, not of siamfc",
            id="another network",
        ),
        pytest.param({"precision": "int8"}, ArgumentError, "needs images", id="no images"),
    ],
)
def test_wrong_arguments_are_refused(tmp_path, changes, error, message):
    with pytest.raises(error, match=message) as caught:
        export_alex(tmp_path, **changes)
    assert "\n" not in str(caught.value)


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(SinkError, match=r"file/out: cannot be written \(Not a directory\)"):
        export_alex(tmp_path / "file" / "out")


@pytest.mark.skipif(
    importlib.util.find_spec("onnxruntime") is None, reason="int8 needs onnxruntime"
)
def test_int8_agrees_between_runtimes_and_is_close_to_f32(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("ssiam.runtime.quantization._CROPS", 6)
    frames, _ = golden_video("A", 4)
    assert export_alex(tmp_path / "int8", precision="int8", images=frames).precision == "int8"
    assert Manifest.read(tmp_path / "int8").precision == "int8"
    view = FrameView(frames[3])
    crops = [
        view.crop_square((110, 120), side, out, (0, 0, 0)) for side, out in ((90, 127), (203, 287))
    ]
    template, search = map(crop_tensor, crops)
    maps = {}
    for runtime, folder in (
        ("openvino", exported(ALEX)),
        ("openvino", tmp_path / "int8"),
        ("onnxruntime", tmp_path / "int8"),
    ):
        options = RuntimeOptions(runtime, precision="f32" if folder == exported(ALEX) else "int8")
        pieces = load_pieces(folder, ALEX, options)
        maps[runtime, options.precision] = pieces["search"](search, *pieces["template"](template))
    exact, int8 = maps["openvino", "f32"], maps["openvino", "int8"]
    for i, other in enumerate(maps["onnxruntime", "int8"]):
        assert export.relative_difference(int8[i], other) < 0.05
        assert 1e-4 < export.relative_difference(int8[i], exact[i]) < 0.25
    size = (exported(ALEX) / "search.onnx").stat().st_size
    assert (tmp_path / "int8" / "search.onnx").stat().st_size < 0.4 * size


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_int8_of_f32_files_is_refused(runtime):
    pytest.importorskip(runtime)
    with pytest.raises(WeightsError, match="not in int8: export them with"):
        load_network(exported(ALEX) / "search.onnx", runtime=runtime, precision="int8")
    with pytest.raises(ArgumentError, match="not in int8: write those with"):
        load_pieces(exported(ALEX), ALEX, RuntimeOptions(runtime, precision="int8"))
