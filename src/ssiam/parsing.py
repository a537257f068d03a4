"""JSON, rates and numbers of untrusted text: whatever is wrong with it is one `ValueError`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any, Final, NoReturn

__all__ = ["is_number_word", "parse_json", "parse_rate"]

# Short numbers without large exponents: Fraction("1e99999999") would fill the memory.
_RATE: Final = re.compile(r"\s*[0-9]{1,9}(/0*[1-9][0-9]{0,8}|(\.[0-9]{0,12})?([eE][+-]?[0-9])?)\s*")


def parse_json(text: str | bytes, *, constants: bool = True, surrogates: bool = False) -> Any:
    """The value of a JSON text.

    Parameters
    ----------
    text : str or bytes
        Untrusted.
    constants : bool
        Whether ``NaN`` and ``Infinity``, which are not JSON, are accepted as Python accepts them.
    surrogates : bool
        Whether halves of surrogate pairs, which no file can contain, are accepted in strings.

    Raises
    ------
    ValueError
        It is not JSON (`json.JSONDecodeError`) or not text, is nested too deeply, has an integer
        with too many digits, or a string with half of a surrogate pair.
    """
    parse_constant: Callable[[str], Any] | None = None if constants else _reject_constant
    try:
        value = json.loads(text, parse_constant=parse_constant)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not surrogates and b"\\ud" in (text.encode() if isinstance(text, str) else text).lower():
        _check_surrogates(value)
    return value


def is_number_word(word: str) -> bool:
    """Whether a word consists of the digits 0 to 9 only, so that `int` accepts it.

    `str.isdigit` is also true for ``²`` and ``①``, `str.isdecimal` for digits of other scripts.
    """
    return word.isascii() and word.isdecimal()


def parse_rate(text: str) -> Fraction:
    """Frames per second: 25, 29.97 or 30000/1001.

    Raises
    ------
    ValueError
        It is not a positive number, or one with too many digits.
    """
    rate = Fraction(text) if _RATE.fullmatch(text) else Fraction(0)
    if rate <= 0:
        raise ValueError(f"{text[:40]!r} is not a rate")
    return rate


def _check_surrogates(value: Any) -> None:
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise ValueError("it has a string with half of a surrogate pair") from None


def _reject_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not JSON")
