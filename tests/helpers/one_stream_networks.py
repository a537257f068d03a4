"""Small ONNX networks with the inputs and outputs of one-stream trackers, which find bright pixels.

Each finds the mean position of the pixels of the search crop that are brighter than their mean.
"""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CELLS = 16
SHARE = 0.25  # width and height of every box, in those of the search crop

TOML = {
    "ostrack": 'network = "net.onnx"\n',
    "mixformer": (
        'network = "net.onnx"\n'
        'inputs = ["template", "recent_template", "search"]\n'
        'outputs = ["box", "score"]\nscore_is_logit = true\n'
        "template_side = 112\nsearch_side = 224\nsearch_factor = 4\nrecent_interval = 2\n"
    ),
    "hit": 'network = "net.onnx"\noutputs = ["box"]\nbox = "xyxy"\nbox_in = "pixels"\n',
    "sutrack": (
        'network = "net.onnx"\ninputs = ["template", "search", "template_box"]\ncopies = 2\n'
        "template_side = 112\nsearch_side = 224\n"
        'outputs = ["unused", "score_map", "size_map", "offset_map"]\n'
    ),
}
INPUTS = {
    "ostrack": {"template": (1, 3, 128, 128), "search": (1, 3, 256, 256)},
    "mixformer": {
        "template": (1, 3, 112, 112),
        "online_template": (1, 3, 112, 112),
        "search": (1, 3, 224, 224),
    },
    "hit": {"template": (1, 3, 128, 128), "search": (1, 3, 256, 256)},
    "sutrack": {
        "template": (1, 6, 112, 112),
        "search": (1, 6, 224, 224),
        "template_anno": (1, 4),
    },
}


def constant(name, values):
    return numpy_helper.from_array(np.array(values, np.float32), name)


def network(kind):
    """The model of one kind."""
    inputs = INPUTS[kind]
    side = inputs["search"][-1]
    cell = side // CELLS
    zero = [helper.make_node("ReduceMean", [name], [f"{name}_mean"]) for name in inputs]
    nodes = [
        *zero,
        helper.make_node("Sum", [f"{name}_mean" for name in inputs], ["all"]),
        helper.make_node("Mul", ["all", "zero"], ["nothing"]),  # every input is used
        helper.make_node("ReduceMean", ["search"], ["gray"], axes=[1], keepdims=1),
        helper.make_node("Relu", ["gray"], ["bright"]),
        helper.make_node(
            "AveragePool",
            ["bright"],
            ["cells"],
            kernel_shape=[5 * cell] * 2,  # larger than a target: it has one peak
            strides=[cell] * 2,
            pads=[2 * cell] * 4,
            count_include_pad=1,
        ),
    ]
    constants = [constant("zero", 0.0)]
    if kind in ("ostrack", "sutrack"):
        nodes += [
            helper.make_node("Mul", ["cells", "third"], ["scaled"]),
            helper.make_node("Add", ["scaled", "nothing"], ["score_map"]),
            helper.make_node("Add", ["sizes", "nothing"], ["size_map"]),
            helper.make_node("Add", ["halves", "nothing"], ["offset_map"]),
        ]
        constants += [
            constant("third", 1 / 3),
            constant("sizes", np.full((1, 2, CELLS, CELLS), SHARE)),
            constant("halves", np.full((1, 2, CELLS, CELLS), 0.5)),
        ]
        outputs = {"score_map": 1, "size_map": 2, "offset_map": 2}
        shapes = {name: (1, count, CELLS, CELLS) for name, count in outputs.items()}
        if kind == "sutrack":
            shapes = {"task": (1, 1, 1, 1), **shapes}
            nodes.append(helper.make_node("Reshape", ["nothing", "four"], ["task"]))
            constants.append(numpy_helper.from_array(np.array([1, 1, 1, 1], np.int64), "four"))
    else:
        unit, edge = (1.0, SHARE / 2) if kind == "mixformer" else (side, side * SHARE / 2)
        centers = (np.arange(CELLS) + 0.5) / CELLS * unit
        x, y = (grid.ravel() for grid in np.meshgrid(centers, centers))
        columns = [x, y, 0 * x, 0 * y] if kind == "mixformer" else [x, y, x, y]
        wh = [0, 0, SHARE, SHARE] if kind == "mixformer" else [-edge, -edge, edge, edge]
        nodes += [
            helper.make_node("Reshape", ["cells", "flat"], ["row"]),
            helper.make_node("Add", ["row", "tiny"], ["positive"]),
            helper.make_node("ReduceSum", ["positive"], ["total"], keepdims=1),
            helper.make_node("Div", ["positive", "total"], ["weights"]),
            helper.make_node("MatMul", ["weights", "grid"], ["centers"]),
            helper.make_node("Add", ["centers", "wh"], ["plain"]),
            helper.make_node("Add", ["plain", "nothing"], ["moved"]),
            helper.make_node("Reshape", ["moved", "box_shape"], ["pred_boxes"]),
        ]
        constants += [
            numpy_helper.from_array(np.array([1, CELLS * CELLS], np.int64), "flat"),
            numpy_helper.from_array(np.array([1, 1, 4], np.int64), "box_shape"),
            constant("tiny", 1e-6),
            constant("grid", np.stack(columns, axis=1)),
            constant("wh", [wh]),
        ]
        shapes = {"pred_boxes": (1, 1, 4)}
        if kind == "mixformer":
            nodes += [
                helper.make_node("Add", ["nothing", "two"], ["logit"]),
                helper.make_node("Reshape", ["logit", "one"], ["pred_scores"]),
            ]
            constants += [constant("two", 2.0)]
            constants.append(numpy_helper.from_array(np.array([1], np.int64), "one"))
            shapes["pred_scores"] = (1,)
    graph = helper.make_graph(
        nodes,
        kind,
        [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
            for name, shape in inputs.items()
        ],
        [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
            for name, shape in shapes.items()
        ],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    return model


def write_one_stream(folder, kind):
    """Write a network and its description; the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    onnx.save(network(kind), folder / "net.onnx")
    (folder / "tracker.toml").write_text(TOML[kind])
    return folder
