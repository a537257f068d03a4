"""`parse_message`: what clients send (docs/reference/live-protocol.md), strictly read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

from ssiam.stabilize import Method
from ssiam.web import commands
from ssiam.web.commands import Command
from ssiam.web.errors import Code, CommandError
from ssiam.web.server.fields import LARGEST_NUMBER, Fields, bad_message, short

METHODS: Final[tuple[Method, ...]] = ("off", "paper", "predict")
"""What `steady` takes; "literal" is for studies, not for watching."""

_LARGEST_ASK: Final = 2**31
_WIDTHS: Final = (64, 4096)
_QUALITIES: Final = (30, 95)


@dataclass(frozen=True)
class View:
    """What a client wants to see: which pictures, at most how wide (pixels), JPEG quality."""

    raw: bool = True
    steadied: bool = True
    width: int = 960
    quality: int = 80


@dataclass(frozen=True)
class Shown:
    """The step of this number is on the client's screen."""

    number: int


Content: TypeAlias = Command | View | Shown


@dataclass(frozen=True)
class Message:
    """A client's message, and the number that its answer repeats."""

    content: Content
    ask: int | None = None


class BadMessage(CommandError):
    """A message that cannot be used.

    Attributes
    ----------
    ask : int or None
        Of the message, where that much could be read.
    """

    def __init__(self, code: Code, message: str, ask: int | None = None) -> None:
        super().__init__(code, message)
        self.ask = ask


def parse_message(text: str) -> Message:
    """Read a client's text message.

    Raises
    ------
    BadMessage
        It is no JSON object, of no known type, or a field of it is missing, of another type or
        out of its range. Fields that nobody knows are left alone.
    """
    ask = None
    try:
        fields = Fields(text)
        if "ask" in fields:
            ask = fields.integer("ask", 0, _LARGEST_ASK)
        kind = fields.word("type")
        if kind not in _READERS:
            raise bad_message(
                f"there is no type {short(kind)}; see docs/reference/live-protocol.md"
            )
        return Message(_READERS[kind](fields), ask)
    except CommandError as error:
        raise BadMessage(error.code, str(error), ask) from None


def _add(fields: Fields) -> Content:
    number = None if fields.is_null("number") else _number(fields)
    name = None if fields.is_null("name") else fields.name()
    return commands.Add(fields.box(), number, name)


def _remove(fields: Fields) -> Content:
    # JavaScript writes NaN as null: only a missing id means all of them.
    return commands.Remove(_id(fields) if "id" in fields else None)


def _steady(fields: Fields) -> Content:
    for method in METHODS:
        if fields.word("method") == method:
            return commands.Steady(method)
    raise bad_message(f"method is one of {', '.join(METHODS)}")


def _view(fields: Fields) -> Content:
    return View(
        fields.flag("raw"),
        fields.flag("steadied"),
        fields.integer("width", *_WIDTHS),
        fields.integer("quality", *_QUALITIES),
    )


def _number(fields: Fields) -> int:
    return fields.integer("number", 1, LARGEST_NUMBER)


def _id(fields: Fields) -> int:
    return fields.integer("id", 1, LARGEST_NUMBER)


_READERS: Final[dict[str, Callable[[Fields], Content]]] = {
    "add": _add,
    "hold": lambda fields: commands.Hold(_number(fields)),
    "remove": _remove,
    "rename": lambda fields: commands.Rename(_id(fields), fields.name()),
    "steady": _steady,
    "pause": lambda fields: commands.Pause(True),
    "resume": lambda fields: commands.Pause(False),
    "advance": lambda fields: commands.Advance(),
    "restart": lambda fields: commands.Restart(),
    "record": lambda fields: commands.Record(fields.flag("on")),
    "view": _view,
    "shown": lambda fields: Shown(_number(fields)),
}
