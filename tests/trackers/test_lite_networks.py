"""The networks of the first `lite`: how they are loaded, and what is refused."""

import pytest

from helpers.stub_networks import Stub
from ssiam.errors import ArgumentError
from ssiam.runtime import RuntimeOptions, loading
from ssiam.trackers.lite import LiteNetworks


def test_the_networks_are_the_pieces_of_the_weights(monkeypatch, tmp_path):
    pieces, calls = {name: Stub(None) for name in ("template", "search")}, []

    def load(*arguments):
        calls.append(arguments)
        return pieces

    monkeypatch.setattr(loading, "load_pieces", load)
    options = RuntimeOptions("onnxruntime", 2)
    assert vars(LiteNetworks.load(tmp_path, options)) == pieces
    assert calls == [(tmp_path, "lite", options)]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            RuntimeOptions("torch"),
            "tracker lite is in ONNX: choose runtime openvino or onnxruntime",
        ),
        (
            RuntimeOptions(precision="int8"),
            "tracker lite has no int8 weights: leave precision out",
        ),
    ],
)
def test_pytorch_and_int8_are_refused(tmp_path, options, message):
    with pytest.raises(ArgumentError) as caught:
        LiteNetworks.load(tmp_path, options)
    assert str(caught.value) == message
