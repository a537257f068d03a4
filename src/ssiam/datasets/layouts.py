"""The layouts by their names, and the search for sequences of one of them in a folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from ssiam.datasets import clips, dtb70, got10k, lasot, mot, otb, uav123, vot
from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.errors import DatasetError
from ssiam.datasets.files import subfolders
from ssiam.datasets.sequence import Sequence

# Folders below the dataset's own in which sequences lie: LaSOT/airplane/airplane-1.
_DEEPEST = 2


@dataclass(frozen=True)
class Layout:
    """How a kind of dataset lies on disk.

    Attributes
    ----------
    sequences_in : callable
        The sequences that a single folder holds; empty if it is not of this layout.
    expects : str
        What such a folder holds, for messages.
    splits : tuple of str
        Names of the parts that can be asked for.
    """

    sequences_in: Callable[[Path, Options], Readers]
    expects: str
    splits: tuple[str, ...] = ()


# In the order in which a folder is tried: the more special before the more general.
LAYOUTS: dict[str, Layout] = {
    "mot": Layout(mot.sequences_in, mot.EXPECTS),
    "uav123": Layout(uav123.sequences_in, uav123.EXPECTS, uav123.SPLITS),
    "dtb70": Layout(dtb70.sequences_in, dtb70.EXPECTS),
    "otb": Layout(otb.sequences_in, otb.EXPECTS, otb.SPLITS),
    "lasot": Layout(lasot.sequences_in, lasot.EXPECTS, lasot.SPLITS),
    "got10k": Layout(got10k.sequences_in, got10k.EXPECTS, got10k.SPLITS),
    "vot": Layout(vot.sequences_in, vot.EXPECTS),
    "clip": Layout(clips.sequences_in, clips.EXPECTS),
}


def search(folder: Path, kinds: Iterable[str], options: Options) -> tuple[set[str], Readers]:
    """The sequences in `folder`, or else in the folders in it, or else in those in them.

    Returns
    -------
    found : set of str
        The kinds of those that were found; empty if there are none.
    readers : mapping of str to callable
        What reads each of them, by name.

    Raises
    ------
    DatasetError
        Two sequences have one name, or a list.txt names what is not there.
    """
    kinds = tuple(kinds)
    folders = [folder]
    for depth in range(_DEEPEST + 1):
        found, readers = _in_folders(folders, kinds, options)
        if found:
            return found, readers
        if depth < _DEEPEST:
            folders = [inner for outer in folders for inner in subfolders(outer)]
    return set(), {}


def _in_folders(
    folders: Iterable[Path], kinds: tuple[str, ...], options: Options
) -> tuple[set[str], Readers]:
    found: Counter[str] = Counter()
    readers: dict[str, Callable[[], Sequence]] = {}
    for folder in folders:
        kind, inner = _first_match(folder, kinds, options)
        # OTB is often kept with copies Jogging-1 and -2 beside Jogging; they are the same.
        clash = sorted(set(inner) & set(readers)) if kind != "otb" else []
        if clash:
            raise DatasetError(f"{folder}: a second sequence is called {clash[0]!r}; rename one")
        found[kind] += len(inner)
        for name, reader in inner.items():
            readers.setdefault(name, reader)
    return set(+found), readers


def _first_match(folder: Path, kinds: tuple[str, ...], options: Options) -> tuple[str, Readers]:
    for kind in kinds:
        readers = LAYOUTS[kind].sequences_in(folder, options)
        if readers:
            return kind, readers
    return "", {}
