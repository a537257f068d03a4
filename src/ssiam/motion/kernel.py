"""The compiled kernel of direct alignment (`_kernel.c`), if the installation has one.

The NumPy functions that it replaces are its reference, and run where it was not built. Both give
the same motions, to a thousandth of a pixel. ``SSIAM_KERNEL=numpy`` in the environment chooses
NumPy.

It is called through `ctypes`, which releases the interpreter. Structures hold addresses of arrays
that are made once for all frames of one size.
"""

from __future__ import annotations

import ctypes
import logging
import os
from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_void_p
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import Image, Transform

Floats: TypeAlias = NDArray[np.floating[Any]]  # float32

_VARIABLE: Final = "SSIAM_KERNEL"
_FILES: Final = ("_kernel.so", "_kernel.dylib", "_kernel.dll")
_ABI: Final = 1  # of the structures and functions below, as in _kernel.c
_MAX_WIDTH: Final = 320  # px of an image, and samples of a row
_MAX_CELLS: Final = 512
_LOG = logging.getLogger(__name__)


class _Grid(Structure):
    _fields_ = (
        *((name, c_int32) for name in ("width", "height", "stride", "first", "side")),
        *((name, c_int32) for name in ("rows", "columns", "freedom")),
        ("pixel_from_unit", c_double * 9),
        ("unit_from_sample", c_double * 9),
        ("flow", c_void_p),
        ("bordered", c_void_p),
    )


class _Template(Structure):
    _fields_ = tuple(
        (name, c_void_p)
        for name in ("values", "gradients_x", "gradients_y", "means", "products", "texture")
    )


_SETTINGS: Final = ("noise", "tolerance", "evenness", "min_step", "tightening", "max_iterations")


class _Settings(Structure):
    _fields_ = (
        *((name, c_double) for name in _SETTINGS[:-1]),
        (_SETTINGS[-1], c_int32),
    )


class _Reduction(Structure):
    _fields_ = (
        *((name, c_int32) for name in ("width", "height", "channels", "halfway")),
        *((name, c_int32) for name in ("fine_width", "fine_height")),
        *((name, c_int32) for name in ("coarse_width", "coarse_height")),
        *((name, c_int32) for name in ("tiny_width", "tiny_height")),
        *((name, c_void_p) for name in ("left", "right_weight", "top", "bottom_weight")),
        *((name, c_void_p) for name in ("resized", "half")),
    )


_Address = c_void_p
_FUNCTIONS: Final[dict[str, tuple[Any, ...]]] = {
    "ssiam_pyramid": (POINTER(_Reduction), _Address, c_int64, _Address, _Address, _Address),
    "ssiam_coarser": (POINTER(_Reduction), _Address, _Address, _Address),
    "ssiam_template": (POINTER(_Grid), _Address, POINTER(_Template)),
    "ssiam_change": (POINTER(_Grid), POINTER(_Template), POINTER(_Template), _Address),
    "ssiam_align": (
        *(POINTER(_Grid), POINTER(_Template), _Address, _Address),
        *(POINTER(_Settings), _Address, _Address),
    ),
    "ssiam_block_shift": (
        *(_Address, _Address, c_int32, c_int32, c_int32),
        *(_Address, ctypes.c_float, c_int32, c_int32, _Address),
    ),
}


def _load() -> ctypes.CDLL | None:
    """The library beside this file; None if it was not built, or is of another version."""
    for name in _FILES:
        path = Path(__file__).with_name(name)
        if not path.is_file():
            continue
        try:
            library = ctypes.CDLL(str(path))
            if library.ssiam_abi() != _ABI:
                _LOG.warning("%s is of another version: install ssiam again", path)
                return None
        except (OSError, AttributeError) as error:
            _LOG.warning("%s cannot be used (%s): install ssiam again", path, error)
            return None
        for function, arguments in _FUNCTIONS.items():
            getattr(library, function).argtypes = arguments
            getattr(library, function).restype = None
        return library
    return None


_LIBRARY: Final = _load()


def is_used() -> bool:
    """Whether new estimators run the compiled kernel."""
    return _LIBRARY is not None and os.environ.get(_VARIABLE) != "numpy"


def description() -> str:
    """Which implementation runs, and why: for people."""
    if is_used():
        return "compiled"
    if _LIBRARY is not None:
        return f"NumPy ({_VARIABLE}=numpy)"
    return "NumPy (not compiled: there was no C compiler at installation)"


@lru_cache(maxsize=1)
def report_absence() -> None:
    """Log, once in a process, that the kernel was not built."""
    if _LIBRARY is None:
        _LOG.warning(
            "camera motion runs in NumPy, at half of the speed: install a C compiler (gcc or "
            "clang), then ssiam again"
        )


class _Addressed:
    """Has a structure of the addresses of its arrays, which is made again for a copy."""

    def __init__(self) -> None:
        self._point()

    def _point(self) -> None:
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "struct"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._point()


class GridLayout(NamedTuple):
    """Where a grid has its samples and cells; see `Grid`."""

    image_wh: tuple[int, int]
    stride: int
    first: int
    side: int
    shape: tuple[int, int]  # rows, columns

    @property
    def fits(self) -> bool:
        """Whether the kernel has room for it."""
        (width, height), (rows, columns) = self.image_wh, self.shape
        cells = rows * columns
        return max(width, height) <= _MAX_WIDTH and 0 < cells <= _MAX_CELLS


class GridKernel(_Addressed):
    """The kernel's functions for the images of one grid.

    Parameters
    ----------
    layout : GridLayout
    pixel_from_unit, unit_from_sample : (3, 3) float64
    flow : (freedom, 2 * cells) float32
        As in `Grid`.
    """

    def __init__(
        self,
        layout: GridLayout,
        pixel_from_unit: Transform,
        unit_from_sample: Transform,
        flow: Floats,
    ) -> None:
        self.layout = layout
        self._pixel_from_unit, self._unit_from_sample = pixel_from_unit, unit_from_sample
        self._flow = np.ascontiguousarray(flow, dtype=np.float32)
        width, height = layout.image_wh
        self._bordered = np.zeros((height + 3, width + 3), dtype=np.uint8)
        self._transform = np.empty((3, 3))
        self._share = np.empty(layout.shape[0] * layout.shape[1], dtype=np.float32)
        super().__init__()

    def _point(self) -> None:
        layout = self.layout
        self.struct = _Grid(
            *layout.image_wh,
            layout.stride,
            layout.first,
            layout.side,
            *layout.shape,
            len(self._flow),
            (c_double * 9)(*self._pixel_from_unit.ravel()),
            (c_double * 9)(*self._unit_from_sample.ravel()),
            self._flow.ctypes.data,
            self._bordered.ctypes.data,
        )

    def align(
        self,
        template: TemplateKernel,
        image: Image,
        start: Transform,
        background_share: Floats,
        settings: Any,
    ) -> tuple[Transform, Floats]:
        """As `ssiam.motion.alignment.align`: the transform, and the error of each cell."""
        self._share[:] = background_share
        transform, error = start.copy(), np.empty_like(self._share)
        _library().ssiam_align(
            self.struct,
            template.struct,
            image.ctypes.data,
            self._share.ctypes.data,
            _settings(settings),
            transform.ctypes.data,
            error.ctypes.data,
        )
        return transform, error


class TemplateKernel(_Addressed):
    """The arrays of a template, filled by the kernel; used again for other images.

    Attributes
    ----------
    texture : (cells,) float32
        As in `CellTemplate`.
    """

    def __init__(self, kernel: GridKernel) -> None:
        self.kernel = kernel
        rows, columns = kernel.layout.shape
        side, cells = kernel.layout.side, rows * columns
        samples = rows * side, columns * side
        self._values = np.empty(samples, dtype=np.uint8)
        self._gradients = np.empty((2, *samples), dtype=np.int16)
        self._means = np.empty((2, cells), dtype=np.float32)
        self._products = np.empty((3, cells), dtype=np.float32)
        self.texture: Floats = np.empty(cells, dtype=np.float32)
        super().__init__()

    def _point(self) -> None:
        arrays = (self._values, *self._gradients, self._means, self._products, self.texture)
        self.struct = _Template(*(array.ctypes.data for array in arrays))

    def fill(self, image: Image) -> None:
        """Compute the template of an image (H, W) uint8."""
        _library().ssiam_template(self.kernel.struct, image.ctypes.data, self.struct)

    def change_to(self, later: Any) -> Floats:
        """As `CellTemplate.change_to`."""
        change = np.empty_like(self.texture)
        _library().ssiam_change(self.kernel.struct, self.struct, later.struct, change.ctypes.data)
        return change


class ReductionKernel(_Addressed):
    """Makes pyramids, with the pixels that OpenCV's functions make.

    Parameters
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    level_whs : three of (int, int)
        Width and height of the fine, coarse and tiny level, pixels.
    """

    def __init__(
        self,
        size_wh: tuple[int, int],
        level_whs: tuple[tuple[int, int], tuple[int, int], tuple[int, int]],
    ) -> None:
        self._size_wh, self._level_whs = size_wh, level_whs
        (width, height), *_ = level_whs
        self._columns, self._rows = map(_taps, size_wh, level_whs[0])
        self._resized = np.empty((height, width), dtype=np.uint8)
        self._half = np.empty(((height + 1) // 2, (width + 1) // 2), dtype=np.uint8)
        super().__init__()

    def _point(self) -> None:
        self.struct = _Reduction(
            *self._size_wh,
            3,
            bool((self._columns[1] == 1024).all() and (self._rows[1] == 1024).all()),
            *(length for level_wh in self._level_whs for length in level_wh),
            *(array.ctypes.data for array in (*self._columns, *self._rows)),
            self._resized.ctypes.data,
            self._half.ctypes.data,
        )

    def new_levels(self) -> tuple[Image, Image, Image]:
        """Arrays for the levels of one pyramid."""
        fine, coarse, tiny = (np.empty(wh[::-1], dtype=np.uint8) for wh in self._level_whs)
        return fine, coarse, tiny

    def reduce(self, frame: Image, levels: tuple[Image, Image, Image]) -> None:
        """Fill the levels from a frame (H, W, 3) uint8 BGR or (H, W) uint8."""
        pixel_bytes = 1 if frame.ndim == 2 else 3
        if frame.strides[1:] != (pixel_bytes, 1)[: frame.ndim - 1]:
            frame = np.ascontiguousarray(frame)
        self.struct.channels = pixel_bytes
        _library().ssiam_pyramid(
            self.struct,
            frame.ctypes.data,
            frame.strides[0],
            *(level.ctypes.data for level in levels),
        )

    def reduce_fine(self, levels: tuple[Image, Image, Image]) -> None:
        """Fill the coarse and the tiny level from the fine one."""
        _library().ssiam_coarser(self.struct, *(level.ctypes.data for level in levels))


def block_shift(
    prev: Image, cur: Image, reach: int, share: Floats, min_share: float
) -> tuple[int, int]:
    """As `ssiam.motion.coarse._block_shift`, with the blocks whose share is at least `min_share`.

    Parameters
    ----------
    prev, cur : (H, W) uint8
    reach : int
        Search range in each direction, pixels.
    share : (rows, columns) float32
    min_share : float
    """
    shift_xy = (c_int32 * 2)()
    height, width = prev.shape
    _library().ssiam_block_shift(
        prev.ctypes.data,
        cur.ctypes.data,
        width,
        height,
        reach,
        share.ctypes.data,
        min_share,
        *share.shape,
        ctypes.addressof(shift_xy),
    )
    return shift_xy[0], shift_xy[1]


def _library() -> ctypes.CDLL:
    if _LIBRARY is None:
        raise ArgumentError(
            "this object was pickled where the compiled kernel is installed: make one here"
        )
    return _LIBRARY


@lru_cache
def _settings(settings: Any) -> _Settings:
    """The fields of `AlignmentSettings`."""
    return _Settings(*(getattr(settings, name) for name in _SETTINGS))


def _taps(size: int, count: int) -> NDArray[np.int32]:
    """Linear interpolation as in OpenCV (2, count): pixels, and the weight of the next of 2048."""
    position = ((np.arange(count) + 0.5) * (size / count) - 0.5).astype(np.float32)
    first = np.floor(position).astype(np.int32)
    weight = np.rint((position - first) * np.float32(2048)).astype(np.int32)
    weight[(first < 0) | (first >= size - 1)] = 0
    return np.stack([np.clip(first, 0, size - 1), weight])
