"""Masks as COCO's compressed run lengths."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from ssiam.video.mask_codec import decode_mask, encode_mask


def rectangle(size_wh, left, top, right, bottom):
    mask = np.zeros(size_wh[::-1], dtype=bool)
    mask[top:bottom, left:right] = True
    return mask


def ellipse():
    y, x = np.mgrid[:48, :64]
    return ((x - 30) / 12) ** 2 + ((y - 20) / 8) ** 2 < 1


# As pycocotools 2.0.11 writes them: mask.encode(np.asfortranarray(m.astype(np.uint8)))["counts"].
KNOWN = [
    pytest.param(np.zeros((3, 4), bool), "<", id="empty"),
    pytest.param(np.ones((3, 4), bool), "0<", id="full"),
    pytest.param(rectangle((20, 10), 3, 2, 7, 8), "P16400000P4", id="rectangle"),
    pytest.param(ellipse(), "Qm07X12N2O0O2O0O2O00000000000000000001N101N101N2N`P1", id="ellipse"),
]


@pytest.mark.parametrize(("mask", "text"), KNOWN)
def test_as_pycocotools_writes_and_reads_it(mask, text):
    assert encode_mask(mask) == text
    assert (decode_mask(text, mask.shape[::-1]) == mask).all()


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=30)))
def test_round_trip(mask):
    text = encode_mask(mask)
    assert (decode_mask(text, mask.shape[::-1]) == mask).all()
    assert text.isascii()
    assert not set(text) & set(',"\n ')


def test_long_runs_round_trip():
    mask = rectangle((4000, 3000), 1, 2, 3999, 2999)
    assert (decode_mask(encode_mask(mask), (4000, 3000)) == mask).all()


@pytest.mark.parametrize("text", ["", "<<", "0;", "P", "~", "\u00e9", "oooooooooo0", "N<"])
def test_damaged_text_is_refused(text):
    with pytest.raises(ValueError, match="mask"):
        decode_mask(text, (4, 3))


@given(st.text(max_size=12))
def test_any_text_is_a_mask_or_an_error(text):
    with contextlib.suppress(ValueError):
        assert decode_mask(text, (4, 3)).shape == (3, 4)
