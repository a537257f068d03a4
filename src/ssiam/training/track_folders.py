"""Tracks cut out of videos: SET/TRACK/00000001.jpg, groundtruth.txt and meta.json.

Every folder shows one object, in the layout of GOT-10k. Its pictures are crops of some frames of a
video, each with a window of its own; meta.json tells them::

    {"video": "vid4", "track_id": 6, "category": "player", "frames": [0, 20],
     "crop_windows_x0y0x1y1_scale": [[439, 0, 833, 342, 1.0], [472, 0, 820, 298, 1.0]]}

Objects of the same video, by which the boxes of one are mapped through the windows into the
pictures of another, are the distractors of each other.
"""

from __future__ import annotations

import bisect
import json
import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from ssiam.datasets import DatasetError
from ssiam.datasets.files import check_counts, images_in, read_text
from ssiam.datasets.ground_truth import read_flags, read_xywh, to_zero_based
from ssiam.geometry import XYWH
from ssiam.training.clips import Clip
from ssiam.training.folders import files_below
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Names

_META: Final = "meta.json"
_TRUTH: Final = "groundtruth.txt"
_ABSENT: Final = "absence.label"
_WINDOWS: Final = "crop_windows_x0y0x1y1_scale"
# Share of a distractor's box that is inside of the picture.
_INSIDE: Final = 0.5
# Boxes are interpolated between two that are at most so far apart, in sizes of the object.
_FARTHEST: Final = 1.0
# Videos that show the scene of another one: the same clip in two parts or kinds of boxes.
_SCENES: Final = {
    "crowdht21/ht21-12b": "crowdht21/ht21-12",
    "marathon/run2": "marathon/run",
    "posetrack/060470979_head": "posetrack/060470979_body",
}

# Left and top edge in the frame, pixels of the frame, and pixels of the picture for one of these;
# width and height of the picture.
_Window: TypeAlias = tuple[float, float, float, float, float]
# Scene, video, track id.
_Key: TypeAlias = tuple[str, str, str]


@dataclass(frozen=True, eq=False)
class SceneClip(Clip):
    """A track in crops of a video.

    Attributes
    ----------
    scene : str
        What other tracks of the same scene name too: any two of them may show the same objects.
    """

    scene: str

    @property
    def shows(self) -> tuple[str, ...]:
        """The folder and the scene."""
        return (str(self.folder), self.scene)


class TrackFolders:
    """A `Source` of track folders; behind them come their distractors.

    ``len`` counts the folders. The indices from there on are the distractors of each folder in
    turn: tracks with its pictures and the boxes of another object of the scene.

    Parameters
    ----------
    name : str
    folder : Path
        Of the sets, or of one of them.
    names : Names
        Of the videos: "SET/VIDEO".
    weight : float
    alike : bool
    interpolate : int
        A distractor's box is interpolated between two annotated frames that are at most so many
        frames apart, if it moves by less than its size between them; 0: annotated frames alone.

    Raises
    ------
    DatasetError
        There are no such folders, or more than a tenth of them are damaged; the others are left
        out with a warning.
    """

    def __init__(
        self,
        name: str,
        folder: Path,
        names: Names,
        weight: float = 1.0,
        alike: bool = False,
        interpolate: int = 0,
    ) -> None:
        self.name = name
        self.weight = weight
        self.alike = alike
        skipped = Skipped(folder)
        cuts: list[_Cut] = []
        for path in _folders(folder):
            with skipped.one():
                meta = _meta(path)
                if _video(path, meta) in names:
                    cuts.append(_cut(path, meta))
        skipped.tell()
        self._count = len(cuts)
        self._tracks = [cut.clip for cut in cuts]
        self._beside: list[tuple[int, ...]] = []
        objects = _objects(cuts)
        for cut in cuts:
            first = len(self._tracks)
            self._tracks += _distractors(cut, objects[cut.kind], interpolate)
            self._beside.append(tuple(range(first, len(self._tracks))))
        self._owners = [i for i, own in enumerate(self._beside) for _ in own]

    def __len__(self) -> int:
        """Number of folders."""
        return self._count

    def track(self, i: int) -> SceneClip:
        """The track of a folder, or of a distractor behind them."""
        return self._tracks[i]

    def beside(self, i: int) -> Sequence[int]:
        """Indices of the other tracks in the same pictures, frame by frame."""
        if i < self._count:
            return self._beside[i]
        owner = self._owners[i - self._count]
        return owner, *(j for j in self._beside[owner] if j != i)


def list_videos(folder: Path) -> tuple[str, ...]:
    """Names "SET/VIDEO" of all videos that track folders are cut out of, sorted.

    Parameters
    ----------
    folder : Path
        Of the sets, or of one of them.

    Raises
    ------
    DatasetError
        There are no such folders, or a meta.json is damaged.
    """
    return tuple(sorted({_video(path, _meta(path)) for path in _folders(folder)}))


@dataclass(frozen=True, eq=False)
class _Cut:
    """A folder: its track, and what maps boxes of the video into its pictures."""

    clip: SceneClip
    key: _Key
    kind: tuple[str, str]  # scene, category
    frames: tuple[int, ...]
    windows: tuple[_Window, ...]


@dataclass
class _Object:
    """An object of a video, wherever it is annotated."""

    frames: list[int] = field(default_factory=list)  # ascending
    boxes: list[XYWH] = field(default_factory=list)  # pixels of the frame

    def box(self, frame: int, interpolate: int) -> XYWH | None:
        """Its box in a frame of the video; None where it is not known."""
        after = bisect.bisect_left(self.frames, frame)
        if after < len(self.frames) and self.frames[after] == frame:
            return self.boxes[after]
        if after in (0, len(self.frames)):
            return None
        length = self.frames[after] - self.frames[after - 1]
        first, last = self.boxes[after - 1], self.boxes[after]
        if length > interpolate or _apart(first, last) > _FARTHEST:
            return None
        part = (frame - self.frames[after - 1]) / length
        x, y, w, h = (a + part * (b - a) for a, b in zip(first, last, strict=True))
        return x, y, w, h


def _folders(folder: Path) -> list[Path]:
    found = [path.parent for path in files_below(folder, (_META,)) if path.name == _META]
    return [path for path in found if (path / _TRUTH).is_file()]


def _meta(folder: Path) -> dict[str, Any]:
    path = folder / _META
    try:
        content = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{path}: is not JSON ({error})") from None
    if not isinstance(content, dict) or not isinstance(content.get("video"), str):
        raise DatasetError(f"{path}: does not name the video")
    return content


def _video(folder: Path, meta: dict[str, Any]) -> str:
    return f"{folder.parent.name}/{meta['video']}"


def _cut(folder: Path, meta: dict[str, Any]) -> _Cut:
    path, paths = folder / _META, images_in(folder)
    xywh = to_zero_based(read_xywh(folder / _TRUTH), 0)
    frames, windows = (_list(meta, key, len(paths), path) for key in ("frames", _WINDOWS))
    if not all(isinstance(frame, int) for frame in frames):
        raise DatasetError(f"{path}: its frames are not whole numbers")
    check_counts(folder, len(paths), len(xywh))
    hidden = np.isnan(xywh).any(axis=1)
    if (folder / _ABSENT).is_file():
        hidden |= read_flags(folder / _ABSENT, len(paths))
    xywh[hidden] = np.nan
    rows: list[list[float]] = xywh.tolist()
    boxes = tuple(None if math.isnan(x) else (x, y, w, h) for x, y, w, h in rows)
    video = _video(folder, meta)
    scene = _SCENES.get(video, video)
    where = str(folder.parent.parent / scene)
    return _Cut(
        SceneClip(folder, paths, boxes, where),
        (scene, video, str(meta.get("track_id"))),
        (scene, str(meta.get("category"))),
        tuple(frames),
        tuple(_window(value, path) for value in windows),
    )


def _list(meta: dict[str, Any], key: str, count: int, path: Path) -> list[Any]:
    found = meta.get(key)
    if not isinstance(found, list) or len(found) != count:
        raise DatasetError(f"{path}: {count} pictures, but not as many {key}")
    return found


def _window(value: Any, path: Path) -> _Window:
    try:
        left, top, right, bottom, scale = map(float, value)
    except (TypeError, ValueError):
        raise DatasetError(f"{path}: {str(value)[:40]} is not a window and its scale") from None
    width, height = (right - left) * scale, (bottom - top) * scale
    if not (scale > 0 and 0 < width < math.inf and 0 < height < math.inf):
        raise DatasetError(f"{path}: {str(value)[:60]} is a window without area")
    return left, top, scale, width, height


def _objects(cuts: Iterable[_Cut]) -> dict[tuple[str, str], dict[_Key, _Object]]:
    """The objects of each scene and category."""
    known: defaultdict[tuple[str, str], defaultdict[_Key, dict[int, XYWH]]]
    known = defaultdict(lambda: defaultdict(dict))
    for cut in cuts:
        for frame, xywh, (left, top, scale, _, _) in zip(
            cut.frames, cut.clip.boxes, cut.windows, strict=True
        ):
            if xywh is not None:
                x, y, w, h = (value / scale for value in xywh)
                known[cut.kind][cut.key][frame] = (left + x, top + y, w, h)
    return {
        kind: {
            key: _Object(sorted(boxes), [boxes[frame] for frame in sorted(boxes)])
            for key, boxes in own.items()
        }
        for kind, own in known.items()
    }


def _distractors(cut: _Cut, objects: dict[_Key, _Object], interpolate: int) -> list[SceneClip]:
    """The other objects in the pictures of a folder, those that none of them shows left out."""
    found = []
    for key, other in objects.items():
        if key != cut.key:
            boxes = tuple(
                _seen(other.box(frame, interpolate), window)
                for frame, window in zip(cut.frames, cut.windows, strict=True)
            )
            if any(box is not None for box in boxes):
                found.append(SceneClip(cut.clip.folder, cut.clip.paths, boxes, cut.clip.scene))
    return found


def _seen(xywh: XYWH | None, window: _Window) -> XYWH | None:
    """A box of the frame in a picture of it; None if most of it is outside."""
    if xywh is None:
        return None
    left, top, scale, width, height = window
    x, y = (xywh[0] - left) * scale, (xywh[1] - top) * scale
    w, h = xywh[2] * scale, xywh[3] * scale
    across, down = min(x + w, width) - max(x, 0.0), min(y + h, height) - max(y, 0.0)
    inside = across > 0 and down > 0 and across * down >= _INSIDE * w * h
    return (x, y, w, h) if inside else None


def _apart(first: XYWH, last: XYWH) -> float:
    """Distance of the centers of two boxes, in the size of the smaller one."""
    (x, y, w, h), (u, v, p, q) = first, last
    distance = math.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2)
    return distance / math.sqrt(min(w * h, p * q))
