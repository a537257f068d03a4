"""What copies and pickles of objects with a state are: a state of their own, or a refusal."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, NoReturn, TypeVar

from ssiam.errors import CopyError

Self_ = TypeVar("Self_")


class DeepCopied:
    """Of objects that change as they are used: `copy.copy` is `copy.deepcopy`.

    A shallow copy would go on with the other's state, half of it.
    """

    def __copy__(self: Self_) -> Self_:
        return deepcopy(self)


class NotPicklable(DeepCopied):
    """Of objects that can be copied, by `copy`, but not be sent elsewhere.

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
    """Of objects without a state: a copy is the object itself."""

    def __copy__(self: Self_) -> Self_:
        return self

    def __deepcopy__(self: Self_, memo: dict[int, Any]) -> Self_:
        return self


class NotCopyable:
    """Of objects that hold what exists once, such as an open file: neither copied nor pickled."""

    _copy_hint = "open another one"

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise CopyError(f"{type(self).__name__} cannot be copied or pickled: {self._copy_hint}")
