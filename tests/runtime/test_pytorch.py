"""PyTorch as a runtime: shapes, precisions and errors."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from helpers.network_models import checkpoint  # noqa: E402
from ssiam.errors import ArgumentError, WeightsError  # noqa: E402
from ssiam.runtime import RuntimeOptions, load_pieces  # noqa: E402

ALEX = "siamrpn_alex_dwxcorr"


def test_shapes_and_types():
    pieces = load_pieces(checkpoint(ALEX), ALEX, RuntimeOptions("torch"))
    kernels = pieces["template"](np.zeros((1, 3, 127, 127), np.float32))
    assert [each.shape for each in kernels] == pieces["template"].output_shapes
    assert pieces["search"].input_shapes == [(1, 3, 287, 287), *[(1, 256, 4, 4)] * 2]
    assert all(each.dtype == np.float32 for each in kernels)
    assert all(each.flags.c_contiguous for each in kernels)


def test_bf16_is_close_to_f32():
    crop = np.random.default_rng(0).integers(0, 256, (1, 3, 127, 127)).astype(np.float32)
    kernels = {}
    for precision in ("f32", "bf16"):
        options = RuntimeOptions("torch", precision=precision)
        kernels[precision] = load_pieces(checkpoint(ALEX), ALEX, options)["template"](crop)
    for exact, rounded in zip(kernels["f32"], kernels["bf16"], strict=True):
        assert 0 < abs(exact - rounded).max() < 0.05 * abs(exact).max()


@pytest.mark.parametrize("device", ["cuda", "mps"])
def test_an_unavailable_device_is_refused(device):
    if torch.cuda.is_available() or torch.backends.mps.is_available():
        pytest.skip("there is a GPU")
    with pytest.raises(ArgumentError, match=f"device {device} is not available in PyTorch"):
        load_pieces(checkpoint(ALEX), ALEX, RuntimeOptions("torch", device=device))


def test_a_folder_with_several_checkpoints_is_refused(tmp_path):
    for name in ("a.pth", "b.pth"):
        (tmp_path / name).symlink_to(checkpoint(ALEX))
    with pytest.raises(WeightsError, match=r"holds 2 \.pth files"):
        load_pieces(tmp_path, ALEX, RuntimeOptions("torch"))
