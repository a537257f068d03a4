import hashlib

import cv2
import numpy as np
import pytest

import ssiam
from helpers.synthetic import golden_video, world
from ssiam import FrameView
from ssiam.geometry import corners_from_xywh, map_points, rigid
from ssiam.stabilize.view import _FOUR_CHANNELS, _warp


def test_a_crop_of_a_raw_view_is_the_reference_bit_for_bit(golden):
    z = golden("functions.npz")
    frame = golden_video("A")[0][0]
    fill = frame.mean(axis=(0, 1))
    np.testing.assert_allclose(fill, z["avg"])
    for (cx, cy, out, side), digest in zip(
        z["subwindow_cases"], z["subwindow_sha256"], strict=True
    ):
        crop = FrameView(frame).crop_square((cx, cy), int(side), int(out), fill)
        planes = np.ascontiguousarray(crop.transpose(2, 0, 1))
        assert hashlib.sha256(planes.tobytes()).hexdigest() == digest


def smooth_world():
    return cv2.GaussianBlur(world(), (0, 0), 3)


STAB_FROM_RAW = rigid(14.3, -9.7, 0.06, (319.5, 179.5))


@pytest.mark.parametrize("side", [90, 127, 200, 255])
def test_a_crop_of_a_stabilized_view_is_the_crop_of_the_warped_frame(side):
    frame = smooth_world()
    fill = np.array([0.0, 0.0, 0.0])
    warped = cv2.warpAffine(frame, STAB_FROM_RAW[:2], (640, 360))
    whole = FrameView(warped).crop_square((300.2, 170.9), side, 255, fill)
    composed = FrameView(frame, STAB_FROM_RAW).crop_square((300.2, 170.9), side, 255, fill)
    difference = np.abs(whole.astype(int) - composed)[4:-4, 4:-4]
    assert difference.mean() < 0.5
    assert np.percentile(difference, 99) <= 3


def test_a_crop_near_the_identity_is_the_reference_crop():
    frame = smooth_world()
    fill = frame.mean(axis=(0, 1))
    nearly = FrameView(frame, rigid(1e-6, 0, 0))
    assert not nearly.is_raw
    a, b = (view.crop_square((30.0, 40.0), 180, 255, fill) for view in (FrameView(frame), nearly))
    assert np.abs(a.astype(int) - b)[2:-2, 2:-2].max() <= 2


@pytest.mark.parametrize("center", [(-500.0, 50.0), (5000.0, 50.0), (100.0, -900.0)])
@pytest.mark.parametrize("stab_from_raw", [np.eye(3), STAB_FROM_RAW])
def test_a_crop_outside_of_the_frame_is_the_truncated_fill(center, stab_from_raw):
    view = FrameView(world(), stab_from_raw)
    crop = view.crop_square(center, 100, 127, np.array([10.9, 20.2, 30.7]))
    assert (crop == (10, 20, 30)).all()


@pytest.mark.parametrize("size_wh", [(1, 1), (33, 17), (1920, 1080)])
def test_the_mean_color_is_exact(size_wh):
    width, height = size_wh
    frame = np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)
    np.testing.assert_array_equal(FrameView(frame).mean_color, frame.mean(axis=(0, 1)))


def test_render_is_the_stabilized_frame_with_its_border():
    frame = smooth_world()
    image = FrameView(frame, STAB_FROM_RAW, border=20).render()
    assert image.shape == (400, 680, 3)
    points = np.array([[200, 150], [400, 200], [330, 120]])
    for raw_xy, (x, y) in zip(points, map_points(STAB_FROM_RAW, points) + 20, strict=True):
        pixel = cv2.getRectSubPix(image, (1, 1), (float(x), float(y)))[0, 0]
        assert np.abs(pixel.astype(int) - frame[raw_xy[1], raw_xy[0]]).max() <= 3


def test_the_border_contains_what_a_shift_moves_out_of_the_frame():
    frame = world()
    image = FrameView(frame, rigid(20, -20, 0), border=20).render()
    np.testing.assert_array_equal(image[0:360, 40:680], frame)


def test_render_of_a_raw_view():
    frame = world()
    assert FrameView(frame).render() is frame
    bordered = FrameView(frame, border=20).render()
    np.testing.assert_array_equal(bordered[20:-20, 20:-20], frame)
    assert not bordered[:20].any()


PARTS = [
    pytest.param((200.0, 100.0, 80.0, 60.0), id="inside"),
    pytest.param((200.3, 100.8, 80.5, 60.1), id="fractional"),
    pytest.param((-90.0, -70.0, 200.0, 150.0), id="beyond left and top"),
    pytest.param((560.0, 300.0, 300.0, 200.0), id="beyond right and bottom"),
    pytest.param((-500.0, 150.0, 2000.0, 30.0), id="beyond both sides"),
    pytest.param((-1e4, -1e4, 2e4, 2e4), id="larger than the frame"),
    pytest.param((900.0, 100.0, 80.0, 60.0), id="right of it"),
    pytest.param((100.0, -300.0, 80.0, 60.0), id="above it"),
    pytest.param((300.0, 200.0, 0.5, 0.5), id="smaller than a pixel"),
]


@pytest.mark.parametrize("part_xywh", PARTS)
@pytest.mark.parametrize("border", [0, 20])
def test_a_partial_render_is_black_around_the_part(part_xywh, border):
    view = FrameView(np.maximum(world(), 1), STAB_FROM_RAW, border)
    whole, part = view.render(), view.render(part_xywh)
    x, y, w, h = part_xywh
    rows, columns = (np.arange(n) - border for n in whole.shape[:2])  # stabilized pixels
    inside = np.outer((y <= rows) & (rows < y + h), (x <= columns) & (columns < x + w))
    # One more pixel on each side may be rendered.
    near = np.outer((y - 1 <= rows) & (rows <= y + h), (x - 1 <= columns) & (columns <= x + w))
    assert part.shape == whole.shape
    # Both round positions to 1/32 of a pixel, relative to different corners.
    assert np.abs(part.astype(int) - whole)[inside].max(initial=0) <= 8
    assert np.array_equal(part[inside].any(axis=1), whole[inside].any(axis=1))
    assert not part[~near].any()


@pytest.mark.parametrize("part_xywh", PARTS)
def test_a_raw_view_is_rendered_whole(part_xywh):
    frame = world()
    assert FrameView(frame).render(part_xywh) is frame
    view = FrameView(frame, border=20)
    np.testing.assert_array_equal(view.render(part_xywh), view.render())


def test_the_frame_is_not_changed():
    frame = world()
    before = frame.copy()
    view = FrameView(frame, STAB_FROM_RAW, border=5)
    view.render()
    view.crop_square((10.0, 10.0), 100, 127, np.zeros(3))
    np.testing.assert_array_equal(frame, before)


def test_a_view_describes_itself():
    view = FrameView(world(), border=3)
    assert view.size_wh == (640, 360)
    assert repr(view) == "FrameView(640x360, border=3, is_raw=True)"
    moved = FrameView(world(), STAB_FROM_RAW)
    assert repr(moved) == "FrameView(640x360, border=0, is_raw=False)"
    np.testing.assert_allclose(moved.raw_from_stab @ STAB_FROM_RAW, np.eye(3), atol=1e-12)
    shown = cv2.imdecode(np.frombuffer(view._repr_png_(), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(shown, view.render())


@pytest.mark.parametrize("shift", [(0, 0), (7, -5)])
def test_a_rectangle_of_whole_pixels_is_cut_out(shift):
    frame = world()
    x, y = 200 + shift[0], 100 + shift[1]
    view = FrameView(frame, rigid(*shift, 0))
    crop = view.crop((x, y, 60, 40), (60, 40), np.zeros(3)).image
    np.testing.assert_array_equal(crop, frame[100:140, 200:260])


def test_a_rectangle_is_stretched():
    """Each pixel of the crop is the center of two by four pixels, where the frame is a ramp."""
    x, y = np.meshgrid(np.arange(100), np.arange(60))
    frame = np.stack([2 * x, 4 * y, np.zeros_like(x)], axis=2).astype(np.uint8)
    crop = FrameView(frame).crop((10, 20, 40, 32), (20, 8), np.zeros(3)).image
    assert crop.shape == (8, 20, 3)
    columns, rows = 10 + 2 * np.arange(20) + 0.5, 20 + 4 * np.arange(8) + 1.5
    np.testing.assert_array_equal(crop[..., 0], np.tile(2 * columns, (8, 1)))
    np.testing.assert_array_equal(crop[..., 1], np.tile(4 * rows, (20, 1)).T)


def test_outside_of_the_frame_a_rectangle_has_the_truncated_fill():
    crop = FrameView(world()).crop((-80, 10, 40, 30), (20, 15), np.array([9.9, 1, 2.5])).image
    assert (crop == (9, 1, 2)).all()


@pytest.mark.parametrize(
    ("center", "side", "rows", "columns"),
    [
        ((100.0, 80.0), 20, slice(70, 90), slice(90, 110)),
        ((100.0, 80.0), 21, slice(69, 90), slice(89, 110)),
        ((100.5, 80.4), 20, slice(70, 90), slice(90, 110)),
        ((100.5, 80.6), 21, slice(70, 91), slice(90, 111)),
    ],
)
def test_the_corner_of_a_square_is_rounded_half_up(center, side, rows, columns):
    frame = world()
    crop = FrameView(frame).crop_square(center, side, side, np.zeros(3))
    np.testing.assert_array_equal(crop, frame[rows, columns])
    assert crop.flags.c_contiguous


@pytest.mark.parametrize(("left", "top"), [(-6, -4), (630, 350), (-6, 350), (630, -4)])
def test_a_square_over_a_corner_is_filled_around_the_frame(left, top):
    frame = world()
    center = left + 10.5, top + 10.5
    crop = FrameView(frame).crop_square(center, 20, 20, np.array([1.0, 2, 3]))
    padded = np.full((420, 700, 3), (1, 2, 3), np.uint8)
    padded[30:390, 30:670] = frame
    np.testing.assert_array_equal(crop, padded[top + 30 : top + 50, left + 30 : left + 50])


def test_a_crop_is_black_outside_of_the_frame_by_default():
    assert not FrameView(world()).crop((-80, 10, 40, 30), (20, 15)).image.any()


@pytest.mark.parametrize("stab_from_raw", [np.eye(3), STAB_FROM_RAW])
def test_a_crop_gives_the_way_back_to_the_view(stab_from_raw):
    """A square that is found in a stretched crop is where it was drawn in the view."""
    view = FrameView(np.zeros((360, 640, 3), np.uint8), stab_from_raw)
    corners = map_points(view.raw_from_stab, corners_from_xywh((300, 150, 20, 12)) - 0.5)
    cv2.fillPoly(view.raw, [np.rint(corners * 16).astype(np.int32)], (255, 255, 255), shift=4)
    crop = view.crop((260, 130, 120, 60), (240, 240))
    rows, columns = np.nonzero(crop.image[..., 0] > 127)
    found = columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1
    x, y, w, h = crop.box_in_view(found)
    assert (x, y) == pytest.approx((300, 150), abs=1.5)
    assert (w, h) == pytest.approx((20, 12), abs=2.5)
    assert crop.box_in_view((0, 0, 240, 240)) == (260, 130, 120, 60)
    corner = map_points(crop.view_from_crop, [(240, 240)])[0]
    np.testing.assert_allclose(corner, (380, 190))


def test_a_crop_is_a_networks_input():
    crop = FrameView(world()).crop((100, 50, 80, 40), (32, 16))
    blue, green, red = (crop.image[..., channel].astype(np.float32) for channel in range(3))
    plain = crop.tensor()
    assert (plain.shape, plain.dtype) == ((1, 3, 16, 32), np.float32)
    assert plain.flags.c_contiguous
    np.testing.assert_array_equal(plain[0], [blue, green, red])
    scaled = crop.tensor(rgb=True, mean=(10, 20, 30), scale=(1, 0.5, 2))
    expected = [red - 10, (green - 20) / 2, (blue - 30) * 2]
    np.testing.assert_allclose(scaled[0], expected, rtol=1e-6)
    np.testing.assert_allclose(crop.tensor(scale=1 / 255).max() * 255, crop.image.max(), rtol=1e-6)
    assert crop.image.max() > 1  # the crop itself is unchanged


def test_a_crop_describes_itself():
    crop = FrameView(world()).crop((100, 50, 80, 40), (32, 16))
    assert repr(crop) == "Crop(32x16 of 100,50,80,40)"
    shown = cv2.imdecode(np.frombuffer(crop._repr_png_(), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(shown, crop.image)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((1, 2, 3), (8, 8)), "has 3 numbers"),
        (((1, 2, 0, 4), (8, 8)), "empty or not finite"),
        (((1, 2, np.nan, 4), (8, 8)), "empty or not finite"),
        (((1, 2, 3, 4), (8, 0)), r"crop size \(8, 0\)"),
        (((1, 2, 3, 4), (8, 8.5)), "crop size"),
        (((1, 2, 3, 4), 8), "crop size 8"),
        (((1, 2, 3, 4), (100_000, 8)), "1 to 4096"),
        (((1, 2, 3, 4), (8, 8), 0), "fill 0 is not a color"),
        (((1, 2, 3, 4), (8, 8), (1, 2, np.inf)), "is not a color"),
    ],
)
def test_a_crop_that_cannot_be_cut_is_refused(arguments, message):
    with pytest.raises(ssiam.SsiamError, match=message):
        FrameView(world()).crop(*arguments)


@pytest.mark.parametrize("values", [{"mean": (1, 2)}, {"scale": "x"}, {"mean": np.nan}])
def test_a_tensor_needs_one_number_or_three(values):
    with pytest.raises(ssiam.SsiamError, match="give one number, or one per channel"):
        FrameView(world()).crop((1, 2, 3, 4), (8, 8)).tensor(**values)


@pytest.mark.parametrize(
    ("zoom", "shift", "out"),
    [
        (1.4, (0, 0), 255),
        (0.3, (0, 0), 127),
        (1.9, (400, 0), 128),  # partly outside
        (1.2, (-300, -170), 255),
        (1.0, (2000, 0), 64),  # outside
        (5.0, (-900, -600), 200),  # the whole frame
        (1.0, (0, 0), 1),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 0.02, -0.7, 3.0])
def test_warps_of_four_channels_have_the_pixels_of_three(zoom, shift, out, angle):
    random = np.random.default_rng(4)
    noise = random.integers(0, 256, (360, 640, 3), dtype=np.uint8)
    for raw in (noise, noise[::-1, ::-1], noise[5:105, 9:209]):
        _FOUR_CHANNELS.of_size(raw.shape[1], raw.shape[0])[:] = 77  # left by another frame
        for _ in range(3):
            x, y = random.uniform(0, 300, 2) + shift
            raw_from_out = rigid(x, y, angle, (50, 50)) @ np.diag([zoom, zoom, 1])
            warped = _warp(raw, raw_from_out, (out, out), [1.0, 20.0, 255.0])
            expected = cv2.warpAffine(
                np.ascontiguousarray(raw),
                raw_from_out[:2],
                (out, out),
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=(1, 20, 255),
            )
            np.testing.assert_array_equal(warped, expected)
