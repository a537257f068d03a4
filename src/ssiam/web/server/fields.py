"""`Fields`: what stands in a client's message, each field strictly read."""

from __future__ import annotations

import json
from typing import Any, Final

from ssiam.geometry import XYWH
from ssiam.web.errors import CommandError

LARGEST_NUMBER: Final = 2**53
"""Whole numbers above are not exact in browsers."""

_FARTHEST: Final = 1e6  # pixels
_LONGEST_NAME: Final = 40


class Fields:
    """The fields of a JSON object; all methods raise `CommandError` for what cannot be used.

    Parameters
    ----------
    text : str
        From a client: anything.
    """

    def __init__(self, text: str) -> None:
        try:
            values = json.loads(text, parse_constant=_no_constant)
        except (ValueError, RecursionError):
            raise bad_message("this is no JSON that can be used") from None
        if not isinstance(values, dict):
            raise bad_message("a message is a JSON object with a type")
        self._values: dict[str, Any] = values

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def is_null(self, name: str) -> bool:
        """Whether a field is missing, or null."""
        return self._values.get(name) is None

    def word(self, name: str) -> str:
        """Some text; empty if it is none."""
        value = self._values.get(name)
        return value if isinstance(value, str) else ""

    def name(self) -> str:
        """The `name` of a target."""
        value = self._values.get("name")
        name = " ".join(value.split()) if isinstance(value, str) else ""
        # Half of a surrogate pair is not printable either: it could not be sent on.
        if not 0 < len(name) <= _LONGEST_NAME or not name.isprintable():
            raise bad_message(
                f"name has 1 to {_LONGEST_NAME} characters that can be read, not {short(value)}"
            )
        return name

    def integer(self, name: str, low: int, high: int) -> int:
        """A whole number."""
        value = self._values.get(name)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise bad_message(f"{name} is a whole number from {low} to {high}, not {short(value)}")
        return value

    def flag(self, name: str) -> bool:
        """True or false."""
        value = self._values.get(name)
        if not isinstance(value, bool):
            raise bad_message(f"{name} is true or false, not {short(value)}")
        return value

    def box(self) -> XYWH:
        """The `box` (x, y, w, h), pixels; not empty, and not far out."""
        box = self._values.get("box")
        if not isinstance(box, list) or len(box) != 4 or not all(_is_number(v) for v in box):
            raise bad_message(f"box is [x, y, width, height] in pixels, not {short(box)}")
        x, y, w, h = (float(value) for value in box)
        if max(abs(x), abs(y), w, h) > _FARTHEST or min(w, h) <= 0:
            raise CommandError("bad-box", f"box {x:g}, {y:g}, {w:g}, {h:g} is empty or too large")
        return x, y, w, h


def bad_message(message: str) -> CommandError:
    """The error of a message that cannot be used."""
    return CommandError("bad-message", message)


def short(value: object) -> str:
    """A value for an error message, on one line; it may be anything, of any size."""
    if isinstance(value, int) and abs(value) > LARGEST_NUMBER:
        return "such a large one"
    if isinstance(value, (str, int, float)) or value is None:
        return ascii(value)[:_LONGEST_NAME]
    return f"a {type(value).__name__}"


def _no_constant(name: str) -> None:
    raise ValueError(name)


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    # False for what 1e999 is read as, and for integers that no float holds.
    return abs(value) <= LARGEST_NUMBER
