"""scripts/mix_weights.py: the mean of two runs is a network that a tracker can load."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from ssiam.networks.checkpoints import read_state_dict  # noqa: E402
from ssiam.runtime import RuntimeOptions  # noqa: E402
from ssiam.trackers.lite import SHIPPED, LiteNetworks  # noqa: E402

SCRIPT = Path(__file__).parents[2] / "scripts" / "mix_weights.py"


def test_weights_are_interpolated_by_the_share(tmp_path):
    first = read_state_dict(SHIPPED / "weights.pth")
    second = {name: each + 1 if each.is_floating_point() else each for name, each in first.items()}
    for name, tensors in (("first", first), ("second", second)):
        (tmp_path / name).mkdir()
        torch.save(tensors, tmp_path / name / "weights.pth")
    command = [sys.executable, SCRIPT, "first", "second", "--share", "0.25", "--out", "mixed"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=300)
    mixed = read_state_dict(tmp_path / "mixed" / "weights.pth")
    assert mixed.keys() == first.keys()
    for name, each in mixed.items():
        expected = first[name] + 0.25 if each.is_floating_point() else first[name]
        torch.testing.assert_close(each, expected)
    template = LiteNetworks.load(tmp_path / "mixed", RuntimeOptions()).template
    kernel, *_ = template(np.zeros((1, 3, 127, 127), np.float32))
    assert kernel.shape == (1, 64, 96)
