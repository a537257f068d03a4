"""`Dataset`: sequences by their names, each read from disk when it is asked for."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError, UnknownSequenceError

Readers: TypeAlias = Mapping[str, Callable[[], VideoSequence]]


@dataclass(frozen=True)
class Options:
    """What of a dataset is read, and how.

    Attributes
    ----------
    split : str or None
        Part of the dataset ("test", "otb50", "uav20l"); None takes what lies there.
    as_published : bool
        Leave boxes as they stand in the file, 1-based ones and those without area too.
    """

    split: str | None = None
    as_published: bool = False


class LazySequences(Mapping[str, VideoSequence]):
    """Sequences by name, read anew at every look-up, so that none stays in memory.

    Where one clip has several targets, Jogging-1, Jogging.1 and Jogging_1 are the same name.

    Raises
    ------
    UnknownSequenceError
        No sequence has that name; also a `KeyError`.
    DatasetError
        Its files are missing or damaged.
    """

    def __init__(self, readers: Readers) -> None:
        self._readers = dict(readers)
        self._spellings = {_spelling(name): name for name in readers}

    def __getitem__(self, name: str) -> VideoSequence:
        exact = name if name in self._readers else self._spellings.get(_spelling(name))
        if exact is None:
            raise UnknownSequenceError(self._unknown(name))
        with dataset_errors():
            return self._readers[exact]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (
            name in self._readers or _spelling(name) in self._spellings
        )

    def _unknown(self, name: str) -> str:
        near = difflib.get_close_matches(name, self._readers, n=3) or list(self._readers)[:3]
        return f"no sequence {name!r} in this dataset; did you mean {' or '.join(near)}?"


@dataclass(frozen=True)
class Dataset:
    """A dataset on disk.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
        Name of its folder or file.
    kind : str
        One of `ssiam.datasets.KINDS`: the layout that it was read by.
    sequences : mapping of str to VideoSequence
        Read when looked up; listing the names reads nothing.
    """

    name: str
    kind: str
    sequences: Mapping[str, VideoSequence]

    def __len__(self) -> int:
        return len(self.sequences)


@contextmanager
def dataset_errors() -> Iterator[None]:
    """Turns what the disk refuses inside of it (no permission, a loop of links) into one line."""
    try:
        yield
    except OSError as error:
        raise DatasetError(f"{error.filename}: cannot be read ({error.strerror})") from error


def _spelling(name: str) -> str:
    return re.sub(r"[._](?=\d+$)", "-", name)
