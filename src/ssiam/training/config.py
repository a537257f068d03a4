"""The settings of a training run from a TOML file, and as one."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Final

from ssiam.toml_tables import read_toml
from ssiam.training.settings import TrainSettings

_SHIPPED: Final = Path(__file__).parents[1] / "configs"  # in the wheel; in a checkout, configs/


def read_config(path: Path) -> TrainSettings:
    """The settings of a training run from a TOML file; raises as `read_toml`."""
    shipped = _SHIPPED / path.name
    hint = f"; {shipped} is one to copy" if shipped.exists() else ""
    return read_toml(TrainSettings, path, "config", hint)


def config_text(settings: TrainSettings) -> str:
    """A TOML file of settings; `read_config` reads the same ones from it."""
    return "\n".join(_table("", settings)).lstrip("\n") + "\n"


def _table(name: str, settings: Any) -> Iterator[str]:
    """The lines of a dataclass and of those in it."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings)}
    inner: list[tuple[str, Any]] = []
    for key, value in values.items():
        path = f"{name}.{key}".lstrip(".")
        if is_dataclass(value):
            inner.append((f"\n[{path}]", value))
        elif isinstance(value, tuple) and any(map(is_dataclass, value)):
            inner.extend((f"\n[[{path}]]", each) for each in value)
        elif value is not None:
            # JSON's strings, lists, numbers and truth values are TOML's.
            yield f"{key} = {json.dumps(value)}"
    for header, value in inner:
        yield header
        yield from _table(header.strip("\n[]"), value)
