"""Memory that is kept between steps: giving it back to the system costs half of the time."""

from __future__ import annotations

import ctypes
import platform
from typing import Final

__all__ = ["keep_freed_memory"]

# Of malloc.h: blocks of any size come from the heap, whose end is not given back.
_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_MAX = -1, -2, -4
_NEVER: Final = 2**31 - 1  # bytes
_AT_ONCE: Final = 2**28  # bytes, by which the heap grows


def keep_freed_memory() -> None:
    """Have this process keep what it frees. Only glibc can be told; elsewhere nothing is done.

    The features of large crops are freed and asked for again in every step, and fresh pages have
    to be cleared by the system first.
    """
    if platform.libc_ver()[0] != "glibc":
        return
    mallopt = ctypes.CDLL(None).mallopt
    mallopt(_M_MMAP_MAX, 0)
    mallopt(_M_TRIM_THRESHOLD, _NEVER)
    mallopt(_M_TOP_PAD, _AT_ONCE)
