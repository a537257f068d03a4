"""Int8 networks: which convolutions are quantized, and from which opsets."""

from __future__ import annotations

import numpy as np
import pytest

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402

from ssiam.runtime import load_network  # noqa: E402
from ssiam.runtime.quantization import quantize  # noqa: E402

SHAPE = (1, 8, 16, 16)


def write_chain(path, kinds, opset=17):
    """A chain of convolutions and ReLUs; kinds are "pointwise", "depthwise" and "head"."""
    random = np.random.default_rng(0)
    nodes, weights, last = [], [], "x"
    for i, kind in enumerate(kinds):
        group = 8 if kind == "depthwise" else 1
        weight = random.normal(0, 0.4, (8, 8 // group, 1, 1)).astype(np.float32)
        weights.append(numpy_helper.from_array(weight, f"w{i}"))
        name = f"/head/{i}" if kind == "head" else f"{kind}{i}"
        nodes.append(helper.make_node("Conv", [last, f"w{i}"], [f"c{i}"], name=name, group=group))
        nodes.append(helper.make_node("Relu", [f"c{i}"], [f"r{i}"], name=f"relu{i}"))
        last = f"r{i}"
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, SHAPE) for n in ("x", last)]
    graph = helper.make_graph(nodes, "chain", ends[:1], ends[1:], weights)
    ids = [helper.make_opsetid("", opset)]
    onnx.save(helper.make_model(graph, opset_imports=ids, ir_version=6), path)
    return path


def feeds(count=4):
    random = np.random.default_rng(1)
    return [[random.normal(size=SHAPE).astype(np.float32)] for _ in range(count)]


def quantized_parts(path):
    """Names of the convolutions with int8 weights, and of the quantized activations."""
    graph = onnx.load(path).graph
    dequantized = {
        out for node in graph.node if node.op_type == "DequantizeLinear" for out in node.output
    }
    convolutions = [n.name for n in graph.node if n.op_type == "Conv" and n.input[1] in dequantized]
    tensors = [node.input[0] for node in graph.node if node.op_type == "QuantizeLinear"]
    return convolutions, tensors


def test_depthwise_convolutions_and_outputs_of_convolutions_stay_in_f32(tmp_path):
    source = write_chain(tmp_path / "f32.onnx", ["pointwise", "depthwise", "pointwise", "head"])
    quantize(source, tmp_path / "int8.onnx", feeds())
    convolutions, tensors = quantized_parts(tmp_path / "int8.onnx")
    assert convolutions == ["pointwise0", "pointwise2"]
    assert set(tensors) == {"x", "r1"}


def test_outputs_are_quantized_in_networks_without_depthwise_convolutions(tmp_path):
    source = write_chain(tmp_path / "f32.onnx", ["pointwise", "pointwise", "head"])
    quantize(source, tmp_path / "int8.onnx", feeds())
    convolutions, tensors = quantized_parts(tmp_path / "int8.onnx")
    assert convolutions == ["pointwise0", "pointwise1"]
    assert {"c0", "c1"} <= set(tensors)


@pytest.mark.parametrize("opset", [9, 12, 13])
@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_files_of_old_opsets_are_converted(tmp_path, opset, runtime):
    source = write_chain(tmp_path / "f32.onnx", ["pointwise", "depthwise", "pointwise"], opset)
    quantize(source, tmp_path / "int8.onnx", feeds())
    (feed,) = feeds(1)
    (exact,) = load_network(source, runtime=runtime)(*feed)
    (quantized,) = load_network(tmp_path / "int8.onnx", runtime=runtime, precision="int8")(*feed)
    assert 1e-4 < np.abs(quantized - exact).mean() / np.abs(exact).mean() < 0.03
