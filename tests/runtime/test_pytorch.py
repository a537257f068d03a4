"""PyTorch as a runtime: shapes, and what it does not have."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from helpers.network_models import checkpoint  # noqa: E402
from ssiam.errors import ArgumentError, WeightsError  # noqa: E402
from ssiam.runtime import RuntimeOptions  # noqa: E402
from ssiam.runtime.loading import load_pieces  # noqa: E402

ALEX = "siamrpn_alex_dwxcorr"


def test_shapes_and_kinds():
    pieces = load_pieces(checkpoint(ALEX), ALEX, RuntimeOptions("torch"))
    kernels = pieces["template"](np.zeros((1, 3, 127, 127), np.float32))
    assert [each.shape for each in kernels] == pieces["template"].output_shapes
    assert pieces["search"].input_shapes == [(1, 3, 287, 287), *[(1, 256, 4, 4)] * 2]
    assert all(each.dtype == np.float32 for each in kernels)
    assert all(each.flags.c_contiguous for each in kernels)


def test_bf16_is_near_f32():
    crop = np.random.default_rng(0).integers(0, 256, (1, 3, 127, 127)).astype(np.float32)
    exact, rough = (
        load_pieces(checkpoint(ALEX), ALEX, RuntimeOptions("torch", precision=each))["template"](
            crop
        )
        for each in ("f32", "bf16")
    )
    for a, b in zip(exact, rough, strict=True):
        assert 0 < abs(a - b).max() < 0.05 * abs(a).max()


@pytest.mark.parametrize("device", ["cuda", "mps"])
def test_a_device_that_is_not_there(device):
    if torch.cuda.is_available() or torch.backends.mps.is_available():
        pytest.skip("there is a graphics card")
    with pytest.raises(ArgumentError, match=f"device {device} is not there for PyTorch"):
        load_pieces(checkpoint(ALEX), ALEX, RuntimeOptions("torch", device=device))


def test_a_folder_with_several_checkpoints(tmp_path):
    for name in ("a.pth", "b.pth"):
        (tmp_path / name).symlink_to(checkpoint(ALEX))
    with pytest.raises(WeightsError, match=r"holds 2 \.pth files"):
        load_pieces(tmp_path, ALEX, RuntimeOptions("torch"))
