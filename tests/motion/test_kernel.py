"""The compiled kernel and its twin in NumPy give the same."""

from __future__ import annotations

import pickle
import shutil
import subprocess
import sys
from copy import deepcopy
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import CameraMotion
from ssiam.geometry import map_points
from ssiam.motion import kernel
from ssiam.motion.alignment import AlignmentSettings, align
from ssiam.motion.cells import CellTemplate, CompiledTemplate, Grid
from ssiam.motion.coarse import _block_shift
from ssiam.motion.models import FREEDOM
from ssiam.motion.pyramid import PyramidBuilder
from ssiam.video import open_source

ROOT = Path(__file__).parents[2]
SHARED_VIDEO = ROOT.parent / "shared" / "data" / "videos" / "shaky-5.avi"

pytestmark = pytest.mark.skipif(
    not kernel.is_used(), reason="the kernel is not compiled: python hatch_build.py"
)


@pytest.fixture
def numpy_twin(monkeypatch):
    """A function that calls another one without the compiled kernel."""

    def call(function, *arguments, **options):
        with monkeypatch.context() as patch:
            patch.setenv("SSIAM_KERNEL", "numpy")
            return function(*arguments, **options)

    return call


def frames_of(path, count, size_wh=None):
    with open_source(path) as source:
        images = [frame.image for frame in islice(source, count)]
    return images if size_wh is None else [cv2.resize(image, size_wh) for image in images]


def synthetic_frames(size_wh, noise=0):
    shifts_angles = generator(5).uniform(-1, 1, (10, 3)) * (0.06 * size_wh[0], 8, 0.03)
    scene = world(5, size_wh)
    frames = [camera_frame(scene, pose) for pose in poses(shifts_angles, size_wh)]
    if noise:
        normal = generator(6).normal(0, noise, (len(frames), *frames[0].shape))
        frames = list(np.clip(frames + normal, 0, 255).astype(np.uint8))
    return frames


def with_circle(frames):
    """The frames of an endoscope: dark around a circle."""
    height, width = frames[0].shape[:2]
    circle = cv2.circle(np.zeros((height, width), np.uint8), (width // 2, height // 2), 150, 1, -1)
    return [frame * circle[..., None] for frame in frames]


def with_logo(frames):
    """Frames with a static overlay, and some of one color among them."""
    marked = [frame.copy() for frame in frames]
    logo = generator(1).integers(0, 256, (60, 110, 3)).astype(np.uint8)
    for frame in marked:
        frame[20:80, 30:140] = logo
    marked[4] = np.zeros_like(marked[4])
    return marked


CLIPS = {
    "walker": lambda: frames_of(ROOT / "examples" / "shaky-walker.mp4", 60),
    "720p": lambda: synthetic_frames((1280, 720)),
    "360p": lambda: synthetic_frames((640, 360), noise=3),
    "portrait": lambda: synthetic_frames((360, 480)),
    "small": lambda: synthetic_frames((320, 200)),
    "circle": lambda: with_circle(synthetic_frames((640, 360))),
    "logo": lambda: with_logo(synthetic_frames((640, 360))),
    "noise": lambda: list(generator(3).integers(0, 256, (6, 240, 320, 3)).astype(np.uint8)),
}


@pytest.mark.parametrize("model", FREEDOM)
@pytest.mark.parametrize("with_box", [False, True])
@pytest.mark.parametrize("clip", [*CLIPS, "shared", "shared 4K"])
def test_motions_are_the_same(clip, with_box, model, numpy_twin):
    """Corners of the scene differ by at most a thousandth of a pixel in every frame."""
    if clip in CLIPS:
        frames = CLIPS[clip]()
    elif not SHARED_VIDEO.is_file():
        pytest.skip("the folder of test data is absent")
    else:
        frames = frames_of(SHARED_VIDEO, *((8, (3840, 2160)) if "4K" in clip else (50,)))
    height, width = frames[0].shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    if clip == "circle":  # its corners are outside of the scene
        corners = corners / 2 + np.array([width, height]) / 4
    box = (0.4 * width, 0.3 * height, 0.3 * width, 0.4 * height) if with_box else None
    compiled, twin = CameraMotion(model=model), CameraMotion(model=model)
    for index, frame in enumerate(frames):
        found = compiled.update(frame, box)
        expected = numpy_twin(twin.update, frame, box)
        assert found.reliable == expected.reliable, index
        assert found.inliers == pytest.approx(expected.inliers, abs=1e-4)
        difference = np.subtract(
            map_points(found.cur_from_prev, corners), map_points(expected.cur_from_prev, corners)
        )
        assert np.abs(difference).max() <= 1e-3, index


@pytest.mark.parametrize(
    "size_wh",
    [
        *((640, 360), (1280, 720), (1920, 1080), (3840, 2160), (854, 480), (1366, 768)),
        *((320, 240), (360, 640), (641, 359), (1281, 1279)),
    ],
)
def test_levels_have_the_same_pixels(size_wh, numpy_twin):
    frame = generator(1).integers(0, 256, (*size_wh[::-1], 3)).astype(np.uint8)
    compiled = PyramidBuilder(size_wh).from_frame(frame)
    twin = numpy_twin(PyramidBuilder, size_wh).from_frame(frame)
    for found, expected in zip(compiled.levels, twin.levels, strict=True):
        np.testing.assert_array_equal(found, expected)
    above = PyramidBuilder(size_wh).from_fine(twin.fine)
    np.testing.assert_array_equal(above.coarse, twin.coarse)
    np.testing.assert_array_equal(above.tiny, twin.tiny)


@pytest.mark.parametrize("size_wh", [(37, 20), (200, 100), (100, 333)])
def test_levels_of_small_frames_differ_by_one_at_most(size_wh, numpy_twin):
    frame = generator(1).integers(0, 256, (*size_wh[::-1], 3)).astype(np.uint8)
    compiled = PyramidBuilder(size_wh).from_frame(frame)
    twin = numpy_twin(PyramidBuilder, size_wh).from_frame(frame)
    for found, expected in zip(compiled.levels, twin.levels, strict=True):
        assert np.abs(found.astype(int) - expected).max() <= 1


def test_views_of_frames_are_read_by_their_strides():
    """Parts, mirrored and turned frames, and frames whose colors are reversed."""
    whole = generator(2).integers(0, 256, (500, 700, 3)).astype(np.uint8)
    views = [
        whole[20:380, 30:670],
        whole[::-1],
        whole[:, ::-1],
        whole[..., ::-1],
        whole.swapaxes(0, 1),
        whole[::2, ::2],
        np.broadcast_to(whole[:1], whole.shape),
    ]
    for view in views:
        builder = PyramidBuilder(view.shape[1::-1])
        expected = builder.from_frame(view.copy())
        np.testing.assert_array_equal(builder.from_frame(view).fine, expected.fine)


def grids():
    fine = np.array([[160.0, 0, 159.5], [0, 160, 89.5], [0, 0, 1]])
    coarse = np.array([[40.0, 0, 39.5], [0, 40, 22], [0, 0, 1]])
    for model in FREEDOM:
        yield Grid((320, 180), fine, 2, 8, model)
        yield Grid((80, 45), coarse, 1, 5, model)
        yield Grid((200, 180), fine, 3, 4, model)


@pytest.mark.parametrize("grid", list(grids()), ids=lambda grid: f"{grid.model}-{grid.shape}")
def test_templates_and_alignments(grid):
    width, height = grid.kernel.layout.image_wh
    scene = cv2.GaussianBlur(world(4, (width + 20, height + 20))[..., 1], (0, 0), 1.5)
    first = np.ascontiguousarray(scene[10 : 10 + height, 10 : 10 + width])
    second = np.ascontiguousarray(scene[9 : 9 + height, 12 : 12 + width]) // 2 + 60
    twins = CellTemplate(first, grid), CellTemplate(second, grid)
    compiled = grid.template(first), grid.template(second)
    assert isinstance(compiled[0], CompiledTemplate)
    np.testing.assert_allclose(compiled[0].texture, twins[0].texture, rtol=1e-4, atol=1e-4)
    np.testing.assert_array_equal(compiled[0].textured, twins[0].textured)
    change = compiled[0].change_to(compiled[1])
    np.testing.assert_allclose(change, twins[0].change_to(twins[1]), rtol=1e-4, atol=1e-3)
    share = generator(3).uniform(0, 1, grid.cells).astype(np.float32)
    for evenness, tightening in ((0.3, 1.0), (1.0, 0.8)):
        settings = AlignmentSettings(2.0, 0.3, evenness, 5, 1e-9, tightening)
        found = align(compiled[0], second, np.eye(3), share, settings)
        expected = align(twins[0], second, np.eye(3), share, settings)
        np.testing.assert_allclose(found.cur_from_prev, expected.cur_from_prev, atol=3e-6)
        np.testing.assert_allclose(found.error, expected.error, rtol=1e-2, atol=0.02)


def test_a_start_far_outside_of_the_image_is_survived():
    """Nothing is read outside of the image, also for numbers that are none."""
    grid = next(grids())
    image = generator(4).integers(0, 256, (180, 320)).astype(np.uint8)
    template, share = grid.template(image), np.ones(grid.cells, np.float32)
    settings = AlignmentSettings(2.0, 0.3, 1.0, 3, 1e-9)
    for value in (1e30, -1e30, np.inf, np.nan, 1e5):
        start = np.eye(3)
        start[0, 2] = start[1, 1] = value
        align(template, image, start, share, settings)


@pytest.mark.parametrize("size_wh", [(40, 22), (22, 40), (40, 40), (40, 30)])
def test_shifts_of_blocks(size_wh, numpy_twin):
    width, height = size_wh
    texture = cv2.GaussianBlur(world(6, (90, 90))[..., 1], (0, 0), 1)
    share = np.ones((9, 16), np.float32)
    share[:, 5:9] = 0
    for dx, dy in ((0, 0), (3, -2), (-7, 5), (9, 9)):
        prev = np.ascontiguousarray(texture[20 : 20 + height, 20 : 20 + width])
        cur = np.ascontiguousarray(texture[20 - dy :, 20 - dx :][:height, :width])
        found = _block_shift(prev, cur, share)
        assert found == numpy_twin(_block_shift, prev, cur, share)
        flat = np.where(np.arange(width) < width // 2, 50, prev).astype(np.uint8)
        assert _block_shift(flat, cur, share) == numpy_twin(_block_shift, flat, cur, share)


@pytest.mark.parametrize("copy", [deepcopy, lambda camera: pickle.loads(pickle.dumps(camera))])
def test_copies_have_their_own_arrays(copy):
    frames = synthetic_frames((320, 240))
    camera = CameraMotion()
    for frame in frames[:4]:
        camera.update(frame)
    copied = copy(camera)
    expected = [camera.update(frame).cur_from_prev for frame in frames[4:]]
    del camera
    for frame, transform in zip(frames[4:], expected, strict=True):
        np.testing.assert_array_equal(copied.update(frame).cur_from_prev, transform)


def test_results_do_not_depend_on_what_was_before():
    """The arrays of earlier frames are used again."""
    frames = synthetic_frames((320, 240))
    used, fresh = CameraMotion(), CameraMotion()
    for frame in [*frames[5:], np.zeros_like(frames[0]), *frames[5:8]]:
        used.update(frame)
    used.update(frames[0])
    fresh.update(frames[0])
    np.testing.assert_array_equal(
        used.update(frames[1]).cur_from_prev, fresh.update(frames[1]).cur_from_prev
    )


def test_the_environment_chooses_numpy(numpy_twin):
    assert kernel.description() == "compiled"
    assert numpy_twin(kernel.description) == "NumPy (SSIAM_KERNEL=numpy)"
    assert numpy_twin(lambda: next(grids())).kernel is None


def test_a_library_of_another_version_is_not_used(tmp_path):
    """Its structures may differ."""
    source = (ROOT / "src/ssiam/motion/_kernel.c").read_text()
    assert f"#define ABI {kernel._ABI} " in source
    code = (
        "from ssiam.motion import kernel; kernel._ABI = -1; print(kernel._load())\n"
        "kernel._FILES = ('kernel.py',); print(kernel._load())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["None", "None"]
    assert "is of another version: install ssiam again" in done.stderr
    assert "cannot be used" in done.stderr


@pytest.mark.skipif(
    shutil.which("aarch64-linux-gnu-gcc") is None or shutil.which("qemu-aarch64-static") is None,
    reason="needs gcc-aarch64-linux-gnu and qemu-user-static",
)
def test_the_kernel_gives_the_same_on_arm():
    command = [sys.executable, str(ROOT / "scripts" / "arm_kernel.py")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stdout + done.stderr
