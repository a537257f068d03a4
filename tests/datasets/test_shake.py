"""`Shake`: statistics of its paths, and invalid values."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from helpers.shake_clips import SIZE, STRENGTH
from ssiam.datasets import SHAKE_KINDS, Shake, camera_path
from ssiam.errors import ArgumentError
from ssiam.geometry import frame_center, local_zoom, rigid_parameters


def shifts_angles_zooms(shake, count, size_wh=SIZE, name=""):
    """(N, 4): dx and dy in widths, angle, log zoom."""
    found = []
    for pose in camera_path(shake, count, size_wh, name):
        dx, dy, angle = rigid_parameters(pose, frame_center(size_wh))
        zoom = local_zoom(pose, frame_center(size_wh))
        found.append((dx / size_wh[0], dy / size_wh[0], angle, np.log(zoom)))
    return np.array(found)


DEGREE = np.deg2rad(1)
DEVIATIONS = [
    # kind, standard deviations of dx and dy in widths, angle, log zoom; at 3 %
    ("white", (0.03, 0.03, DEGREE, 0)),
    ("handheld", (0.03, 0.03, DEGREE, 0)),
    ("vibration", (0.03, 0.03, DEGREE, 0)),
    ("gusts", (0.03, 0.03, DEGREE, 0)),
    ("roll", (0, 0, 0.06, 0)),
    ("zoom", (0, 0, 0, 0.06)),
]


@pytest.mark.parametrize(("kind", "expected"), DEVIATIONS, ids=[row[0] for row in DEVIATIONS])
def test_strength_is_the_standard_deviation(kind, expected):
    found = [shifts_angles_zooms(Shake(STRENGTH, kind, seed), 4000) for seed in range(3)]
    found = np.concatenate(found).std(axis=0)
    assert found == pytest.approx(expected, rel=0.1, abs=1e-9)


@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_a_path_is_reproducible_scales_and_depends_on_seed_and_name(kind):
    path = shifts_angles_zooms(Shake(STRENGTH, kind, 4), 60, name="a")
    assert np.array_equal(path, shifts_angles_zooms(Shake(STRENGTH, kind, 4), 60, name="a"))
    assert 2 * path == pytest.approx(
        shifts_angles_zooms(Shake(2 * STRENGTH, kind, 4), 60, name="a"), abs=1e-9
    )
    assert path[:40] == pytest.approx(
        shifts_angles_zooms(Shake(STRENGTH, kind, 4), 40, name="a"), abs=1e-9
    )
    for other, name in ((Shake(STRENGTH, kind, 5), "a"), (Shake(STRENGTH, kind, 4), "b")):
        assert abs(path - shifts_angles_zooms(other, 60, name=name)).max() > 0.01


def test_a_path_is_the_same_in_another_process():
    """Python's hash of a string is not."""
    code = (
        "from ssiam.datasets import Shake, camera_path;"
        "print(camera_path(Shake(0.03, 'gusts'), 5, (320, 240), 'walk').tobytes().hex())"
    )
    outputs = [
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    ]
    assert outputs[0] == outputs[1]


def test_kinds_differ_in_speed():
    """Steps from frame to frame, in standard deviations of the path."""

    def speed(kind):
        path = shifts_angles_zooms(Shake(STRENGTH, kind), 2000)[:, :2]
        return np.diff(path, axis=0).std() / path.std()

    assert speed("white") == pytest.approx(np.sqrt(2), rel=0.1)
    assert 0.15 < speed("handheld") < 0.35
    assert speed("vibration") > 0.9
    assert 0.3 < speed("gusts") < 0.6


def test_vibration_is_fast_and_handheld_is_slow():
    def share_above(kind, cycles):
        power = abs(np.fft.rfft(shifts_angles_zooms(Shake(STRENGTH, kind), 1024)[:, 0])) ** 2
        return power[np.fft.rfftfreq(1024) > cycles].sum() / power.sum()

    assert share_above("vibration", 0.12) > 0.95
    assert share_above("handheld", 0.12) < 0.1


def test_a_shake_is_a_value():
    shake = Shake(0.03, "gusts", 2, exposure=0.5, border="crop")
    assert pickle.loads(pickle.dumps(shake)) == shake
    assert shake.label == "gusts-0.03-seed2-exposure=0.5-border=crop"
    assert Shake(0.01).label == "white-0.01-seed0"


INVALID = [
    # name, fields, message
    ("percent", {"strength": 3}, "strength of shake is 3: give a share from 0 to 1"),
    ("negative", {"strength": -0.01}, "strength of shake is -0.01"),
    ("nan", {"strength": float("nan")}, "strength of shake is nan"),
    ("long exposure", {"strength": 0, "exposure": 1.5}, "exposure of shake is 1.5"),
    ("negative readout", {"strength": 0, "readout": -1}, "readout of shake is -1"),
    ("negative seed", {"strength": 0, "seed": -1}, "seed of shake is -1"),
    ("unknown kind", {"strength": 0, "kind": "sway"}, "unknown kind of shake 'sway'"),
    ("unknown border", {"strength": 0, "border": "black"}, "unknown border of shake 'black'"),
]


@pytest.mark.parametrize(
    ("values", "message"), [row[1:] for row in INVALID], ids=[row[0] for row in INVALID]
)
def test_invalid_values_are_refused(values, message):
    with pytest.raises(ArgumentError, match=message):
        Shake(**values)


def test_cropping_the_whole_frame_is_refused():
    with pytest.raises(ArgumentError, match="leaves nothing of 320x240 pixels"):
        camera_path(Shake(0.2, border="crop"), 5, SIZE)
