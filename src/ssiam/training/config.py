"""TOML files read into dataclasses; what does not fit is one line that names the file and key."""

from __future__ import annotations

import difflib
import sys
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from ssiam.errors import ArgumentError, MissingExtraError, SourceError
from ssiam.training.settings import TrainSettings

__all__ = ["from_table", "read_config"]

Settings = TypeVar("Settings")

_NAMES: Final = {int: "a whole number", float: "a number", str: "a text", bool: "true or false"}


def read_config(path: Path) -> TrainSettings:
    """The settings of a training run.

    Raises
    ------
    SourceError
        The file cannot be read.
    ArgumentError
        It is no TOML, a key is unknown or missing, or a value is of another type or impossible.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise SourceError(f"config {path} cannot be read: {reason}") from error
    try:
        return from_table(TrainSettings, _parsed(text), "")
    except ArgumentError as error:
        raise ArgumentError(f"config {path}: {error}") from error


def from_table(kind: type[Settings], table: Mapping[str, Any], where: str) -> Settings:
    """A dataclass of the values of a table; `where` is the table's name, with a dot at its end.

    Fields may be numbers, texts, flags, choices, other dataclasses, tuples of these, or None.
    """
    hints = get_type_hints(kind)
    known = {each.name: each for each in fields(kind)}  # type: ignore[arg-type]
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            raise ArgumentError(f"unknown key {where}{key}; {hint}")
    for name, each in known.items():
        if name not in table and each.default is MISSING and each.default_factory is MISSING:
            raise ArgumentError(f"{where}{name} is missing")
    values = {key: _value(hints[key], value, f"{where}{key}") for key, value in table.items()}
    return kind(**values)


def _parsed(text: str) -> dict[str, Any]:
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        try:
            import tomli as tomllib
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                "tomli is not installed, which reads configs: pip install 'ssiam[train]'"
            ) from error
    try:
        return dict(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ArgumentError(f"is no TOML: {error}") from error


def _value(kind: Any, value: Any, where: str) -> Any:
    origin, options = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):  # X | None: TOML has no None
        (kind,) = (option for option in options if option is not type(None))
        return _value(kind, value, where)
    if origin is Literal:
        if value not in options:
            raise ArgumentError(f"{where} is {value!r}: choose from {', '.join(options)}")
        return value
    if origin is tuple:
        if not isinstance(value, list):
            raise ArgumentError(f"{where} is {value!r}: give a list")
        return tuple(
            _value(item_kind, item, f"{where}[{i}]")
            for i, (item_kind, item) in enumerate(_paired(options, value, where))
        )
    if is_dataclass(kind):
        if not isinstance(value, dict):
            raise ArgumentError(f"{where} is {value!r}: give a table")
        return from_table(kind, value, f"{where}.")  # type: ignore[arg-type]
    return _plain(kind, value, where)


def _paired(options: tuple[Any, ...], values: list[Any], where: str) -> list[tuple[Any, Any]]:
    """Each item of a list with its type."""
    if options[-1] is Ellipsis:
        return [(options[0], value) for value in values]
    if len(options) != len(values):
        raise ArgumentError(f"{where} has {len(values)} values: give {len(options)}")
    return list(zip(options, values, strict=True))


def _plain(kind: Any, value: Any, where: str) -> Any:
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise ArgumentError(f"{where} is {value!r}: give {_NAMES[kind]}")
    return value
