"""Folders of tracks cropped from videos: SET/TRACK/00000001.jpg, groundtruth.txt and meta.json.

Each folder shows one object, in the layout of GOT-10k. Its images are crops of some frames of a
video, with one crop region per frame. meta.json lists them::

    {"video": "vid4", "track_id": 6, "category": "player", "frames": [0, 20],
     "crop_windows_x0y0x1y1_scale": [[439, 0, 833, 342, 1.0], [472, 0, 820, 298, 1.0]]}

Objects of the same video and category are distractors of each other: their boxes are mapped into
each other's images through the crop regions. A meta.json with "distractors" has their boxes in the
images instead, for each object a list with [x, y, w, h] or null for each image.
"""

from __future__ import annotations

import bisect
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
from ssiam.parsing import parse_json
from ssiam.training.data.files import AnnotationErrors, list_files
from ssiam.training.data.tracks import BoxTrack, NameFilter

__all__ = ["SceneTrack", "TrackFolderSource", "list_videos"]

_META: Final = "meta.json"
_TRUTH: Final = "groundtruth.txt"
_ABSENT: Final = "absence.label"
_REGIONS: Final = "crop_windows_x0y0x1y1_scale"
_MIN_INSIDE: Final = 0.5  # fraction of a distractor's box that is inside the image
_MAX_MOTION: Final = 1.0  # between two boxes that are interpolated, in sizes of the object
# Videos with the scene of another one: parts of one clip, or the same clip with other boxes.
_SCENES: Final = {
    "crowdht21/ht21-12b": "crowdht21/ht21-12",
    "marathon/run2": "marathon/run",
    "posetrack/060470979_head": "posetrack/060470979_body",
}

# Left and top edge, px of the frame; scale, px of the image per px of the frame; width and height
# of the image.
_Region: TypeAlias = tuple[float, float, float, float, float]
_Key: TypeAlias = tuple[str, str, str]  # scene, video, track id


@dataclass(frozen=True, eq=False)
class SceneTrack(BoxTrack):
    """A track in crops of a video.

    Attributes
    ----------
    scene : str
        Name of the scene. Any two tracks of a scene may show the same objects.
    """

    scene: str

    @property
    def scene_ids(self) -> tuple[str, ...]:
        """The folder's path and the scene."""
        return (str(self.folder), self.scene)


class TrackFolderSource:
    """A `Source` of track folders and their distractors.

    ``len`` counts the folders. The following indices are the distractors of each folder in turn:
    tracks with its images and the boxes of another object of the scene.

    Parameters
    ----------
    name : str
    folder : Path
        Folder of all sets, or of one set.
    names : NameFilter
        Matches the videos: "SET/VIDEO".
    weight : float
    alike : bool
    interpolate : int
        Largest distance between two annotated frames for which a distractor's box is interpolated,
        if it moves by less than its size; 0 uses annotated frames only.

    Raises
    ------
    DatasetError
        There are no track folders, or more than a tenth of them are damaged.
    """

    def __init__(
        self,
        name: str,
        folder: Path,
        names: NameFilter,
        weight: float = 1.0,
        alike: bool = False,
        interpolate: int = 0,
    ) -> None:
        self.name = name
        self.weight = weight
        self.alike = alike
        errors = AnnotationErrors(folder)
        entries: list[_Folder] = []
        for path in _track_folders(folder):
            with errors.skip():
                meta = _read_meta(path)
                if _video_name(path, meta) in names:
                    entries.append(_read_folder(path, meta))
        errors.check()
        self._count = len(entries)
        self._tracks = [entry.track for entry in entries]
        self._distractors: list[tuple[int, ...]] = []
        objects = _objects_by_kind(entries)
        for entry in entries:
            first = len(self._tracks)
            self._tracks += (
                _distractor_tracks(entry, objects[entry.kind], interpolate)
                if entry.distractors is None
                else entry.distractors
            )
            self._distractors.append(tuple(range(first, len(self._tracks))))
        self._owners = [i for i, own in enumerate(self._distractors) for _ in own]

    def __len__(self) -> int:
        """Number of folders."""
        return self._count

    def track(self, i: int) -> SceneTrack:
        """The track of a folder or, from index ``len`` on, of a distractor."""
        return self._tracks[i]

    def distractors(self, i: int) -> Sequence[int]:
        """Indices of the other tracks with the same frames."""
        if i < self._count:
            return self._distractors[i]
        owner = self._owners[i - self._count]
        return owner, *(j for j in self._distractors[owner] if j != i)


def list_videos(folder: Path) -> tuple[str, ...]:
    """Sorted names "SET/VIDEO" of the videos from which track folders were cropped.

    Parameters
    ----------
    folder : Path
        Folder of all sets, or of one set.

    Raises
    ------
    DatasetError
        There are no track folders, or a meta.json is damaged.
    """
    return tuple(sorted({_video_name(path, _read_meta(path)) for path in _track_folders(folder)}))


@dataclass(frozen=True, eq=False)
class _Folder:
    """A folder's track, and the regions that map boxes of the video into its images."""

    track: SceneTrack
    key: _Key
    kind: tuple[str, str]  # scene, category
    frames: tuple[int, ...]
    regions: tuple[_Region, ...]
    distractors: list[SceneTrack] | None  # None if they are found through the regions


@dataclass
class _Object:
    """An object of a video, with its annotations in all folders."""

    frames: list[int] = field(default_factory=list)  # ascending
    boxes: list[XYWH] = field(default_factory=list)  # px of the frame

    def box(self, frame: int, interpolate: int) -> XYWH | None:
        """Its box in a frame of the video; None where it is unknown."""
        after = bisect.bisect_left(self.frames, frame)
        if after < len(self.frames) and self.frames[after] == frame:
            return self.boxes[after]
        if after in (0, len(self.frames)):
            return None
        length = self.frames[after] - self.frames[after - 1]
        first, last = self.boxes[after - 1], self.boxes[after]
        if length > interpolate or _relative_motion(first, last) > _MAX_MOTION:
            return None
        fraction = (frame - self.frames[after - 1]) / length
        x, y, w, h = (a + fraction * (b - a) for a, b in zip(first, last, strict=True))
        return x, y, w, h


def _track_folders(folder: Path) -> list[Path]:
    found = [path.parent for path in list_files(folder, (_META,)) if path.name == _META]
    return [path for path in found if (path / _TRUTH).is_file()]


def _read_meta(folder: Path) -> dict[str, Any]:
    path = folder / _META
    try:
        content = parse_json(read_text(path))
    except ValueError as error:
        raise DatasetError(f"{path}: is not valid JSON ({error})") from None
    if not isinstance(content, dict) or not isinstance(content.get("video"), str):
        raise DatasetError(f"{path}: does not name the video")
    return content


def _video_name(folder: Path, meta: dict[str, Any]) -> str:
    return f"{folder.parent.name}/{meta['video']}"


def _read_folder(folder: Path, meta: dict[str, Any]) -> _Folder:
    path, paths = folder / _META, images_in(folder)
    xywh = to_zero_based(read_xywh(folder / _TRUTH), 0)
    frames, regions = (_list(meta, key, len(paths), path) for key in ("frames", _REGIONS))
    if not all(isinstance(frame, int) for frame in frames):
        raise DatasetError(f"{path}: its frames are not whole numbers")
    check_counts(folder, len(paths), len(xywh))
    hidden = np.isnan(xywh).any(axis=1)
    if (folder / _ABSENT).is_file():
        hidden |= read_flags(folder / _ABSENT, len(paths))
    xywh[hidden] = np.nan
    rows: list[list[float]] = xywh.tolist()
    boxes = tuple(None if math.isnan(x) else (x, y, w, h) for x, y, w, h in rows)
    video = _video_name(folder, meta)
    scene = _SCENES.get(video, video)
    scene_id = str(folder.parent.parent / scene)
    distractors = None
    if "distractors" in meta:
        distractors = [
            SceneTrack(folder, paths, own, scene_id)
            for own in _given_boxes(meta["distractors"], len(paths), path)
        ]
    return _Folder(
        SceneTrack(folder, paths, boxes, scene_id),
        (scene, video, str(meta.get("track_id"))),
        (scene, str(meta.get("category"))),
        tuple(frames),
        tuple(_region(value, path) for value in regions),
        distractors,
    )


def _given_boxes(value: Any, count: int, path: Path) -> list[tuple[XYWH | None, ...]]:
    """The boxes of each distractor in `count` images."""
    try:
        tracks = [tuple(None if box is None else _given_box(box) for box in own) for own in value]
    except (TypeError, ValueError, OverflowError):
        raise DatasetError(f"{path}: its distractors are not lists of boxes") from None
    if any(len(own) != count for own in tracks):
        raise DatasetError(f"{path}: {count} images, but not as many boxes of a distractor")
    return tracks


def _given_box(value: Any) -> XYWH:
    x, y, w, h = map(float, value)
    if not (math.isfinite(x + y + w + h) and w > 0 and h > 0):
        raise ValueError("no box")
    return x, y, w, h


def _list(meta: dict[str, Any], key: str, count: int, path: Path) -> list[Any]:
    found = meta.get(key)
    if not isinstance(found, list) or len(found) != count:
        raise DatasetError(f"{path}: {count} images, but not as many {key}")
    return found


def _region(value: Any, path: Path) -> _Region:
    try:
        left, top, right, bottom, scale = map(float, value)
    except (TypeError, ValueError, OverflowError):
        raise DatasetError(f"{path}: {str(value)[:40]} is not a region and its scale") from None
    width, height = (right - left) * scale, (bottom - top) * scale
    if not (scale > 0 and 0 < width < math.inf and 0 < height < math.inf):
        raise DatasetError(f"{path}: {str(value)[:60]} is a region without area")
    return left, top, scale, width, height


def _objects_by_kind(entries: Iterable[_Folder]) -> dict[tuple[str, str], dict[_Key, _Object]]:
    """The objects of each scene and category."""
    known: defaultdict[tuple[str, str], defaultdict[_Key, dict[int, XYWH]]]
    known = defaultdict(lambda: defaultdict(dict))
    for entry in entries:
        for frame, xywh, (left, top, scale, _, _) in zip(
            entry.frames, entry.track.boxes, entry.regions, strict=True
        ):
            if xywh is not None:
                x, y, w, h = (value / scale for value in xywh)
                known[entry.kind][entry.key][frame] = (left + x, top + y, w, h)
    return {
        kind: {
            key: _Object(sorted(boxes), [boxes[frame] for frame in sorted(boxes)])
            for key, boxes in own.items()
        }
        for kind, own in known.items()
    }


def _distractor_tracks(
    entry: _Folder, objects: dict[_Key, _Object], interpolate: int
) -> list[SceneTrack]:
    """The other objects that are visible in at least one image of a folder."""
    track, found = entry.track, []
    for key, other in objects.items():
        if key != entry.key:
            boxes = tuple(
                _box_in_image(other.box(frame, interpolate), region)
                for frame, region in zip(entry.frames, entry.regions, strict=True)
            )
            if any(box is not None for box in boxes):
                found.append(SceneTrack(track.folder, track.paths, boxes, track.scene))
    return found


def _box_in_image(xywh: XYWH | None, region: _Region) -> XYWH | None:
    """A box of the frame, mapped into the image of a region; None if most of it is outside."""
    if xywh is None:
        return None
    left, top, scale, width, height = region
    x, y = (xywh[0] - left) * scale, (xywh[1] - top) * scale
    w, h = xywh[2] * scale, xywh[3] * scale
    across, down = min(x + w, width) - max(x, 0.0), min(y + h, height) - max(y, 0.0)
    inside = across > 0 and down > 0 and across * down >= _MIN_INSIDE * w * h
    return (x, y, w, h) if inside else None


def _relative_motion(first: XYWH, last: XYWH) -> float:
    """Distance of the centers of two boxes, in sizes of the smaller one."""
    (x, y, w, h), (last_x, last_y, last_w, last_h) = first, last
    dx, dy = x + w / 2 - last_x - last_w / 2, y + h / 2 - last_y - last_h / 2
    return math.hypot(dx, dy) / math.sqrt(min(w * h, last_w * last_h))
