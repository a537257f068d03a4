"""Compile the kernel of the camera motion for ARM, run it in an emulator, compare it with NumPy.

    apt-get install gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static
    python scripts/arm_kernel.py

Two frames go through every function of the kernel: pyramid, templates, alignment with each motion
model, block matching. Pixels must be the same; numbers may differ by 1e-4 of the largest one of
their array. Ends with 2 if a tool is missing, and with 1 if something differs.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

os.environ["SSIAM_KERNEL"] = "numpy"

from ssiam.geometry import Image, rigid
from ssiam.motion.alignment import AlignmentSettings, align
from ssiam.motion.cells import CellTemplate, Grid
from ssiam.motion.coarse import _block_shift
from ssiam.motion.kernel import ReductionKernel
from ssiam.motion.models import FREEDOM, ModelName
from ssiam.motion.pyramid import PyramidBuilder

COMPILER = "aarch64-linux-gnu-gcc"
EMULATORS = ("qemu-aarch64-static", "qemu-aarch64")
DRIVER = Path(__file__).with_name("arm_kernel.c")
TOLERANCE = 1e-4
SIZE_WH = (640, 360)
SETTINGS = AlignmentSettings(2.0, 0.3, 0.5, 5, 1e-9, 0.8)

Array = NDArray[Any]


def frames() -> tuple[Image, Image]:
    """Two frames of a textured scene, with a small motion between them."""
    width, height = SIZE_WH
    noise = np.random.Generator(np.random.PCG64(1)).integers(0, 256, (height, width, 3))
    scene = cv2.GaussianBlur(noise.astype(np.float32), (0, 0), 4)
    scene = cv2.normalize(scene, None, 0, 255, cv2.NORM_MINMAX)  # type: ignore[call-overload]
    moved = cv2.warpAffine(
        scene, rigid(7.3, -4.1, 0.01)[:2], SIZE_WH, borderMode=cv2.BORDER_REFLECT
    )
    return scene.astype(np.uint8), moved.astype(np.uint8)


def vectors(model: ModelName) -> tuple[bytes, list[tuple[str, Array]]]:
    """What the driver reads, and what NumPy gives: names and arrays, in the driver's order."""
    builder = PyramidBuilder(SIZE_WH)
    images = frames()
    first, second = (builder.from_frame(image) for image in images)
    level_whs = [level.shape[::-1] for level in first.levels]
    reduction = ReductionKernel(SIZE_WH, (level_whs[0], level_whs[1], level_whs[2]))
    sizes = [*SIZE_WH, *np.ravel(level_whs).tolist(), reduction.struct.halfway]
    given: list[Array] = [np.array(sizes, np.int32), *reduction._columns, *reduction._rows, *images]
    expected: list[tuple[str, Array]] = [
        (f"{name} level", level)
        for pyramid in (first, second)
        for name, level in zip(("fine", "coarse", "tiny"), pyramid.levels, strict=True)
    ]
    grids = (
        (
            "fine",
            Grid(builder.fine_wh, builder.fine_from_unit, 2, 8, model),
            first.fine,
            second.fine,
        ),
        (
            "coarse",
            Grid(builder.coarse_wh, builder.coarse_from_unit, 1, 5, model),
            first.coarse,
            second.coarse,
        ),
    )
    for name, grid, before, after in grids:
        share = np.linspace(0.2, 1, grid.cells, dtype=np.float32)
        height, width = before.shape
        layout = [width, height, grid._stride, grid._first, grid._side, *grid.shape, FREEDOM[model]]
        numbers = [SETTINGS.noise, SETTINGS.tolerance, SETTINGS.evenness, SETTINGS.min_step]
        numbers += [SETTINGS.tightening, SETTINGS.max_iterations]
        given += [np.array(layout, np.int32), grid._pixel_from_unit, grid._unit_from_sample]
        given += [grid.flow, share, np.array(numbers, np.float64), np.eye(3)]
        templates = CellTemplate(before, grid), CellTemplate(after, grid)
        aligned = align(templates[0], after, np.eye(3), share, SETTINGS)
        expected += [
            (f"{name} products", templates[0].products),
            (f"{name} texture", templates[0].texture),
            (f"{name} change", templates[0].change_to(templates[1])),
            (f"{name} transform", aligned.cur_from_prev),
            (f"{name} error", aligned.error),
        ]
    shift = _block_shift(first.tiny, second.tiny, np.ones((9, 16), np.float32))
    expected.append(("block shift", np.array(shift, np.int32)))
    return b"".join(np.ascontiguousarray(array).tobytes() for array in given), expected


def differences(output: bytes, expected: list[tuple[str, Array]]) -> list[tuple[str, float]]:
    """Largest difference of each array, as a share of its largest number."""
    found, at = [], 0
    for name, array in expected:
        values = np.frombuffer(output, array.dtype, array.size, at).reshape(array.shape)
        at += array.nbytes
        largest = max(float(np.abs(array.astype(np.float64)).max()), 1e-12)
        difference = np.abs(values.astype(np.float64) - array).max() / largest
        found.append((name, float(difference)))
    return found


def main() -> int:
    """Print the differences; return the exit code."""
    emulator = next((name for name in EMULATORS if shutil.which(name)), None)
    if shutil.which(COMPILER) is None or emulator is None:
        print(f"{COMPILER} or {EMULATORS[0]} is missing: see --help", file=sys.stderr)
        return 2
    is_same = True
    with TemporaryDirectory() as folder:
        program = Path(folder, "kernel")
        flags = ["-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
        subprocess.run(
            [COMPILER, *flags, "-static", str(DRIVER), "-o", str(program), "-lm"], check=True
        )
        for model in FREEDOM:
            given, expected = vectors(model)
            done = subprocess.run(
                [emulator, str(program)], input=given, stdout=subprocess.PIPE, check=True
            )
            for name, difference in differences(done.stdout, expected):
                is_exact = name.endswith(("level", "shift"))
                is_same &= difference <= (0 if is_exact else TOLERANCE)
                print(f"{model:12} {name:18} {difference:.1e}")
    return 0 if is_same else 1


if __name__ == "__main__":
    if "--help" in sys.argv:
        print(__doc__)
    else:
        sys.exit(main())
