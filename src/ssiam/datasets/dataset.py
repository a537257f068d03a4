"""`Dataset`: sequences by name, each read from disk when it is looked up."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError, UnknownSequenceError, similar_names

Readers: TypeAlias = Mapping[str, Callable[[], VideoSequence]]


@dataclass(frozen=True)
class Options:
    """Options of `open_dataset`.

    Attributes
    ----------
    split : str or None
        Part of the dataset ("test", "otb50", "uav20l"); None for all sequences in the folder.
    as_published : bool
        Do not convert boxes: keep 1-based boxes and those without area.
    """

    split: str | None = None
    as_published: bool = False


class LazySequences(Mapping[str, VideoSequence]):
    """Sequences by name, read at every lookup, so that none stays in memory.

    The last number of a name may be separated by "-", "." or "_": Jogging-1, Jogging.1, Jogging_1.

    Raises
    ------
    UnknownSequenceError
        There is no sequence of that name; also a `KeyError`.
    DatasetError
        Its files are missing or damaged.
    """

    def __init__(self, readers: Readers) -> None:
        self._readers = dict(readers)
        self._by_spelling = {_spelling(name): name for name in readers}

    def __getitem__(self, name: str) -> VideoSequence:
        exact = name if name in self._readers else self._by_spelling.get(_spelling(name))
        if exact is None:
            raise UnknownSequenceError(self._unknown_message(name))
        with dataset_errors():
            return self._readers[exact]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (
            name in self._readers or _spelling(name) in self._by_spelling
        )

    def _unknown_message(self, name: str) -> str:
        near = similar_names(name, self._readers)
        near = near or difflib.get_close_matches(name, self._readers, n=3)
        near = near or list(self._readers)[:3]
        return f"no sequence {name!r} in this dataset; did you mean {' or '.join(near)}?"


@dataclass(frozen=True)
class Dataset:
    """A dataset on disk.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
        Name of the folder or file.
    kind : str
        One of `ssiam.datasets.KINDS`: the layout.
    sequences : mapping of str to VideoSequence
        By name. Each is read when it is looked up; listing the names reads nothing.
    """

    name: str
    kind: str
    sequences: Mapping[str, VideoSequence]

    def __len__(self) -> int:
        return len(self.sequences)


@contextmanager
def dataset_errors() -> Iterator[None]:
    """Turn an `OSError` (no permission, a loop of links) into a one-line `DatasetError`."""
    try:
        yield
    except OSError as error:
        raise DatasetError(f"{error.filename}: cannot be read ({error.strerror})") from error


def _spelling(name: str) -> str:
    """A name with "-" before its last number, where some tools write "." or "_"."""
    return re.sub(r"[._](?=\d+$)", "-", name)
