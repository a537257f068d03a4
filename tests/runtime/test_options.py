"""RuntimeOptions: unsupported combinations, defaults, and missing packages."""

import subprocess
import sys

import pytest

from ssiam.errors import ArgumentError, WeightsError
from ssiam.runtime import RuntimeOptions, load_network


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param({"runtime": "magic"}, "unknown runtime 'magic'", id="runtime"),
        pytest.param({"precision": "f64"}, "unknown precision 'f64'", id="precision"),
        pytest.param({"threads": 0}, "threads is 0", id="threads"),
        pytest.param(
            {"runtime": "openvino", "device": "cuda"},
            "openvino has no device 'cuda': choose from cpu",
            id="device",
        ),
        pytest.param(
            {"runtime": "onnxruntime", "precision": "bf16"},
            "onnxruntime has no precision 'bf16': choose from f32, int8",
            id="precision of another runtime",
        ),
        pytest.param(
            {"runtime": "torch", "precision": "f16"}, "f16 needs device cuda or mps", id="f16"
        ),
    ],
)
def test_unsupported_options_are_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        RuntimeOptions(**arguments)


def test_the_default_device_is_the_cpu():
    assert RuntimeOptions().resolved_device == "cpu"
    cuda = RuntimeOptions("torch", precision="f16", device="cuda")
    assert cuda.resolved_device == "cuda"


def test_pytorch_does_not_run_onnx(tmp_path):
    with pytest.raises(WeightsError, match="choose runtime openvino or onnxruntime"):
        load_network(tmp_path / "x.onnx", runtime="torch")


@pytest.mark.parametrize(
    ("package", "code", "extra"),
    [
        ("onnxruntime", "load_network(Path('x.onnx'), runtime='onnxruntime')", "onnxruntime"),
        ("onnx", "load_network(Path('x.onnx'), runtime='onnxruntime')", "onnxruntime"),
        ("torch", "load_pieces(Path('x.pth'), 'siamfc', RuntimeOptions('torch'))", "torch"),
        ("torch", "load_pieces(Path('x.pth'), 'siamfc', RuntimeOptions('openvino'))", "torch"),
    ],
)
def test_a_missing_extra_is_named(tmp_path, package, code, extra):
    for name in ("x.onnx", "x.pth"):
        (tmp_path / name).write_bytes(b"\x08")
    program = (
        f"import sys; sys.modules[{package!r}] = None\n"
        "from pathlib import Path\n"
        "from ssiam import MissingExtraError\n"
        "from ssiam.runtime import RuntimeOptions, load_network, load_pieces\n"
        f"try:\n    {code}\nexcept MissingExtraError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert f"pip install 'ssiam[{extra}]'" in done.stdout, done.stderr
    assert done.stdout.count("\n") == 1
