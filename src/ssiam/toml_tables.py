"""TOML files read into settings dataclasses, with one-line errors that name file and key."""

from __future__ import annotations

import difflib
import sys
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from ssiam.errors import ArgumentError, MissingExtraError, SourceError

__all__ = ["from_table", "read_toml"]

Settings = TypeVar("Settings")

_MAX_BYTES: Final = 1024 * 1024  # of a config; those shipped have less than 10,000
_MAX_QUOTED: Final = 80  # characters of a value in a message
_INT_RANGE: Final = 2**63  # of TOML's integers
_TYPE_NAMES: Final = {int: "an integer", float: "a number", str: "a string", bool: "true or false"}


def read_toml(kind: type[Settings], path: Path, name: str = "config", hint: str = "") -> Settings:
    """The settings in a TOML file, which may be untrusted.

    Parameters
    ----------
    kind : type
        A dataclass, as for `from_table`.
    path : Path
    name : str
        What the file is, for messages.
    hint : str
        End of the message if the file cannot be read.

    Raises
    ------
    SourceError
        The file cannot be read.
    ArgumentError
        It is not valid TOML, a key is unknown or missing, or a value has the wrong type or range.
    MissingExtraError
        Python is older than 3.11 and tomli is not installed.
    """
    try:
        with path.open("rb") as file:
            text = file.read(_MAX_BYTES + 1).decode("utf-8").replace("\r\n", "\n")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not a text file"
        raise SourceError(f"{name} {path} cannot be read: {reason}{hint}") from error
    if len(text) > _MAX_BYTES:
        raise SourceError(f"{name} {path} has more than {_MAX_BYTES} bytes: give a TOML file")
    try:
        return from_table(kind, _parse(text))
    except ArgumentError as error:
        raise ArgumentError(f"{name} {path}: {error}") from error


def from_table(kind: type[Settings], table: Mapping[str, Any], prefix: str = "") -> Settings:
    """A dataclass from the values of a table.

    Parameters
    ----------
    kind : type
        A dataclass. Its fields are numbers, strings, flags, literals, dataclasses, or tuples of
        these, and may be optional.
    table : mapping
    prefix : str
        Name of the table with a trailing dot, for messages.

    Raises
    ------
    ArgumentError
        A key is unknown or missing, or a value has the wrong type or range.
    """
    hints = get_type_hints(kind)
    known = {each.name: each for each in fields(kind)}  # type: ignore[arg-type]
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            raise ArgumentError(f"unknown key {prefix}{key}; {hint}")
    for name, each in known.items():
        if name not in table and each.default is MISSING and each.default_factory is MISSING:
            raise ArgumentError(f"{prefix}{name} is missing")
    values = {key: _convert(hints[key], value, f"{prefix}{key}") for key, value in table.items()}
    return kind(**values)


def _parse(text: str) -> dict[str, Any]:
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        try:
            import tomli as tomllib
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                "the package tomli is not installed, which configs need: pip install 'ssiam[train]'"
            ) from error
    try:
        return dict(tomllib.loads(text))
    except RecursionError:
        raise ArgumentError("not valid TOML: it is nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        raise ArgumentError(f"not valid TOML: {error}") from error
    except ValueError as error:
        raise ArgumentError("not valid TOML: it has a number of too many digits") from error


def _convert(kind: Any, value: Any, name: str) -> Any:
    origin, options = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):  # X | None: TOML has no None
        (kind,) = (option for option in options if option is not type(None))
        return _convert(kind, value, name)
    if origin is Literal:
        if value not in options:
            raise ArgumentError(f"{name} is {_quoted(value)}: choose from {', '.join(options)}")
        return value
    if origin is tuple:
        if not isinstance(value, list):
            raise ArgumentError(f"{name} is {_quoted(value)}: give a list")
        return tuple(
            _convert(item_kind, item, f"{name}[{i}]")
            for i, (item_kind, item) in enumerate(_with_types(options, value, name))
        )
    if is_dataclass(kind):
        if not isinstance(value, dict):
            raise ArgumentError(f"{name} is {_quoted(value)}: give a table")
        return from_table(kind, value, f"{name}.")  # type: ignore[arg-type]
    return _convert_plain(kind, value, name)


def _with_types(options: tuple[Any, ...], values: list[Any], name: str) -> list[tuple[Any, Any]]:
    """Each item of a list with its type."""
    if options[-1] is Ellipsis:
        return [(options[0], value) for value in values]
    if len(options) != len(values):
        raise ArgumentError(f"{name} has {len(values)} values: give {len(options)}")
    return list(zip(options, values, strict=True))


def _convert_plain(kind: Any, value: Any, name: str) -> Any:
    if type(value) is int and not -_INT_RANGE <= value < _INT_RANGE:
        raise ArgumentError(f"{name} is an integer of {value.bit_length()} bits: TOML has 64")
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise ArgumentError(f"{name} is {_quoted(value)}: give {_TYPE_NAMES[kind]}")
    return value


def _quoted(value: Any) -> str:
    """A value in a message, shortened."""
    try:
        text = repr(value)
    except ValueError:  # an integer of too many digits, written as 0xffff...
        return f"a {type(value).__name__}"
    return text if len(text) <= _MAX_QUOTED else f"{text[:_MAX_QUOTED]}..."
