"""Tests of eight-bit networks: which convolutions are quantised, and from which opset."""

from __future__ import annotations

import numpy as np
import pytest

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402

from ssiam.runtime import load_network  # noqa: E402
from ssiam.runtime.quantization import quantize  # noqa: E402

SHAPE = (1, 8, 16, 16)


def written(path, kinds, opset=17):
    """A chain of convolutions with a ReLU between, each "pointwise", "depthwise" or "head"."""
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


def in_eight_bits(path):
    """Names of the convolutions whose weights come from eight bits, and of what else is quantised.

    The latter are the tensors that are put in eight bits.
    """
    graph = onnx.load(path).graph
    whole = {
        out for node in graph.node if node.op_type == "DequantizeLinear" for out in node.output
    }
    convolutions = [n.name for n in graph.node if n.op_type == "Conv" and n.input[1] in whole]
    tensors = [node.input[0] for node in graph.node if node.op_type == "QuantizeLinear"]
    return convolutions, tensors


def test_depthwise_convolutions_and_what_comes_out_of_others_stay_exact(tmp_path):
    source = written(tmp_path / "f32.onnx", ["pointwise", "depthwise", "pointwise", "head"])
    quantize(source, tmp_path / "int8.onnx", feeds())
    convolutions, tensors = in_eight_bits(tmp_path / "int8.onnx")
    assert convolutions == ["pointwise0", "pointwise2"]
    assert set(tensors) == {"x", "r1"}


def test_without_depthwise_convolutions_what_comes_out_is_in_eight_bits_too(tmp_path):
    source = written(tmp_path / "f32.onnx", ["pointwise", "pointwise", "head"])
    quantize(source, tmp_path / "int8.onnx", feeds())
    convolutions, tensors = in_eight_bits(tmp_path / "int8.onnx")
    assert convolutions == ["pointwise0", "pointwise1"]
    assert {"c0", "c1"} <= set(tensors)


@pytest.mark.parametrize("opset", [9, 12, 13])
@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_old_files_are_raised_and_keep_the_answer(tmp_path, opset, runtime):
    source = written(tmp_path / "f32.onnx", ["pointwise", "depthwise", "pointwise"], opset)
    quantize(source, tmp_path / "int8.onnx", feeds())
    (feed,) = feeds(1)
    (exact,) = load_network(source, runtime=runtime)(*feed)
    (ours,) = load_network(tmp_path / "int8.onnx", runtime=runtime, precision="int8")(*feed)
    assert 1e-4 < np.abs(ours - exact).mean() / np.abs(exact).mean() < 0.03
