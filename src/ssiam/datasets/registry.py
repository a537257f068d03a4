"""`open_dataset`: finds the reader for any dataset folder or file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from ssiam.datasets import clips, dtb70, got10k, lasot, mot, otb, pysot, uav123, vot
from ssiam.datasets.dataset import Dataset, LazySequences, Options, Readers, dataset_errors
from ssiam.datasets.files import subfolders
from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError, check_choice

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
    readers: dict[str, Callable[[], VideoSequence]] = {}
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


_MIXED = "folder"
_JSON = "pysot"
KINDS = (*LAYOUTS, _JSON, _MIXED)

_EXPECTS_ANY = (
    "a folder of sequences as VOT, OTB, UAV123, DTB70, GOT-10k, LaSOT or MOTChallenge publish "
    "them, a .json of pysot, or images or videos with a .txt of boxes"
)
# Entries of a folder that a message lists.
_SHOWN = 4


def open_dataset(
    path: str | Path,
    kind: str | None = None,
    *,
    split: str | None = None,
    as_published: bool = False,
) -> Dataset:
    """The dataset in a folder or file, its layout recognised by looking.

    No image is opened, and each sequence's files are read when it is looked up.

    Parameters
    ----------
    path : str or Path
        Folder of a dataset, of one sequence, or of sequences of several layouts side by side;
        one of pysot's JSON files; or a video with a box file beside it.
    kind : str, optional
        One of `KINDS`, to read it as that and nothing else. "folder" is for mixed sequences.
    split : str, optional
        Part of it: "otb50", "otb100"; "uav123", "uav20l", "uav123_10fps"; "train", "val", "test"
        of GOT-10k; "train", "test" of LaSOT. Without it, all that is there; of UAV123 folders
        the 30 frames a second.
    as_published : bool
        Leave the boxes as they stand in the files. Without it those of OTB and LaSOT, which are
        1-based, are brought to 0-based ones, and boxes without area become nan.

    Returns
    -------
    Dataset

    Raises
    ------
    DatasetError
        Nothing of the expected layout is there; one line says what was expected and found.
    """
    if kind is not None:
        check_choice("kind of dataset", kind, KINDS)
    path = Path(path)
    with dataset_errors():
        found, readers = _found(path, kind, Options(split, as_published))
        name = path.resolve().stem if path.is_file() else path.resolve().name
    return Dataset(name, found, LazySequences(readers))


def _found(path: Path, kind: str | None, options: Options) -> tuple[str, Readers]:
    if path.is_dir():
        return _in_folder(path, kind, options)
    if not path.is_file():
        raise DatasetError(f"{path}: there is no such folder or file; check the path")
    if path.suffix.lower() == ".json" and kind in (None, _JSON):
        found, readers = _JSON, pysot.sequences_in_file(path)
    elif clips.is_video(path) and kind in (None, "clip"):
        found, readers = "clip", clips.sequence_of_video(path, options)
    else:
        raise DatasetError(f"{path}: is a file; expected {_expected(kind)}")
    _check_split(path, found, options.split)
    return found, readers


def _in_folder(path: Path, kind: str | None, options: Options) -> tuple[str, Readers]:
    kinds = tuple(LAYOUTS) if kind in (None, _MIXED) else (kind,) if kind in LAYOUTS else ()
    everything = Options(None, options.as_published)
    kinds_found, readers = search(path, kinds, everything)
    if not readers and kind in (None, _JSON):
        kinds_found, readers = _json_in(path)
    if not readers:
        raise DatasetError(f"{path}: expected {_expected(kind)}; found {_content(path)}")
    found = kinds_found.pop() if len(kinds_found) == 1 and kind != _MIXED else _MIXED
    _check_split(path, found, options.split)
    if options.split is not None:
        readers = search(path, (found,), options)[1]
    if not readers:
        raise DatasetError(f"{path}: holds no sequence of the split {options.split!r}")
    return found, readers


def _json_in(folder: Path) -> tuple[set[str], Readers]:
    """The sequences of the JSON file of the folder's name, or of the only one in it."""
    files = sorted(folder.glob("*.json"))
    named = [path for path in files if path.stem == folder.name] or files
    return ({_JSON}, pysot.sequences_in_file(named[0])) if len(named) == 1 else (set(), {})


def _check_split(path: Path, kind: str, split: str | None) -> None:
    splits = LAYOUTS[kind].splits if kind in LAYOUTS else ()
    if split is not None and split not in splits:
        known = f"choose from {', '.join(splits)}" if splits else f"{kind} has none, leave it out"
        raise DatasetError(f"{path}: no split {split!r}: {known}")


def _expected(kind: str | None) -> str:
    if kind == _JSON:
        return pysot.EXPECTS
    return LAYOUTS[kind].expects if kind in LAYOUTS else _EXPECTS_ANY


def _content(folder: Path) -> str:
    """What lies in a folder, in a few words: names of folders, counts of files by suffix."""
    entries = sorted(folder.iterdir())
    folders = [path.name for path in entries if path.is_dir()]
    files = Counter(path.suffix or path.name for path in entries if not path.is_dir())
    parts = [f"{count} {suffix}" for suffix, count in files.most_common(_SHOWN)]
    if folders:
        more = ", ..." if len(folders) > _SHOWN else ""
        parts.append(
            f"{len(folders)} folder{'s' * (len(folders) > 1)} ({', '.join(folders[:_SHOWN])}{more})"
        )
    return ", ".join(parts) or "an empty folder"
