"""Masks as short text: run lengths in the compressed form of COCO.

The runs alternate between background and target, begin with the background and go down the columns.
From the fourth on, the difference from the run before the last is stored. A number is a sequence of
characters from "0" (48) on, each with five bits, the lowest first, and a sixth that says that more
follow; the highest of the last five is the sign. pycocotools calls the text `counts`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Mask

_ZERO: Final = 48  # code of the character that stands for 0
_BITS: Final = 5
_LOW, _SIGN, _MORE = 0x1F, 0x10, 0x20
_MOST_CHARACTERS: Final = 7  # of a number of 32 bits


def encode_mask(mask: Mask) -> str:
    """The text of a mask (H, W); without the size of the frame."""
    runs = run_lengths(mask.ravel(order="F"))
    characters: list[int] = []
    for index, run in enumerate(runs):
        number = run - runs[index - 2] if index > 2 else run
        has_more = True
        while has_more:
            low = number & _LOW
            number >>= _BITS
            has_more = number != (-1 if low & _SIGN else 0)
            characters.append(_ZERO + low + _MORE * has_more)
    return bytes(characters).decode("ascii")


def run_lengths(flat: NDArray[np.bool_]) -> list[int]:
    """Lengths of runs of a flat mask (N,), background and target in turn.

    The first is 0 if the mask begins with the target.
    """
    changes = np.flatnonzero(np.diff(flat, prepend=False))
    runs: list[int] = np.diff(changes, prepend=0, append=flat.size).tolist()
    return runs if runs[-1] or len(runs) == 1 else runs[:-1]


def decode_mask(text: str, size_wh: tuple[int, int]) -> Mask:
    """The mask (H, W) of a text.

    Raises
    ------
    ValueError
        The text is damaged, or the mask is not that of a frame of `size_wh` = (width, height).
    """
    runs = _checked_runs(text, size_wh)
    values = np.arange(len(runs)) % 2 == 1
    return np.repeat(values, runs).reshape(size_wh[::-1], order="F")


def check_mask(text: str, size_wh: tuple[int, int]) -> None:
    """Raise `ValueError` as `decode_mask`, without making the mask."""
    _checked_runs(text, size_wh)


def _checked_runs(text: str, size_wh: tuple[int, int]) -> list[int]:
    width, height = size_wh
    runs = _runs(text)
    if any(run < 0 for run in runs) or sum(runs) != width * height:
        raise ValueError(f"mask is not that of a frame of {width}x{height} pixels")
    return runs


def _runs(text: str) -> list[int]:
    runs: list[int] = []
    number = shift = 0
    for character in text:
        code = ord(character) - _ZERO
        if not 0 <= code < 2 * _MORE or shift >= _BITS * _MOST_CHARACTERS:
            raise ValueError("mask is not text as COCO encodes it")
        number |= (code & _LOW) << shift
        shift += _BITS
        if code & _MORE:
            continue
        if code & _SIGN:
            number -= 1 << shift
        runs.append(number + runs[-2] if len(runs) > 2 else number)
        number = shift = 0
    if shift:
        raise ValueError("mask is cut off")
    return runs
