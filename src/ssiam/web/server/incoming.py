"""`parse_message`: strict parsing of clients' messages (docs/reference/live-protocol.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias, get_args

from ssiam.geometry import XYWH
from ssiam.parsing import parse_json
from ssiam.stabilize import Method
from ssiam.web.types import (
    MAX_NAME_LENGTH,
    Add,
    Advance,
    CameraName,
    CommandError,
    ErrorCode,
    Hold,
    Pause,
    Record,
    Remove,
    Rename,
    Restart,
    Stabilize,
    SwitchCamera,
    normalized_name,
)

METHODS: Final[tuple[Method, ...]] = ("off", "paper", "predict")
"""The methods that `steady` takes. "literal" is for ablation studies, not for live use."""

_MAX_ASK: Final = 2**31
MAX_NUMBER: Final = 2**53
"""Larger integers are not exact in browsers."""

_MAX_PIXELS: Final = 1e6  # of a box's position and size
_MAX_QUOTED: Final = 40  # characters of a value in an error message
_WIDTHS: Final = (64, 4096)
_QUALITIES: Final = (30, 95)


@dataclass(frozen=True)
class View:
    """Which images a client requests, their maximum width (pixels) and JPEG quality."""

    raw: bool = True
    stabilized: bool = True
    width: int = 960
    quality: int = 80


@dataclass(frozen=True)
class Acknowledge:
    """A client has received the step of this number."""

    number: int


@dataclass(frozen=True)
class Message:
    """A client's message: `View`, `Acknowledge`, or a command for the service.

    `ask` is a number that the answer repeats.
    """

    content: Any
    ask: int | None = None


class BadMessage(CommandError):
    """A message that cannot be used.

    Attributes
    ----------
    ask : int or None
        Number that the answer repeats, if it could be read.
    """

    def __init__(self, code: ErrorCode, message: str, ask: int | None = None) -> None:
        super().__init__(code, message)
        self.ask = ask


def parse_message(text: str, parsers: Parsers | None = None) -> Message:
    """Parse a client's text message.

    Parameters
    ----------
    text : str
        Untrusted.
    parsers : mapping, optional
        A function for each type of message, from its fields to the content; by default those of
        the live protocol. `VIEW_PARSERS` has those that every page sends.

    Raises
    ------
    BadMessage
        The text is not a JSON object, its type is unknown, or a field is missing, of the wrong
        type or out of range. Unknown fields are ignored.
    """
    ask = None
    try:
        fields = Fields(text)
        if "ask" in fields:
            ask = fields.integer("ask", 0, _MAX_ASK)
        kind = fields.word("type")
        known = _LIVE_PARSERS if parsers is None else parsers
        if kind not in known:
            raise _bad_message(f"unknown type {_short(kind)}; see docs/reference/live-protocol.md")
        return Message(known[kind](fields), ask)
    except CommandError as error:
        raise BadMessage(error.code, str(error), ask) from None


class Fields:
    """The fields of a JSON object; methods raise `CommandError` for invalid values.

    Parameters
    ----------
    text : str
        Untrusted.
    """

    def __init__(self, text: str) -> None:
        try:
            # A string that is not used must not keep a message from being answered.
            values = parse_json(text, constants=False, surrogates=True)
        except ValueError:
            raise _bad_message("the message is not valid JSON") from None
        if not isinstance(values, dict):
            raise _bad_message("a message is a JSON object with a type")
        self._values: dict[str, Any] = values

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def is_null(self, name: str) -> bool:
        """Whether a field is missing or null."""
        return self._values.get(name) is None

    def word(self, name: str) -> str:
        """A string; empty if the value is not one."""
        value = self._values.get(name)
        return value if isinstance(value, str) else ""

    def name(self) -> str:
        """The `name` of a target, with its white space normalized."""
        value = self._values.get("name")
        name = normalized_name(value) if isinstance(value, str) else None
        if name is None:
            raise _bad_message(
                f"name must be 1 to {MAX_NAME_LENGTH} printable characters, not {_short(value)}"
            )
        return name

    def integer(self, name: str, low: int, high: int) -> int:
        """An integer from `low` to `high`."""
        value = self._values.get(name)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise _bad_message(
                f"{name} must be an integer from {low} to {high}, not {_short(value)}"
            )
        return value

    def flag(self, name: str) -> bool:
        """A boolean."""
        value = self._values.get(name)
        if not isinstance(value, bool):
            raise _bad_message(f"{name} must be true or false, not {_short(value)}")
        return value

    def box(self) -> XYWH:
        """The `box` (x, y, w, h), pixels, with a positive size and plausible coordinates."""
        box = self._values.get("box")
        if not isinstance(box, list) or len(box) != 4 or not all(_is_number(v) for v in box):
            raise _bad_message(f"box must be [x, y, width, height] in pixels, not {_short(box)}")
        x, y, w, h = (float(value) for value in box)
        if max(abs(x), abs(y), w, h) > _MAX_PIXELS or min(w, h) <= 0:
            raise CommandError("bad-box", f"box {x:g}, {y:g}, {w:g}, {h:g} is empty or too large")
        return x, y, w, h

    def point(self) -> tuple[float, float]:
        """The `point` (x, y), pixels, with plausible coordinates."""
        point = self._values.get("point")
        if not isinstance(point, list) or len(point) != 2 or not all(map(_is_number, point)):
            raise _bad_message(f"point must be [x, y] in pixels, not {_short(point)}")
        return float(point[0]), float(point[1])


Parsers: TypeAlias = Mapping[str, Callable[[Fields], Any]]
"""From the fields of a message to its content, by the message's type."""


def _add(fields: Fields) -> Any:
    number = None if fields.is_null("number") else _number(fields)
    name = None if fields.is_null("name") else fields.name()
    return Add(fields.box(), number, name)


def _remove(fields: Fields) -> Any:
    # JavaScript serializes NaN as null, so null must not stand for all targets.
    return Remove(_id(fields) if "id" in fields else None)


def _stabilize(fields: Fields) -> Any:
    for method in METHODS:
        if fields.word("method") == method:
            return Stabilize(method)
    raise _bad_message(f"method must be one of {', '.join(METHODS)}")


def _camera(fields: Fields) -> Any:
    for camera in get_args(CameraName):
        if fields.word("camera") == camera:
            return SwitchCamera(camera)
    raise _bad_message(f"camera must be one of {', '.join(get_args(CameraName))}")


def _view(fields: Fields) -> Any:
    return View(
        fields.flag("raw"),
        fields.flag("steadied"),
        fields.integer("width", *_WIDTHS),
        fields.integer("quality", *_QUALITIES),
    )


def _number(fields: Fields) -> int:
    return fields.integer("number", 1, MAX_NUMBER)


def _id(fields: Fields) -> int:
    return fields.integer("id", 1, MAX_NUMBER)


VIEW_PARSERS: Final[Parsers] = {
    "view": _view,
    "shown": lambda fields: Acknowledge(_number(fields)),
}
"""Of the messages about the images that a client is sent."""

_LIVE_PARSERS: Final[Parsers] = {
    "add": _add,
    "hold": lambda fields: Hold(_number(fields)),
    "remove": _remove,
    "rename": lambda fields: Rename(_id(fields), fields.name()),
    "steady": _stabilize,
    "camera": _camera,
    "pause": lambda fields: Pause(True),
    "resume": lambda fields: Pause(False),
    "advance": lambda fields: Advance(),
    "restart": lambda fields: Restart(),
    "seek": lambda fields: Restart(fields.integer("index", 0, MAX_NUMBER)),
    "record": lambda fields: Record(fields.flag("on")),
    **VIEW_PARSERS,
}


def _bad_message(message: str) -> CommandError:
    return CommandError("bad-message", message)


def _short(value: object) -> str:
    """A value of any type and size, shortened to one line for an error message."""
    if isinstance(value, int) and abs(value) > MAX_NUMBER:
        return "a larger one"
    if isinstance(value, (str, int, float)) or value is None:
        return ascii(value)[:_MAX_QUOTED]
    return f"a {type(value).__name__}"


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    # False for 1e999, which is parsed as infinity, and for integers that no float holds.
    return abs(value) <= MAX_NUMBER
