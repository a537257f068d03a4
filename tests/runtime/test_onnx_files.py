"""What an ONNX file declares is checked before native code reads it."""

import json
import os

import numpy as np
import pytest

onnx = pytest.importorskip("onnx")

from helpers.onnx_networks import small_network  # noqa: E402
from ssiam.errors import WeightsError  # noqa: E402
from ssiam.runtime import RuntimeOptions, load_network, load_pieces  # noqa: E402
from ssiam.runtime.onnx_files import check_onnx  # noqa: E402
from ssiam.trackers.lite import SHIPPED, LiteNetworks  # noqa: E402

RUNTIMES = ["openvino", "onnxruntime"]


def node(model, operator):
    return next(each for each in model.graph.node if each.op_type == operator)


def weights(model, name):
    return next(each for each in model.graph.initializer if each.name == name)


def too_few_inputs(model):
    """OpenVINO ended the process."""
    del node(model, "Conv").input[1:]


def too_few_inputs_elsewhere(model):
    node(model, "Relu").op_type = "Pad"


def an_endless_version(model):
    """OpenVINO did not end."""
    model.opset_import[0].version = 10**9


def text_as_input(model):
    """OpenVINO ended the process."""
    model.graph.input[0].type.tensor_type.elem_type = onnx.TensorProto.STRING


def unsigned_input(model):
    model.graph.input[0].type.tensor_type.elem_type = onnx.TensorProto.UINT32


def a_huge_input(model):
    model.graph.input[0].type.tensor_type.shape.dim[2].dim_value = 10**6


def a_negative_input(model):
    model.graph.input[0].type.tensor_type.shape.dim[2].dim_value = -(2**31)


def a_huge_shape(model):
    weights(model, "shape").raw_data = np.array([1, 2**31, -1], np.int64).tobytes()


def a_stride_of_zero(model):
    next(each for each in node(model, "Conv").attribute if each.name == "strides").ints[0] = 0


def a_huge_group(model):
    next(each for each in node(model, "Conv").attribute if each.name == "group").i = 2**40


def data_elsewhere(model):
    entry = weights(model, "w").external_data.add()
    entry.key, entry.value = "location", "../../etc/passwd"
    weights(model, "w").data_location = onnx.TensorProto.EXTERNAL


def a_shape_without_data(model):
    weights(model, "w").dims[0] = 2**40


def a_subgraph(model):
    attribute = node(model, "Relu").attribute.add()
    attribute.name, attribute.type = "body", onnx.AttributeProto.GRAPH
    attribute.g.name = "inner"


def a_loop(model):
    node(model, "Relu").op_type = "Loop"


def a_foreign_operator(model):
    node(model, "Relu").domain = "com.example"


def a_function(model):
    model.functions.add().name = "f"


def an_unknown_input(model):
    node(model, "Relu").input[0] = "nothing"


def a_later_input(model):
    node(model, "Relu").input[0] = "product"


def an_unknown_output(model):
    model.graph.output[0].name = "nothing"


DAMAGES = [
    *(too_few_inputs, too_few_inputs_elsewhere, an_endless_version, text_as_input, unsigned_input),
    *(a_huge_input, a_negative_input, a_huge_shape, a_stride_of_zero, a_huge_group, data_elsewhere),
    *(a_shape_without_data, a_subgraph, a_loop, a_foreign_operator, a_function, an_unknown_input),
    *(a_later_input, an_unknown_output),
]


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_what_is_declared_is_checked(tmp_path, damage):
    model = onnx.ModelProto.FromString(small_network())
    damage(model)
    path = tmp_path / "network.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(WeightsError) as caught:
        check_onnx(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(path))


@pytest.mark.parametrize("length", [1, 40, 300, -1])
def test_truncated_files(tmp_path, length):
    path = tmp_path / "network.onnx"
    path.write_bytes(small_network()[:length])
    with pytest.raises(WeightsError, match="cannot be read"):
        check_onnx(path)


def test_names_that_are_not_text(tmp_path):
    """ONNX Runtime raised `UnicodeDecodeError` and printed several lines."""
    path = tmp_path / "network.onnx"
    path.write_bytes(small_network().replace(b"clipped", b"clipp\xf5d"))
    with pytest.raises(WeightsError, match="damaged"):
        check_onnx(path)


def test_a_sparse_file_is_not_read(tmp_path):
    path = tmp_path / "network.onnx"
    path.write_bytes(small_network())
    os.truncate(path, 2**33)
    with pytest.raises(WeightsError, match=f"{2**33} bytes"):
        check_onnx(path)


@pytest.mark.parametrize("runtime", RUNTIMES)
@pytest.mark.parametrize("opset", [9, 17])
def test_networks_of_old_and_new_operators_run(tmp_path, runtime, opset):
    pytest.importorskip(runtime)
    path = tmp_path / "network.onnx"
    path.write_bytes(small_network(opset=opset))
    network = load_network(path, runtime=runtime)
    product, _ = network(np.ones((1, 3, 8, 8), np.float32))
    assert product.shape == (1, 16, 16)
    with pytest.raises(WeightsError, match="cannot be run on these inputs"):
        network(np.ones((1, 3, 8, 9), np.float32))


@pytest.mark.parametrize("runtime", RUNTIMES)
def test_inputs_without_a_fixed_shape(tmp_path, runtime):
    pytest.importorskip(runtime)
    model = onnx.ModelProto.FromString(small_network())
    model.graph.input[0].type.tensor_type.shape.dim[2].dim_param = "n"
    path = tmp_path / "network.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(WeightsError, match="without a fixed shape"):
        load_network(path, runtime=runtime)


def exported(folder, names, search=None):
    """An exported folder of small networks."""
    folder.mkdir()
    for name in names:
        (folder / f"{name}.onnx").write_bytes(small_network(kernel=name == "search"))
    if search is not None:
        (folder / "search.onnx").write_bytes(search)
    values = {"name": "lite", "network": "lite2", "sha256": "0" * 64, "pieces": list(names)}
    (folder / "network.json").write_text(json.dumps(values))
    return folder


def test_pieces_that_are_missing_or_do_not_fit(tmp_path):
    load = RuntimeOptions()
    with pytest.raises(WeightsError, match=r"holds no search\.onnx by its network\.json"):
        load_pieces(exported(tmp_path / "a", ["template"]), "lite2", load)
    with pytest.raises(WeightsError, match=r"holds no template\.onnx"):
        load_pieces(exported(tmp_path / "b", []), "lite2", load)
    other = exported(tmp_path / "c", ["template", "search"], search=small_network())
    with pytest.raises(WeightsError, match="pieces of different networks"):
        load_pieces(other, "lite2", load)


def test_a_network_of_other_shapes_is_not_lite(tmp_path):
    folder = exported(tmp_path / "a", ["template", "search"])
    with pytest.raises(WeightsError, match="another network than lite"):
        LiteNetworks.load(folder, RuntimeOptions())
    check_onnx(SHIPPED / "search.onnx")
    LiteNetworks.load(SHIPPED, RuntimeOptions())
