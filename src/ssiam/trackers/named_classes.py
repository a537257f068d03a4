"""Trackers of other packages, by ``package.module:Class`` or by the name of an entry point.

Loading one runs its code. A name is therefore only taken from the caller of `ssiam.load_tracker`
and from the command line, never from a file that was read or from a page: other sources of names
accept those of `ssiam.trackers.TRACKERS` alone.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Final

from ssiam.errors import ArgumentError, SsiamError, WeightsError, one_line
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.foreign import complete

ENTRY_POINTS: Final = "ssiam.trackers"
"""The group of the entry points that other packages declare."""


def is_class_path(name: object) -> bool:
    """Whether a name has the form ``package.module:Class``."""
    if not isinstance(name, str):
        return False
    module, colon, attribute = name.partition(":")
    words = [*module.split("."), *attribute.split(".")]
    return bool(colon) and all(word.isidentifier() for word in words)


def entry_point_names() -> tuple[str, ...]:
    """The names of the trackers that installed packages declare."""
    return tuple(sorted({point.name for point in entry_points(group=ENTRY_POINTS)}))


def load_named(name: str, weights: Path | None, threads: int) -> CompleteTracker:
    """Make a tracker of the class with this name.

    Parameters
    ----------
    name : str
        ``package.module:Class``, or the name of an entry point.
    weights : Path, optional
        Given to the class as `weights`, if it has a parameter of that name.
    threads : int
        Given to the class as `threads`, likewise.

    Raises
    ------
    ArgumentError
        The module cannot be imported, has no such class, or making the tracker fails.
    WeightsError
        Weights are given to a class that takes none, or are needed and not given.
    """
    found = _imported(name) if is_class_path(name) else _entry_point(name)
    if not callable(found):
        raise ArgumentError(f"tracker {name} is {type(found).__name__}, not a class: name a class")
    make = _maker(name, found, weights, threads)
    return complete(make(), make)


def _maker(
    name: str, made_by: Callable[..., Any], weights: Path | None, threads: int
) -> Callable[[], Any]:
    """A callable that makes a tracker with those of `weights` and `threads` that it takes."""
    try:
        parameters = dict(inspect.signature(made_by).parameters)
    except (TypeError, ValueError):  # classes in C without a signature
        parameters = {}
    arguments: dict[str, Any] = {}
    takes_weights = "weights" in parameters
    if weights is not None and not takes_weights:
        raise WeightsError(f"tracker {name} has no parameter weights: leave {weights} out")
    if weights is not None:
        arguments["weights"] = weights
    elif takes_weights and parameters["weights"].default is inspect.Parameter.empty:
        raise WeightsError(f"tracker {name} needs weights: give --weights PATH, weights=PATH")
    if "threads" in parameters:
        arguments["threads"] = threads
    return partial(_make, name, made_by, arguments)


def _make(name: str, made_by: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    try:
        return made_by(**arguments)
    except SsiamError:
        raise
    except (Exception, SystemExit) as error:
        raise ArgumentError(f"tracker {name} cannot be made: {one_line(error)}") from error


def _imported(name: str) -> Any:
    path, _, attribute = name.partition(":")
    module = _attempt(name, partial(importlib.import_module, path), path)
    found: Any = module
    for word in attribute.split("."):
        if not hasattr(found, word):
            raise ArgumentError(f"tracker {name}: {path} has no {attribute}{_classes(module)}")
        found = getattr(found, word)
    return found


def _entry_point(name: str) -> Any:
    """What the entry point of this name refers to; the first one, if there are several."""
    point: EntryPoint = next(iter(entry_points(group=ENTRY_POINTS, name=name)))
    return _attempt(name, point.load, point.value)


def _attempt(name: str, load: Callable[[], Any], what: str) -> Any:
    """What `load` imports; any error in it as one `ArgumentError`."""
    module = what.partition(":")[0]
    try:
        return load()
    except ModuleNotFoundError as error:
        if error.name is not None and f"{module}.".startswith(f"{error.name}."):
            raise ArgumentError(
                f"tracker {name}: there is no module {error.name}; install its package, or give "
                "its folder in PYTHONPATH"
            ) from error
        raise ArgumentError(f"tracker {name}: importing {module} failed ({error})") from error
    except (Exception, SystemExit) as error:
        raise ArgumentError(
            f"tracker {name}: importing {module} failed ({one_line(error)})"
        ) from error


def _classes(module: Any) -> str:
    """The trackers among the names of a module, for a message."""
    names = [
        name
        for name, value in vars(module).items()
        if inspect.isclass(value) and hasattr(value, "init") and hasattr(value, "update")
    ]
    return f"; it has {', '.join(names)}" if names else ", and no class with init and update"
