"""`open_dataset`: finds the reader for a dataset folder or file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ssiam.datasets import clips, dtb70, got10k, lasot, mot, otb, pysot, uav123, vot
from ssiam.datasets.dataset import Dataset, LazySequences, Options, Readers, dataset_errors
from ssiam.datasets.files import subfolders
from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError, check_choice


@dataclass(frozen=True)
class Layout:
    """A folder layout, and its reader.

    Attributes
    ----------
    sequences_in : callable
        Returns the readers of the sequences in a folder; empty if it has another layout.
    expects : str
        The files of such a folder, for messages.
    splits : tuple of str
        Names of the splits.
    """

    sequences_in: Callable[[Path, Options], Readers]
    expects: str
    splits: tuple[str, ...] = ()


# In the order in which a folder is tested: the more specific layouts first.
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

_MIXED: Final = "folder"
_JSON: Final = "pysot"
KINDS = (*LAYOUTS, _JSON, _MIXED)

_MAX_DEPTH: Final = 2  # folders between the dataset and its sequences: LaSOT/airplane/airplane-1
_MAX_LISTED: Final = 4  # entries of a folder in a message
_EXPECTS_ANY: Final = (
    "a folder of sequences as VOT, OTB, UAV123, DTB70, GOT-10k, LaSOT or MOTChallenge publish "
    "them, a .json of pysot, or images or videos with a .txt of boxes"
)


def open_dataset(
    path: str | Path,
    kind: str | None = None,
    *,
    split: str | None = None,
    as_published: bool = False,
) -> Dataset:
    """Open the dataset in a folder or file; the layout is recognized.

    No image is opened, and the files of a sequence are read when it is looked up.

    Parameters
    ----------
    path : str or Path
        Folder of a dataset, of one sequence, or of sequences of several layouts; one of pysot's
        JSON files; or a video with a box file beside it.
    kind : str, optional
        One of `KINDS`: only this layout is accepted. "folder" accepts a mixture of layouts.
    split : str, optional
        "otb50", "otb100"; "uav123", "uav20l", "uav123_10fps"; "train", "val", "test" of GOT-10k;
        "train", "test" of LaSOT. By default all sequences; of UAV123 folders those at 30 frames
        per second.
    as_published : bool
        Return the boxes as in the files. By default those of OTB, LaSOT and MOTChallenge, which are
        1-based, become 0-based, and boxes without area become nan.

    Returns
    -------
    Dataset

    Raises
    ------
    ArgumentError
        `kind` is not one of `KINDS`.
    DatasetError
        There is no dataset of the expected layout; the message says what was expected and found.
    """
    if kind is not None:
        check_choice("kind of dataset", kind, KINDS)
    path = Path(path)
    with dataset_errors():
        found_kind, readers = _find(path, kind, Options(split, as_published))
        name = path.resolve().stem if path.is_file() else path.resolve().name
    return Dataset(name, found_kind, LazySequences(readers))


def _find(path: Path, kind: str | None, options: Options) -> tuple[str, Readers]:
    if path.is_dir():
        return _find_in_folder(path, kind, options)
    if not path.is_file():
        raise DatasetError(f"{path}: there is no such folder or file; check the path")
    if path.suffix.lower() == ".json" and kind in (None, _JSON):
        found_kind, readers = _JSON, pysot.sequences_in_file(path)
    elif clips.is_video(path) and kind in (None, "clip"):
        found_kind, readers = "clip", clips.sequence_of_video(path, options)
    else:
        raise DatasetError(f"{path}: is a file; expected {_expected(kind)}")
    _check_split(path, found_kind, options.split)
    return found_kind, readers


def _find_in_folder(path: Path, kind: str | None, options: Options) -> tuple[str, Readers]:
    kinds = tuple(LAYOUTS) if kind in (None, _MIXED) else (kind,) if kind in LAYOUTS else ()
    all_splits = Options(None, options.as_published)
    found_kinds, readers = _search(path, kinds, all_splits)
    if not readers and kind in (None, _JSON):
        found_kinds, readers = _json_in(path)
    if not readers:
        raise DatasetError(f"{path}: expected {_expected(kind)}; found {_content(path)}")
    found_kind = found_kinds.pop() if len(found_kinds) == 1 and kind != _MIXED else _MIXED
    _check_split(path, found_kind, options.split)
    if options.split is not None:
        readers = _search(path, (found_kind,), options)[1]
    if not readers:
        raise DatasetError(f"{path}: has no sequence of the split {options.split!r}")
    return found_kind, readers


def _search(folder: Path, kinds: Iterable[str], options: Options) -> tuple[set[str], Readers]:
    """The sequences in `folder`, else in its subfolders, else in the subfolders of those.

    Returns
    -------
    kinds : set of str
        The layouts that were found.
    readers : mapping of str to callable
        The reader of each sequence by name.

    Raises
    ------
    DatasetError
        Two sequences have the same name, or a list.txt names a missing folder.
    """
    kinds = tuple(kinds)
    folders = [folder]
    for depth in range(_MAX_DEPTH + 1):
        found_kinds, readers = _in_folders(folders, kinds, options)
        if found_kinds:
            return found_kinds, readers
        if depth < _MAX_DEPTH:
            folders = [inner for outer in folders for inner in subfolders(outer)]
    return set(), {}


def _in_folders(
    folders: Iterable[Path], kinds: tuple[str, ...], options: Options
) -> tuple[set[str], Readers]:
    found_kinds: set[str] = set()
    readers: dict[str, Callable[[], VideoSequence]] = {}
    for folder in folders:
        kind, inner = _first_match(folder, kinds, options)
        # OTB often has the copies Jogging-1 and Jogging-2 of Jogging, with the same sequences.
        duplicates = sorted(set(inner) & set(readers)) if kind != "otb" else []
        if duplicates:
            raise DatasetError(
                f"{folder}: a second sequence is called {duplicates[0]!r}; rename one of them"
            )
        if inner:
            found_kinds.add(kind)
        for name, reader in inner.items():
            readers.setdefault(name, reader)
    return found_kinds, readers


def _first_match(folder: Path, kinds: tuple[str, ...], options: Options) -> tuple[str, Readers]:
    for kind in kinds:
        readers = LAYOUTS[kind].sequences_in(folder, options)
        if readers:
            return kind, readers
    return "", {}


def _json_in(folder: Path) -> tuple[set[str], Readers]:
    """The sequences of the JSON file with the name of the folder, or of the only one in it."""
    files = sorted(folder.glob("*.json"))
    named = [path for path in files if path.stem == folder.name] or files
    return ({_JSON}, pysot.sequences_in_file(named[0])) if len(named) == 1 else (set(), {})


def _check_split(path: Path, kind: str, split: str | None) -> None:
    splits = LAYOUTS[kind].splits if kind in LAYOUTS else ()
    if split is not None and split not in splits:
        hint = f"choose from {', '.join(splits)}" if splits else f"{kind} has none, leave it out"
        raise DatasetError(f"{path}: no split {split!r}: {hint}")


def _expected(kind: str | None) -> str:
    if kind == _JSON:
        return pysot.EXPECTS
    return LAYOUTS[kind].expects if kind in LAYOUTS else _EXPECTS_ANY


def _content(folder: Path) -> str:
    """A summary of a folder for messages: names of folders, number of files by suffix."""
    entries = sorted(folder.iterdir())
    folders = [path.name for path in entries if path.is_dir()]
    files = Counter(path.suffix or path.name for path in entries if not path.is_dir())
    parts = [f"{count} {suffix}" for suffix, count in files.most_common(_MAX_LISTED)]
    if folders:
        more = ", ..." if len(folders) > _MAX_LISTED else ""
        plural = "s" * (len(folders) > 1)
        names = ", ".join(folders[:_MAX_LISTED])
        parts.append(f"{len(folders)} folder{plural} ({names}{more})")
    return ", ".join(parts) or "an empty folder"
