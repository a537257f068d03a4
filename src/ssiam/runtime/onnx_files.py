"""What an ONNX file declares, checked before a runtime's native code reads it.

OpenVINO, ONNX Runtime and onnx believe a file: an operator with too few inputs ends the process
(OpenVINO 2026.2 reads beyond the list), a version of operators of 10⁹ keeps it busy without end, a
dimension of 10⁶ takes gigabytes, and data beside the file is read from wherever it says. The fields
are those of onnx.proto (onnx.ai), in protobuf's encoding.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from ssiam.errors import WeightsError

__all__ = ["check_onnx", "check_shape"]

_MAX_BYTES: Final = 2**31  # of a file: protobuf reads no larger one
_MAX_ELEMENTS: Final = 2**24  # of one array in the network; a search crop of 255x255 has 2**18
_MIN_OPSET, _MAX_OPSET = 7, 30  # versions of the operators; published networks have 9 to 17
_MAX_EXTENT: Final = 2**16  # of kernels, strides, dilations, pads and groups
_AT_LEAST_ONE: Final = frozenset({"kernel_shape", "strides", "dilations", "group"})
_NOT_NEGATIVE: Final = frozenset({"pads", "output_padding", "output_shape"})
_FLOAT32, _INT64 = 1, 7
# Bits of an element of each type of `TensorProto.DataType` that networks may have: floats (1, 10,
# 11), whole numbers (2, 3, 6, 7) and truth values (9). Some of the others end the process.
_BITS: Final = {_FLOAT32: 32, 10: 16, 11: 64, 2: 8, 3: 8, 6: 32, _INT64: 64, 9: 8}
# The operators that networks may have, by the least number of their inputs (onnx.ai, Operators).
_OPERATORS: Final = {
    "Constant": 0,
    **dict.fromkeys(
        (
            *("Abs", "ArgMax", "ArgMin", "AveragePool", "Cast", "Ceil", "Celu", "Clip", "Concat"),
            *("ConstantOfShape", "Cos", "DepthToSpace", "Dropout", "Elu", "Erf", "Exp", "Flatten"),
            *("Floor", "Gelu", "GlobalAveragePool", "GlobalMaxPool", "HardSigmoid", "HardSwish"),
            *("Identity", "LRN", "LeakyRelu", "Log", "LogSoftmax", "LpNormalization", "Max"),
            *("MaxPool", "Mean", "Min", "Mish", "Neg", "Not", "Pad", "Reciprocal", "ReduceL1"),
            *(
                "ReduceL2",
                "ReduceMax",
                "ReduceMean",
                "ReduceMin",
                "ReduceProd",
                "ReduceSum",
                "Relu",
            ),
            *("Resize", "Round", "Selu", "Shape", "Sigmoid", "Sign", "Sin", "Size", "Slice"),
            *("Softmax", "Softplus", "Softsign", "SpaceToDepth", "Split", "Sqrt", "Squeeze", "Sum"),
            *("Tan", "Tanh", "TopK", "Transpose", "Trilu", "Unsqueeze"),
        ),
        1,
    ),
    **dict.fromkeys(
        (
            *("Add", "And", "Conv", "ConvInteger", "ConvTranspose", "CumSum", "DequantizeLinear"),
            *("Div", "Equal", "Expand", "Gather", "GatherElements", "GatherND", "Gemm", "Greater"),
            *("GreaterOrEqual", "GridSample", "LayerNormalization", "Less", "LessOrEqual"),
            *("MatMul", "MatMulInteger", "Mod", "Mul", "Or", "PRelu", "Pow", "QuantizeLinear"),
            *("Reshape", "Sub", "Tile", "Upsample", "Xor"),
        ),
        2,
    ),
    **dict.fromkeys(("GroupNormalization", "InstanceNormalization", "Range", "Where"), 3),
    "BatchNormalization": 5,
    **dict.fromkeys(("QLinearConv", "QLinearMatMul"), 8),
}
# Operators whose attributes became inputs: the version, and the least number of inputs from then on
_MORE_INPUTS: Final = {"Pad": (11, 2), "Slice": (10, 3), "TopK": (10, 2), "Unsqueeze": (13, 2)}
# Operators with the shape of their output, or what is added to it, in an input
_SIZES: Final = {"ConstantOfShape": 0, "Expand": 1, "Pad": 1, "Reshape": 1, "Resize": 3, "Tile": 1}
_DOMAINS: Final = ("", "ai.onnx")  # of the operators above
_MAX_NAME: Final = 40  # characters of a name in a message
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5  # protobuf's wire types
_MAX_SHAPE: Final = 32  # numbers of a shape, or of pads: two for each of its dimensions
_CONTINUED: Final = bytes(range(128, 256))  # the bytes of a varint but the last one


class _Field(NamedTuple):
    """A field of a message: its number, and its value or its bytes."""

    number: int
    value: int
    data: memoryview | None


def check_onnx(path: Path) -> None:
    """Check an ONNX file, without a runtime.

    Raises
    ------
    WeightsError
        The file is missing, not ONNX, damaged, or declares what no network of a tracker has: data
        outside of the file, subgraphs, functions, or sizes out of all bounds.
    """
    if not path.is_file():
        raise WeightsError(f"weights {path} do not exist: give the path of an .onnx file")
    try:
        with path.open("rb") as file:
            start = file.read(64).lstrip()
            _check_start(path, start)
            size = path.stat().st_size
            if size >= _MAX_BYTES:
                raise WeightsError(f"weights {path} have {size} bytes, more than ONNX allows")
            file.seek(0)
            data = file.read(_MAX_BYTES)
    except OSError as error:
        raise WeightsError(f"weights {path} cannot be read: {error.strerror}") from error
    try:
        _check_model(memoryview(data))
    except (IndexError, UnicodeDecodeError):
        raise WeightsError(
            f"weights {path} cannot be read: the file is damaged or cut short ({size} bytes); "
            "download it again"
        ) from None
    except ValueError as error:
        raise WeightsError(f"weights {path} cannot be read: {error}; download them again") from None


def _check_start(path: Path, start: bytes) -> None:
    if start.startswith(b"<"):
        raise WeightsError(
            f"weights {path} are a web page (they start with {start[:14]!r}), "
            "not a network: download the file itself"
        )
    # An ONNX file starts with its ir_version: protobuf field 1, a varint.
    if not start.startswith(b"\x08"):
        raise WeightsError(f"weights {path} are not an ONNX file (they start with {start[:8]!r})")


def _check_model(data: memoryview) -> None:
    """Raise `ValueError` for what is declared, `IndexError` if the encoding is damaged."""
    graphs, versions = [], []
    for field in _fields(data):
        if field.number == 7:
            graphs.append(_bytes(field))
        elif field.number == 8:
            versions.append(_opset(_bytes(field)))
        elif field.number in (20, 25):
            raise ValueError("it has functions or training graphs")
    if len(graphs) != 1:
        raise ValueError(f"it has {len(graphs)} graphs")
    own = [version for domain, version in versions if domain in _DOMAINS]
    if len(own) != 1 or not _MIN_OPSET <= own[0] <= _MAX_OPSET:
        raise ValueError(f"it needs version {own} of the operators")
    if any(not 0 < version < _MAX_OPSET for _, version in versions):
        raise ValueError(f"it needs versions {versions[:4]} of operators")
    _check_graph(graphs[0], own[0])


def _opset(data: memoryview) -> tuple[str, int]:
    """Name of a set of operators, and its version."""
    domain, version = "", 0
    for field in _fields(data):
        if field.number == 1:
            domain = _text(field)
        elif field.number == 2:
            version = field.value
    return domain, version


def _check_graph(data: memoryview, opset: int) -> None:
    known: dict[str, list[int] | None] = {"": None}  # names, and the numbers of constants
    nodes, inputs, outputs = [], [], []
    for field in _fields(data):
        if field.number == 1:
            nodes.append(_bytes(field))
        elif field.number == 2:
            _text(field)
        elif field.number == 5:
            name, numbers = _check_tensor(_bytes(field))
            known[name] = numbers
        elif field.number == 11:
            inputs.append(_check_value(_bytes(field)))
        elif field.number == 12:
            outputs.append(_check_value(_bytes(field))[0])
        elif field.number == 13:
            _check_value(_bytes(field))
        elif field.number == 15:
            raise ValueError("it has sparse weights")
    for name, kind in inputs:
        if name not in known and kind != _FLOAT32:  # older files list the weights too
            raise ValueError(f"its input {name[:_MAX_NAME]!r} has the type {kind}")
        known.setdefault(name)
    for node in nodes:
        known.update(_check_node(node, known, opset))
    missing = [name for name in outputs if not name or name not in known]
    if missing or not outputs:
        raise ValueError(f"it has no output {missing[0][:_MAX_NAME]!r}" if missing else "no output")


def _check_node(
    data: memoryview, known: Mapping[str, list[int] | None], opset: int
) -> dict[str, list[int] | None]:
    """Check an operator whose inputs must be `known`; return its outputs, as `known`."""
    inputs, outputs, operator, domain = [], [], "", ""
    constant: list[int] | None = None
    for field in _fields(data):
        if field.number == 1:
            inputs.append(_text(field))
        elif field.number == 2:
            outputs.append(_text(field))
        elif field.number == 3:
            _text(field)
        elif field.number == 4:
            operator = _text(field)
        elif field.number == 5:
            constant = _check_attribute(_bytes(field))
        elif field.number == 7:
            domain = _text(field)
    if operator not in _OPERATORS or domain not in _DOMAINS:
        raise ValueError(f"it has the operator {operator[:_MAX_NAME]!r}")
    since, least = _MORE_INPUTS.get(operator, (0, 0))
    least = least if least and opset >= since else _OPERATORS[operator]
    if len(inputs) < least or "" in inputs[:least] or not outputs or not outputs[0]:
        raise ValueError(f"its operator {operator} has too few inputs or outputs")
    unknown = [name for name in inputs if name not in known]
    if unknown:
        raise ValueError(f"its operator {operator} has no input {unknown[0][:_MAX_NAME]!r}")
    position = _SIZES.get(operator, len(inputs))
    sizes = known[inputs[position]] if position < len(inputs) else None
    if sizes is not None:
        _check_sizes(operator, sizes)
    return dict.fromkeys(outputs, constant if operator == "Constant" else None)


def _check_sizes(operator: str, sizes: list[int]) -> None:
    """Check the constant from which an operator takes the shape of its output."""
    low = -1 if operator == "Reshape" else 0
    high = _MAX_EXTENT if operator in ("Pad", "Tile") else _MAX_ELEMENTS
    too_many = operator != "Pad" and abs(math.prod(sizes)) > _MAX_ELEMENTS
    if too_many or any(not low <= size <= high for size in sizes):
        raise ValueError(f"its operator {operator} has the sizes {sizes[:8]}")


def _check_attribute(data: memoryview) -> list[int] | None:
    """Check an attribute; return the numbers of a small tensor, as `_check_tensor`."""
    name, numbers = "", list[int]()
    constant: list[int] | None = None
    for field in _fields(data):
        if field.number == 1:
            name = _text(field)
        elif field.number in (3, 8):
            numbers += _integers(field)
        elif field.number in (5, 10):
            _, constant = _check_tensor(_bytes(field))
        elif field.number in (6, 11, 22, 23):
            raise ValueError("it has subgraphs or sparse weights")
    if name == "to" and any(number not in _BITS for number in numbers):
        raise ValueError(f"it casts to type {numbers[0]}")
    low = 1 if name in _AT_LEAST_ONE else 0 if name in _NOT_NEGATIVE else None
    if low is not None:
        wrong = [number for number in numbers if not low <= number <= _MAX_EXTENT]
        if wrong:
            raise ValueError(f"{name} is {wrong[0]}")
    return constant


def _check_tensor(data: memoryview) -> tuple[str, list[int] | None]:
    """Check that a tensor is in the file, as long as its shape says.

    Returns its name and, if it may be a shape, its numbers: whole ones, and not many.
    """
    name, shape, numbers = "", list[int](), list[int]()
    kind, raw, count = 0, None, 0
    for field in _fields(data):
        if field.number == 1:
            shape += _integers(field)
        elif field.number == 2:
            kind = field.value
        elif field.number == 9:
            raw = _bytes(field)
        elif field.number in (4, 10):
            width = 4 if field.number == 4 else 8
            count += 1 if field.data is None else len(field.data) // width
        elif field.number in (5, 7, 11):
            count += 1 if field.data is None else _varint_count(field.data)
            if field.number == 7 and count <= _MAX_SHAPE:
                numbers += _integers(field)
        elif field.number == 8:
            name = _text(field)
        elif field.number == 13 or (field.number == 14 and field.value):
            raise ValueError("its weights are in another file")
    if kind not in _BITS:
        raise ValueError(f"it has weights of type {kind}")
    if any(length < 0 for length in shape):
        raise ValueError(f"it has weights of shape {shape[:8]}")
    elements = math.prod(shape)
    given = count if raw is None else len(raw) * 8 // _BITS[kind]
    if (raw is not None and count) or given != elements:
        raise ValueError(f"it has weights of shape {shape[:8]} with other data")
    if kind != _INT64 or elements > _MAX_SHAPE:
        return name, None
    return name, numbers if raw is None else list(struct.unpack(f"<{elements}q", raw))


def _check_value(data: memoryview) -> tuple[str, int]:
    """Check the declared shape of an input, an output or an array between them.

    Returns its name and type.
    """
    name, element = "", 0
    for field in _fields(data):
        if field.number == 1:
            name = _text(field)
        elif field.number == 2:
            for kind in _fields(_bytes(field)):
                if kind.number != 1:
                    raise ValueError("it has values that are no arrays")
                element, lengths = _declared_array(_bytes(kind))
                check_shape(lengths)
    return name, element


def check_shape(lengths: Sequence[int]) -> None:
    """Raise `ValueError` if an array of a network has a negative length or too many elements."""
    if any(length < 0 for length in lengths) or math.prod(lengths) > _MAX_ELEMENTS:
        raise ValueError(f"it has an array of shape {list(lengths[:8])}")


def _declared_array(tensor_type: memoryview) -> tuple[int, list[int]]:
    """Type and known lengths of a `TypeProto.Tensor`; the other lengths have a name."""
    element, lengths = 0, []
    for field in _fields(tensor_type):
        element = field.value if field.number == 1 else element
    if element not in _BITS:
        raise ValueError(f"it has an array of type {element}")
    for shape in (_bytes(each) for each in _fields(tensor_type) if each.number == 2):
        for dimension in (_bytes(each) for each in _fields(shape) if each.number == 1):
            for field in _fields(dimension):
                if field.number == 1:
                    lengths.append(field.value)
                elif field.number == 2:
                    _text(field)
    return element, lengths


def _fields(data: memoryview) -> Iterator[_Field]:
    """The fields of a message; `IndexError` if it is not one."""
    position, end = 0, len(data)
    while position < end:
        key, position = _varint(data, position)
        number, wire = key >> 3, key & 7
        if wire == _VARINT:
            value, position = _varint(data, position)
            yield _Field(number, _signed(value), None)
            continue
        if wire == _BYTES:
            length, position = _varint(data, position)
        elif wire in (_FIXED32, _FIXED64):
            length = 4 if wire == _FIXED32 else 8
        else:
            raise IndexError
        if number == 0 or length > end - position:
            raise IndexError
        part = data[position : position + length]
        position += length
        yield _Field(number, 0, part if wire == _BYTES else None)


def _varint(data: memoryview, position: int) -> tuple[int, int]:
    value = shift = 0
    while shift < 70:
        byte = data[position]
        position += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, position
        shift += 7
    raise IndexError


def _signed(value: int) -> int:
    """A varint as a signed number of 64 bits."""
    value &= 2**64 - 1
    return value - 2**64 if value >= 2**63 else value


def _integers(field: _Field) -> Iterable[int]:
    """The numbers of a repeated field, packed or one of them."""
    if field.data is None:
        return [field.value]
    numbers, position = [], 0
    while position < len(field.data):
        value, position = _varint(field.data, position)
        numbers.append(_signed(value))
    return numbers


def _varint_count(data: memoryview) -> int:
    return len(bytes(data).translate(None, _CONTINUED))


def _bytes(field: _Field) -> memoryview:
    if field.data is None:
        raise IndexError
    return field.data


def _text(field: _Field) -> str:
    return str(_bytes(field), "utf-8")
