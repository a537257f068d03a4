"""The tracking function in the form that CVAT's agents call.

With the real cvat-sdk if it is installed, else with its documented classes.
"""

import sys
from dataclasses import dataclass
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from helpers.tracked_clip import BOX, SIZE
from ssiam.errors import MissingExtraError
from ssiam.exchange.mask_shapes import cvat_mask
from ssiam.geometry import map_box

PIL_Image = pytest.importorskip("PIL.Image")
COUNT = 12


@dataclass(frozen=True, kw_only=True)
class TrackingFunctionSpec:
    """As in cvat-sdk 2.80: a set of names of shapes."""

    supported_shape_types: frozenset

    def __post_init__(self):
        known = {"rectangle", "polygon", "polyline", "points", "ellipse", "cuboid", "mask"}
        assert set(self.supported_shape_types) <= known


@dataclass(frozen=True, kw_only=True)
class TrackableShape:
    """As in cvat-sdk 2.80: a name of a shape, and floats."""

    type: str
    points: list

    def __post_init__(self):
        assert isinstance(self.points, list)
        assert all(isinstance(value, float) for value in self.points)


@pytest.fixture(autouse=True)
def sdk(monkeypatch):
    try:
        from cvat_sdk import auto_annotation
    except ImportError:
        auto_annotation = ModuleType("cvat_sdk.auto_annotation")
        auto_annotation.TrackingFunctionSpec = TrackingFunctionSpec
        auto_annotation.TrackableShape = TrackableShape
        monkeypatch.setitem(sys.modules, "cvat_sdk", ModuleType("cvat_sdk"))
        monkeypatch.setitem(sys.modules, "cvat_sdk.auto_annotation", auto_annotation)
    return auto_annotation


@pytest.fixture(scope="module")
def shots():
    """Images of a shaky clip as CVAT gives them, and the true boxes."""
    frame_from_world = poses(generator(2).normal(0, (3, 2, 0.004), (COUNT, 3)), SIZE)
    image = world(size_wh=SIZE)
    start = np.linalg.inv(frame_from_world[0])
    images = [
        PIL_Image.fromarray(camera_frame(image, pose)[:, :, ::-1]) for pose in frame_from_world
    ]
    return images, [map_box(pose @ start, BOX) for pose in frame_from_world]


def followed(function, images, shape):
    """The shapes in all images after the first, as an agent asks for them."""
    context = SimpleNamespace(original_shape_type=shape.type)
    state = function.init_tracking_state(
        context, function.preprocess_image(context, images[0]), shape
    )
    return [
        function.track(context, function.preprocess_image(context, image), state)
        for image in images[1:]
    ]


def test_supported_shapes(sdk):
    from ssiam.integrations.cvat_agent import create

    spec = create(tracker="kcf").spec
    assert isinstance(spec, sdk.TrackingFunctionSpec)
    assert set(spec.supported_shape_types) == {"rectangle", "polygon", "mask"}


def test_images_become_bgr():
    from ssiam.integrations.cvat_agent import create

    image = PIL_Image.new("RGBA", (4, 3), (10, 20, 30, 255))
    found = create(tracker="kcf").preprocess_image(None, image)
    assert found.shape == (3, 4, 3)
    assert found[0, 0].tolist() == [30, 20, 10]
    assert found.flags.c_contiguous


def test_two_rectangles_at_once(sdk, shots):
    from ssiam.integrations.cvat_agent import create

    images, truth = shots
    function = create(tracker="kcf")
    x, y, w, h = BOX
    shapes = followed(
        function, images, sdk.TrackableShape(type="rectangle", points=[x, y, x + w, y + h])
    )
    for shape, (tx, ty, tw, th) in zip(shapes, truth[1:], strict=True):
        assert shape.type == "rectangle"
        assert shape.points == pytest.approx([tx, ty, tx + tw, ty + th], abs=10)
        assert all(type(value) is float for value in shape.points)


@pytest.mark.parametrize("tracker", ["lite", "kcf"])
@pytest.mark.parametrize("kind", ["polygon", "mask"])
def test_polygons_and_masks_keep_their_kind(sdk, shots, tracker, kind):
    """kcf has no masks: its box comes back in the same form."""
    from ssiam.integrations.cvat_agent import create

    images, truth = shots
    x, y, w, h = (int(v) for v in BOX)
    if kind == "polygon":
        points = [x, y, x + w, y, x + w, y + h, x, y + h]
    else:
        mask = np.zeros(SIZE[::-1], bool)
        mask[y : y + h, x : x + w] = True
        part = cvat_mask(mask)
        points = [*part.runs, x, y, x + w - 1, y + h - 1]
    given = sdk.TrackableShape(type=kind, points=[float(v) for v in points])
    for shape, box in zip(
        followed(create(tracker=tracker), images[:4], given), truth[1:4], strict=True
    ):
        assert shape.type == kind
        tx, ty, tw, th = box
        if kind == "polygon":
            corners = np.reshape(shape.points, (-1, 2))
            assert len(corners) >= 3
            center = (corners.min(axis=0) + corners.max(axis=0)) / 2
        else:
            *runs, left, top, right, bottom = shape.points
            assert sum(runs) == (right - left + 1) * (bottom - top + 1)
            center = (left + right + 1) / 2, (top + bottom + 1) / 2
        assert center == pytest.approx((tx + tw / 2, ty + th / 2), abs=14)


def test_a_lost_target_gives_no_shape(sdk, shots):
    from ssiam.integrations.cvat_agent import create

    images, _ = shots
    x, y, w, h = BOX
    gone = [images[0], *[PIL_Image.new("RGB", SIZE)] * 40]
    shape = sdk.TrackableShape(type="rectangle", points=[x, y, x + w, y + h])
    assert followed(create(tracker="kcf"), gone, shape)[-1] is None


def test_without_the_sdk_the_error_says_what_to_install(monkeypatch):
    from ssiam.integrations.cvat_agent import create

    monkeypatch.setitem(sys.modules, "cvat_sdk.auto_annotation", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'cvat-sdk>=2\.40'"):
        create(tracker="kcf")
