"""`join_box_words`: ``--box 120 80 40 60`` as one word, before the arguments are parsed."""

from __future__ import annotations

import re
from collections.abc import Sequence

_OPTION = "--box"
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")


def join_box_words(words: Sequence[str]) -> list[str]:
    """The words, with the four numbers after each ``--box`` joined by commas.

    The first number may follow a time: ``--box 12s:120 80 40 60``. Other forms are kept.
    """
    joined: list[str] = []
    rest = list(words)
    while rest:
        word = rest.pop(0)
        joined.append(word)
        if word == "--":
            return joined + rest
        if word == _OPTION and rest:
            joined.append(rest.pop(0))
        elif not word.startswith(f"{_OPTION}="):
            continue
        first = joined[-1].removeprefix(f"{_OPTION}=").rpartition(":")[2]
        if all(_NUMBER.fullmatch(each) for each in (first, *rest[:3])) and len(rest) >= 3:
            joined[-1] = ",".join([joined[-1], *rest[:3]])
            del rest[:3]
    return joined
