"""A small ONNX network."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import helper, numpy_helper


def small_network(*, opset: int = 17, kernel: bool = False) -> bytes:
    """A network with the operators of the shipped ones, of which each runtime needs a millisecond.

    With `kernel` it also takes what the one without it gives.
    """
    random = np.random.default_rng(0)
    weights = {
        "w": random.normal(size=(4, 3, 3, 3)).astype(np.float32),
        "b": np.zeros(4, np.float32),
        "low": np.array(0, np.float32),
        "high": np.array(6, np.float32),
        "shape": np.array([1, 4, -1], np.int64),
        "start": np.array([0, 0], np.int64),
        "stop": np.array([1, 2], np.int64),
    }
    limits = ["low", "high"] if opset > 10 else []
    between = {"starts": [0, 0], "ends": [1, 2]} if opset < 10 else {}
    numbers = ["start", "stop"] if opset >= 10 else []
    convolution = {"kernel_shape": [3, 3], "strides": [2, 2], "pads": [1] * 4, "group": 1}
    nodes = [
        helper.make_node("Conv", ["x", "w", "b"], ["a"], **convolution),
        helper.make_node("Clip", ["a", *limits], ["clipped"]),
        helper.make_node("Relu", ["clipped"], ["positive"]),
        helper.make_node("Reshape", ["positive", "shape"], ["flat"]),
        helper.make_node("Transpose", ["flat"], ["turned"], perm=[0, 2, 1]),
        helper.make_node("MatMul", ["turned", "flat"], ["product"]),
        helper.make_node("Slice", ["positive", *numbers], ["part"], **between),
        helper.make_node("Concat", ["part", "positive"], ["y"], axis=1),
    ]
    inputs, outputs = {"x": (1, 3, 8, 8)}, {"product": (1, 16, 16), "y": (1, 6, 4, 4)}
    if kernel:
        nodes += [
            helper.make_node("Add", [name, f"given {name}"], [f"sum {name}"]) for name in outputs
        ]
        inputs |= {f"given {name}": shape for name, shape in outputs.items()}
        outputs = {f"sum {name}": shape for name, shape in outputs.items()}
    graph = helper.make_graph(
        nodes,
        "small",
        [helper.make_tensor_value_info(name, 1, shape) for name, shape in inputs.items()],
        [helper.make_tensor_value_info(name, 1, shape) for name, shape in outputs.items()],
        [numpy_helper.from_array(value, name) for name, value in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)])
    model.ir_version = 8
    inferred = onnx.shape_inference.infer_shapes(model, strict_mode=True)
    return bytes(inferred.SerializeToString())
