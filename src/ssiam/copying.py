"""Base classes that define whether and how objects are copied and pickled."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, NoReturn, TypeVar

from ssiam.errors import CopyError

Self_ = TypeVar("Self_")


class DeepCopied:
    """For objects with mutable state: `copy.copy` makes a deep copy.

    A shallow copy would share some of the state with the original.
    """

    def __copy__(self: Self_) -> Self_:
        return deepcopy(self)


class NotPicklable(DeepCopied):
    """For objects that can be copied, but not pickled.

    Attributes
    ----------
    _copy_hint : str
        What to do instead, for the message.
    """

    _copy_hint = "make one where it is needed"

    def __deepcopy__(self: Self_, memo: dict[int, Any]) -> Self_:
        copied = object.__new__(type(self))
        memo[id(self)] = copied
        for name, value in vars(self).items():
            object.__setattr__(copied, name, deepcopy(value, memo))
        return copied

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise CopyError(f"{type(self).__name__} cannot be pickled: {self._copy_hint}")


class SharedOnCopy(NotPicklable):
    """For objects without mutable state: a copy is the object itself."""

    def __copy__(self: Self_) -> Self_:
        return self

    def __deepcopy__(self: Self_, memo: dict[int, Any]) -> Self_:
        return self


class NotCopyable:
    """For objects that hold a unique resource, such as an open file."""

    _copy_hint = "open another one"

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise CopyError(f"{type(self).__name__} cannot be copied or pickled: {self._copy_hint}")
