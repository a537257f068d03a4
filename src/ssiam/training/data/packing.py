"""Crops around targets of training data as files, in layouts that the readers of sources know.

Objects of videos become track folders, those with masks videos of YouTube-VOS, objects of single
images those of COCO. Other objects in a crop stay its distractors.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import SsiamError
from ssiam.geometry import XYWH, Image
from ssiam.training.data.batches import TEMPLATE_CROP
from ssiam.training.data.crops import region_around
from ssiam.training.data.images import image_size
from ssiam.training.data.masks import Mask
from ssiam.training.data.registry import SourceSettings
from ssiam.training.data.sampling import TargetFrame, TargetSampler
from ssiam.training.data.tracks import SingleImageTrack, Source
from ssiam.video.mask_codec import run_lengths

__all__ = ["CropWindow", "Files", "PackedCrop", "draw_crops", "source_files", "window_around"]

Files: TypeAlias = dict[str, bytes]  # content by path in the pack

_SIDE: Final = 4.0  # of a window, in sides of the template's region: a search region and its shift
_MAX_SIDE: Final = 384  # px of a crop; a template crop of 127 px is enlarged by a third at most
_QUALITY: Final = 80  # of JPEG, percent
_MIN_INSIDE: Final = 0.5  # fraction of another object's box that is inside the crop
_NEARBY: Final = 2  # frames within reach that are added to each drawn one
_MAX_REPEATS: Final = 300  # draws without a new crop after which all data counts as packed
_MAX_LABELS: Final = 255  # objects of a video with masks

_LAYOUTS: Final = {"boxes": "tracks", "masks": "youtube_vos", "images": "coco"}
_ANNOTATIONS: Final = "instances.json"


@dataclass(frozen=True)
class CropWindow:
    """A part of a frame and the size of the crop that shows it.

    Attributes
    ----------
    x0, y0, x1, y1 : int
        Edges, px of the frame.
    size_wh : (int, int)
        Width and height of the crop, px.
    """

    x0: int
    y0: int
    x1: int
    y1: int
    size_wh: tuple[int, int]

    @property
    def scales(self) -> tuple[float, float]:
        """Px of the crop per px of the frame, horizontally and vertically."""
        width, height = self.size_wh
        return width / (self.x1 - self.x0), height / (self.y1 - self.y0)

    def cut(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The crop (h, w, ...) of a frame (H, W, ...)."""
        part = image[self.y0 : self.y1, self.x0 : self.x1]
        resized = cv2.resize(part, self.size_wh, interpolation=cv2.INTER_AREA)
        return np.asarray(resized, dtype=np.uint8)

    def jpeg(self, image: Image) -> bytes:
        """The crop of a frame (H, W, 3), encoded."""
        return _encoded(".jpg", self.cut(image), cv2.IMWRITE_JPEG_QUALITY, _QUALITY)

    def box(self, xywh: XYWH) -> XYWH:
        """A box of the frame in the crop."""
        (x, y, w, h), (across, down) = xywh, self.scales
        return (x - self.x0) * across, (y - self.y0) * down, w * across, h * down

    def shows(self, xywh: XYWH) -> bool:
        """Whether at least half of a box of the frame is inside."""
        x, y, w, h = xywh
        across = min(x + w, self.x1) - max(x, self.x0)
        down = min(y + h, self.y1) - max(y, self.y0)
        return across > 0 and down > 0 and across * down >= _MIN_INSIDE * w * h


def window_around(boxes: Sequence[XYWH], size_wh: tuple[int, int]) -> CropWindow:
    """The part of a frame of (width, height) px that contains the surroundings of boxes."""
    edges = []
    for xywh in boxes:
        region = region_around(xywh, TEMPLATE_CROP)
        half = _SIDE * region.side / 2
        edges.append([sign * half + center for sign in (-1, 1) for center in region.center_xy])
    low, high = np.min(edges, axis=0)[:2], np.max(edges, axis=0)[2:]
    x0, y0 = np.clip(np.floor(low).astype(int), 0, np.subtract(size_wh, 1)).tolist()
    x1, y1 = np.clip(np.ceil(high).astype(int) + 1, (x0 + 1, y0 + 1), size_wh).tolist()
    scale = min(1.0, _MAX_SIDE / max(x1 - x0, y1 - y0))
    width, height = (max(round(scale * side), 1) for side in (x1 - x0, y1 - y0))
    return CropWindow(x0, y0, x1, y1, (width, height))


@dataclass(frozen=True, eq=False)
class PackedCrop:
    """A crop around a target, encoded.

    Attributes
    ----------
    source, index : int
        Index of the source, and of the track in the source.
    kind : {"boxes", "masks", "images"}
        Determines the layout.
    scene : str
        What the frame shows; tracks of one scene may show the same objects.
    t : int
        The frame.
    window : CropWindow
    image : bytes
        JPEG.
    boxes : dict of int to (float, float, float, float)
        Boxes of the target and of other objects by the index of their track, px of the crop.
    masks : dict of int to (h, w) bool
        Their masks, if there are any.
    """

    source: int
    index: int
    kind: str
    scene: str
    t: int
    window: CropWindow
    image: bytes
    boxes: dict[int, XYWH]
    masks: dict[int, Mask]

    @property
    def size(self) -> int:
        """About the bytes of its files and of its lines in others."""
        return len(self.image) + 200 + 100 * len(self.boxes) + 300 * len(self.masks)


def draw_crops(
    sources: Sequence[Source], reach: int, seed: int, max_bytes: int
) -> list[PackedCrop]:
    """Crops of targets that are drawn as for training, until their sizes reach a limit.

    Each frame of a track, each image, and each frame of a video with masks occurs once. Damaged
    images are skipped.

    Parameters
    ----------
    sources : sequence of Source
    reach : int
        Largest distance of the frames of a pair, frames.
    seed : int
    max_bytes : int
    """
    crops: dict[tuple[Any, ...], PackedCrop] = {}
    total = repeats = 0
    for target in _drawn(TargetSampler(sources, reach), seed):
        repeats += 1
        if repeats > _MAX_REPEATS:
            break
        if target is None or _key(target) in crops:
            continue
        crop = _crop(target, sources[target.source])
        total += crop.size
        if total > max_bytes:
            break
        crops[_key(target)] = crop
        repeats = 0
    return list(crops.values())


def _drawn(sampler: TargetSampler, seed: int) -> Iterator[TargetFrame | None]:
    """Targets, each with the same target in nearby frames; None where nothing was found."""
    number = 0
    while True:
        rng = np.random.default_rng([seed, number])
        number += 1
        try:
            target = sampler.draw(rng)
            yield target
            for _ in range(_NEARBY if target is not None and target.track.frames > 1 else 0):
                assert target is not None
                yield sampler.draw_nearby(target, rng)
        except SsiamError:
            yield None


def _key(target: TargetFrame) -> tuple[Any, ...]:
    kind, scene = _kind(target), target.track.scene_ids[-1]
    own: tuple[Any, ...] = (target.index, target.t) if kind == "boxes" else (scene, target.t)
    return target.source, kind, *own


def _kind(target: TargetFrame) -> str:
    if isinstance(target.track, SingleImageTrack):
        return "images"
    return "boxes" if target.track.mask(target.t) is None else "masks"


def _crop(target: TargetFrame, source: Source) -> PackedCrop:
    window = window_around([target.xywh], image_size(target.image))
    boxes, masks = {}, {}
    for index in (target.index, *source.distractors(target.index)):
        track = source.track(index)
        xywh = track.box(target.t)
        if xywh is not None and min(xywh[2:]) > 0 and window.shows(xywh):
            boxes[index] = window.box(xywh)
            mask = track.mask(target.t)
            if mask is not None:
                masks[index] = window.cut(mask.astype(np.uint8) * 255) > 127
    return PackedCrop(
        target.source,
        target.index,
        _kind(target),
        target.track.scene_ids[-1],
        target.t,
        window,
        window.jpeg(target.image),
        boxes,
        masks,
    )


def _encoded(suffix: str, image: Image | NDArray[np.uint8], *options: int) -> bytes:
    _, data = cv2.imencode(suffix, image, options)
    return data.tobytes()


def source_files(
    settings: SourceSettings, number: int, crops: Iterable[PackedCrop]
) -> tuple[list[SourceSettings], Files]:
    """The files of a source's crops by path, and the sources that read them.

    A source with several kinds of tracks becomes several, which share its weight by their crops.

    Parameters
    ----------
    settings : SourceSettings
        Of the source.
    number : int
        Of the source in the config; the folders are named after it.
    crops : iterable of PackedCrop
        All of that source.
    """
    by_kind: defaultdict[str, list[PackedCrop]] = defaultdict(list)
    for crop in crops:
        by_kind[crop.kind].append(crop)
    count = sum(map(len, by_kind.values()))
    packed, files = [], {}
    writers = {"boxes": _track_files, "masks": _video_files, "images": _image_files}
    for kind, own in sorted(by_kind.items()):
        folder = f"source{number:02}_{kind}"
        files.update({f"{folder}/{name}": data for name, data in writers[kind](own).items()})
        packed.append(
            SourceSettings(
                _LAYOUTS[kind],
                f"{folder}/{_ANNOTATIONS}" if kind == "images" else folder,
                settings.weight * len(own) / count,
                settings.name or Path(settings.path).stem,
                alike=settings.alike,
            )
        )
    return packed, files


def _track_files(crops: list[PackedCrop]) -> Files:
    """Track folders with the boxes of their distractors; all are in one set."""
    files: Files = {}
    scenes = _numbers(crop.scene for crop in crops)
    for index, own in _grouped(crops, "index").items():
        own.sort(key=lambda crop: crop.t)
        folder = f"tracks/{index:06}"
        for number, crop in enumerate(own, 1):
            files[f"{folder}/{number:08}.jpg"] = crop.image
        others = sorted({other for crop in own for other in crop.boxes} - {index})
        meta = {
            "video": f"scene{scenes[own[0].scene]:04}",
            "track_id": index,
            "frames": [crop.t for crop in own],
            "crop_windows_x0y0x1y1_scale": [_edges(crop.window) for crop in own],
            "distractors": [
                [_rounded(crop.boxes[other]) if other in crop.boxes else None for crop in own]
                for other in others
            ],
        }
        files[f"{folder}/meta.json"] = _json(meta)
        files[f"{folder}/groundtruth.txt"] = "".join(
            ",".join(map(str, _rounded(crop.boxes[index]))) + "\n" for crop in own
        ).encode()
        files[f"{folder}/absence.label"] = b"0\n" * len(own)
    return files


def _video_files(crops: list[PackedCrop]) -> Files:
    """Videos of YouTube-VOS with a label image for each frame."""
    files: Files = {}
    videos: dict[str, Any] = {}
    for own in _grouped(crops, "scene").values():
        video = f"scene{len(videos):04}"
        found = _numbers(index for crop in own for index in crop.masks)
        labels = {index: label for index, label in found.items() if label < _MAX_LABELS}
        videos[video] = {"objects": {str(label + 1): {} for label in labels.values()}}
        for crop in own:
            image = np.zeros(crop.window.size_wh[::-1], dtype=np.uint8)
            for index in filter(labels.__contains__, crop.masks):
                image[crop.masks[index]] = labels[index] + 1
            files[f"JPEGImages/{video}/{crop.t:05}.jpg"] = crop.image
            files[f"Annotations/{video}/{crop.t:05}.png"] = _encoded(".png", image)
    return {**files, "meta.json": _json({"videos": videos})}


def _image_files(crops: list[PackedCrop]) -> Files:
    """Images and annotations of COCO."""
    files: Files = {}
    images, annotations = [], []
    for number, crop in enumerate(crops, 1):
        name = f"{number:06}.jpg"
        files[f"images/{name}"] = crop.image
        width, height = crop.window.size_wh
        images.append({"id": number, "file_name": name, "width": width, "height": height})
        for index, box in crop.boxes.items():
            entry: dict[str, Any] = {"image_id": number, "bbox": _rounded(box)}
            if index in crop.masks:
                counts = run_lengths(crop.masks[index].ravel(order="F"))
                entry["segmentation"] = {"counts": counts, "size": [height, width]}
            annotations.append(entry)
    return {**files, _ANNOTATIONS: _json({"images": images, "annotations": annotations})}


def _grouped(crops: Iterable[PackedCrop], name: str) -> dict[Any, list[PackedCrop]]:
    groups: defaultdict[Any, list[PackedCrop]] = defaultdict(list)
    for crop in crops:
        groups[getattr(crop, name)].append(crop)
    return groups


def _numbers(names: Iterable[Any]) -> dict[Any, int]:
    """Numbers from 0 in the order of first occurrence."""
    return {name: number for number, name in enumerate(dict.fromkeys(names))}


def _edges(window: CropWindow) -> list[float]:
    scale = round(window.scales[0], 6)
    return [window.x0, window.y0, window.x1, window.y1, scale]


def _rounded(xywh: XYWH) -> list[float]:
    return [round(value, 2) for value in xywh]


def _json(content: Any) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()
