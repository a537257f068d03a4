"""`OneStreamTracker`: any ONNX network that takes template and search crops and returns a box.

One-stream trackers (OSTrack, MixFormerV2, HiT, SUTrack and their relatives) compare template and
search crop inside of one network. They differ in the sizes of the crops, in the pixels' mean and
scale, and in the form of the output. A small TOML file beside the network says which they are::

    network = "ostrack_256.onnx"
    outputs = ["score_map", "size_map", "offset_map"]

The defaults are those of OSTrack-256; `OneStreamDescription` lists all keys.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from ssiam.errors import ArgumentError, WeightsError
from ssiam.geometry import XYWH
from ssiam.runtime import Network, RuntimeOptions, Tensor
from ssiam.stabilize import FrameView
from ssiam.stabilize.view import Crop
from ssiam.toml_tables import read_toml
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker, Floats
from ssiam.trackers.confidence import AppearanceModel

OneStreamName: TypeAlias = Literal["one_stream"]
Input: TypeAlias = Literal["template", "recent_template", "search", "template_box"]
Output: TypeAlias = Literal["score_map", "size_map", "offset_map", "box", "score", "unused"]

_IMAGE_INPUTS: Final = ("template", "recent_template", "search")
_RGB: Final = 3  # channels
_MAX_SIDE: Final = 1024  # px, of a crop
_MAX_FACTOR: Final = 100.0  # of a crop
_MIN_SIDE: Final = 2.0  # px, of a target
_MIN_TARGET: Final = 10.0  # px, of the side from which a crop is computed


@dataclass(frozen=True)
class OneStreamDescription:
    """What a network takes and returns.

    Attributes
    ----------
    network : str
        Name of the .onnx file, in the folder of the description.
    inputs : tuple of str
        What each input of the network is, in its order: "template", "search", "recent_template"
        (of a box with a high score, MixFormerV2), "template_box" (1, 4): the target's x, y, w, h in
        the template crop, as shares of its sides (SUTrack).
    outputs : tuple of str
        What each output is, in its order. Either "score_map" (1, 1, n, n), "size_map" (1, 2, n, n)
        and "offset_map" (1, 2, n, n), or "box" and "score". "box" is of four numbers; "unused" is
        ignored. Without "score" the score is the similarity of the box to the first one.
    box : {"cxcywh", "xywh", "xyxy"}
        Layout of "box".
    box_in : {"shares", "pixels"}
        Unit of "box": shares of the search crop's sides, or its pixels.
    score_is_logit : bool
        Whether the sigmoid of the score or score map is its value, 0..1.
    template_side, search_side : int
        Sides of the crops, pixels.
    template_factor, search_factor : float
        Side of the square that is cropped, in units of sqrt(width * height) of the box.
    stretch : bool
        Whether a rectangle, factor times the box's width and height, is stretched instead.
    mean, deviation : tuple of three floats
        Of red, green and blue, for pixels 0..1. By default those of ImageNet.
    rgb : bool
        Whether the channels are red, green, blue; else blue, green, red, and mean and deviation
        in that order.
    copies : int
        How often the three channels are repeated (SUTrack's six channels: 2).
    pad_with_mean : bool
        Whether the frame's mean color is outside of the frame; else black.
    window : float
        Share 0..1 of a Hanning window by which a score map is multiplied (OSTrack: 1).
    recent_interval : int
        Frames from one recent template to the next.
    recent_score : float
        Score above which a box is taken as the recent template, 0..1.
    """

    network: str
    inputs: tuple[Input, ...] = ("template", "search")
    outputs: tuple[Output, ...] = ("score_map", "size_map", "offset_map")
    box: Literal["cxcywh", "xywh", "xyxy"] = "cxcywh"
    box_in: Literal["shares", "pixels"] = "shares"
    score_is_logit: bool = False
    template_side: int = 128
    search_side: int = 256
    template_factor: float = 2.0
    search_factor: float = 4.0
    stretch: bool = False
    mean: tuple[float, float, float] = (0.485, 0.456, 0.406)
    deviation: tuple[float, float, float] = (0.229, 0.224, 0.225)
    rgb: bool = True
    copies: int = 1
    pad_with_mean: bool = False
    window: float = 1.0
    recent_interval: int = 200
    recent_score: float = 0.5

    def __post_init__(self) -> None:
        if Path(self.network).name != self.network or not self.network.endswith(".onnx"):
            raise ArgumentError(f"network is {self.network!r}: name an .onnx file in this folder")
        if not {"template", "search"} <= set(self.inputs):
            raise ArgumentError('inputs need "template" and "search"')
        _check_names("inputs", self.inputs)
        _check_names("outputs", [name for name in self.outputs if name != "unused"])
        maps = {"score_map", "size_map", "offset_map"} & set(self.outputs)
        if bool(maps) == ("box" in self.outputs):
            raise ArgumentError('outputs need "box", or "score_map", "size_map" and "offset_map"')
        if maps and len(maps) < 3:
            raise ArgumentError(f"outputs has {', '.join(sorted(maps))}: give all three maps")
        for name in ("template_side", "search_side"):
            if not 1 <= getattr(self, name) <= _MAX_SIDE:
                raise ArgumentError(f"{name} is {getattr(self, name)}: give 1 to {_MAX_SIDE}")
        for name in ("template_factor", "search_factor"):
            if not 0 < getattr(self, name) <= _MAX_FACTOR:
                raise ArgumentError(
                    f"{name} is {getattr(self, name)}: give a number above 0, up to {_MAX_FACTOR}"
                )
        for index, (mean, deviation) in enumerate(zip(self.mean, self.deviation, strict=True)):
            if not math.isfinite(mean):
                raise ArgumentError(f"mean[{index}] is {mean}: give a finite number")
            if not 0 < deviation < math.inf:
                raise ArgumentError(f"deviation[{index}] is {deviation}: give a number above 0")
        for name in ("window", "recent_score"):
            if not 0 <= getattr(self, name) <= 1:
                raise ArgumentError(f"{name} is {getattr(self, name)}: give 0 to 1")
        for name, most in (("copies", 8), ("recent_interval", 1_000_000)):
            if not 1 <= getattr(self, name) <= most:
                raise ArgumentError(f"{name} is {getattr(self, name)}: give 1 to {most}")


@dataclass(frozen=True)
class OneStreamNetwork:
    """A network and its description, which any number of trackers may share.

    Threads: any number may share it.
    """

    network: Network
    description: OneStreamDescription

    @classmethod
    def load(cls, weights: Path, options: RuntimeOptions) -> OneStreamNetwork:
        """Load the network that a TOML file describes.

        Parameters
        ----------
        weights : Path
            The .toml file, or a folder with one.
        options : RuntimeOptions

        Raises
        ------
        WeightsError
            A file is missing or damaged, or the network does not fit its description.
        ArgumentError
            The description has an unknown key or a wrong value.
        """
        from ssiam.runtime.loading import load_network

        path = description_file(weights)
        description = read_toml(OneStreamDescription, path, "description")
        network = load_network(
            path.parent / description.network,
            runtime=options.runtime,
            threads=options.threads,
            precision=options.precision,
            device=options.device,
        )
        loaded = cls(network, description)
        loaded._check(path)
        return loaded

    def _check(self, path: Path) -> None:
        """Raise `WeightsError` unless the network has the described inputs and outputs."""
        described = self.description
        sides = {"search": described.search_side}
        expected: list[tuple[int, ...]] = [
            (1, 4)
            if name == "template_box"
            else (1, _RGB * described.copies, *[sides.get(name, described.template_side)] * 2)
            for name in described.inputs
        ]
        if self.network.input_shapes != expected:
            raise WeightsError(
                f"{path}: {described.network} takes {self.network.input_shapes}, the description "
                f"says {expected}"
            )
        found = self.network.output_shapes
        if len(found) != len(described.outputs):
            raise WeightsError(
                f"{path}: {described.network} has {len(found)} outputs, the description "
                f"{len(described.outputs)}"
            )
        shapes = dict(zip(described.outputs, found, strict=True))
        side = shapes.get("score_map", (1,))[-1]
        fits = {
            "score_map": (1, 1, side, side),
            "size_map": (1, 2, side, side),
            "offset_map": (1, 2, side, side),
        }
        sizes = {"box": 4, "score": 1}
        for name, shape in shapes.items():
            if name in fits and shape != fits[name]:
                raise WeightsError(f"{path}: {name} is {shape}, expected {fits[name]}")
            if name in sizes and math.prod(shape) != sizes[name]:
                raise WeightsError(f"{path}: {name} is {shape}, expected {sizes[name]} in all")


def description_file(weights: Path) -> Path:
    """The .toml file; of a folder, the only one in it; `WeightsError` if there is none."""
    if weights.suffix == ".toml" and weights.is_file():
        return weights
    files = sorted(weights.glob("*.toml")) if weights.is_dir() else []
    if len(files) != 1:
        raise WeightsError(
            f"weights {weights}: give the .toml file that describes a one-stream network, or a "
            f"folder with one (docs/how-to/weights.md); found {len(files)}"
        )
    return files[0]


@dataclass
class _Target:
    """State of the target."""

    xywh: XYWH  # stabilized pixels
    first: dict[str, Tensor]  # inputs of the first template
    recent: Tensor  # crop of the recent template
    age: int  # frames since the recent template was taken
    appearance: AppearanceModel | None  # without a score of the network


class OneStreamTracker(CompleteTracker):
    """The loop of a one-stream tracker.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    The score is the network's own, or without one the similarity of the pixels in the box to those
    in the first box; it is not calibrated.

    Parameters
    ----------
    network : OneStreamNetwork
    """

    center_inset = 0.0
    score_is_calibrated = False
    runs_networks = True

    def __init__(self, network: OneStreamNetwork) -> None:
        self._network = network
        self._described = network.description
        scale = 1 / (255 * np.array(self._described.deviation))
        self._mean, self._scale = 255 * np.array(self._described.mean), scale
        self._target_or_none: _Target | None = None

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`."""
        crop = self._crop(view, xywh, "template")
        tensor = self._tensor(crop)
        left, top, across, down = (float(crop.view_from_crop[i]) for i in _LTAD)
        side = self._described.template_side
        x, y, w, h = xywh
        share = np.array([[(x - left) / across, (y - top) / down, w / across, h / down]]) / side
        first = {"template": tensor, "template_box": share.astype(np.float32)}
        has_score = {"score", "score_map"} & set(self._described.outputs)
        appearance = None if has_score else AppearanceModel(view, xywh)
        self._target_or_none = _Target(xywh, first, tensor, 0, appearance)

    def update(self, view: FrameView) -> Track:
        """The target in the next view."""
        target = self._target
        crop = self._crop(view, target.xywh, "search")
        given = {
            **target.first,
            "recent_template": target.recent,
            "search": self._tensor(crop),
        }
        outputs = self._network.network(*(given[name] for name in self._described.inputs))
        found = dict(zip(self._described.outputs, outputs, strict=True))
        in_crop, score = self._decoded(found)
        target.xywh = _limited(crop.box_in_view(in_crop), view, target.xywh)
        if target.appearance is not None:
            score = max(target.appearance.similarity(view, target.xywh)[0], 0.0)
        score = min(max(score, 0.0), 1.0) if math.isfinite(score) else 0.0
        self._update_recent(target, view, score)
        return Track(target.xywh, score, evidence=(score,))

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`."""
        self._target.xywh = xywh
        return self.update(view)

    def clone(self) -> OneStreamTracker:
        """A tracker without a target, on the same network."""
        return OneStreamTracker(self._network)

    @property
    def _target(self) -> _Target:
        if self._target_or_none is None:
            raise ArgumentError("no target yet: call init(view, xywh) before update or seek")
        return self._target_or_none

    def _crop(self, view: FrameView, xywh: XYWH, kind: Literal["template", "search"]) -> Crop:
        described = self._described
        side: int = getattr(described, f"{kind}_side")
        factor: float = getattr(described, f"{kind}_factor")
        x, y, w, h = xywh
        sides = (w, h) if described.stretch else (math.sqrt(w * h),) * 2
        across, down = (factor * max(each, _MIN_TARGET) for each in sides)
        window = x + (w - across) / 2, y + (h - down) / 2, across, down
        fill = view.mean_color if described.pad_with_mean else None
        return view.crop(window, (side, side), fill)

    def _tensor(self, crop: Crop) -> Tensor:
        tensor = crop.tensor(rgb=self._described.rgb, mean=self._mean, scale=self._scale)
        return np.tile(tensor, (1, self._described.copies, 1, 1))

    def _decoded(self, found: dict[Output, Tensor]) -> tuple[tuple[float, ...], float]:
        """The box (x, y, w, h) in pixels of the search crop, and the score."""
        side = self._described.search_side
        if "score_map" in found:
            score_map = self._probability(found["score_map"][0, 0])
            row, column, best = self._peak(score_map)
            (w, h), (dx, dy) = (found[name][0, :, row, column] for name in _MAPS)
            cells = score_map.shape[0]
            cx, cy = (column + float(dx)) / cells, (row + float(dy)) / cells
            return _from_center(cx * side, cy * side, float(w) * side, float(h) * side), best
        a, b, c, d = (float(number) for number in found["box"].ravel())
        if self._described.box_in == "shares":
            a, b, c, d = a * side, b * side, c * side, d * side
        score = float(self._probability(found["score"]).ravel()[0]) if "score" in found else 0.0
        if self._described.box == "xyxy":
            return (a, b, c - a, d - b), score
        return ((a, b, c, d) if self._described.box == "xywh" else _from_center(a, b, c, d)), score

    def _probability(self, values: Tensor) -> Floats:
        plain = values.astype(np.float64)
        return (1 + np.tanh(plain / 2)) / 2 if self._described.score_is_logit else plain

    def _peak(self, score_map: Floats) -> tuple[int, int, float]:
        """Row and column of the best cell, and its score without the window."""
        side = score_map.shape[0]
        # Without the zeros at the ends, as OSTrack's window.
        hanning = np.hanning(side + 2)[1:-1]
        share = self._described.window
        window = (1 - share) + share * np.outer(hanning, hanning)
        row, column = divmod(int(np.argmax(score_map * window)), side)
        return row, column, float(score_map[row, column])

    def _update_recent(self, target: _Target, view: FrameView, score: float) -> None:
        """Take the box as the recent template, if the network has one and it is due."""
        described = self._described
        target.age += 1
        if "recent_template" not in described.inputs or target.age < described.recent_interval:
            return
        if score > described.recent_score:
            target.recent = self._tensor(self._crop(view, target.xywh, "template"))
            target.age = 0


_MAPS: Final[tuple[Output, Output]] = ("size_map", "offset_map")
_LTAD: Final = ((0, 2), (1, 2), (0, 0), (1, 1))  # left, top, across, down in `view_from_crop`


def _check_names(kind: str, names: tuple[str, ...] | list[str]) -> None:
    if len(set(names)) != len(names):
        raise ArgumentError(f"{kind} has a name twice: {', '.join(names)}")


def _from_center(cx: float, cy: float, w: float, h: float) -> tuple[float, ...]:
    return cx - w / 2, cy - h / 2, w, h


def _limited(xywh: XYWH, view: FrameView, last_xywh: XYWH) -> XYWH:
    """The box with sides from 2 pixels to the frame's, its center at most a frame outside.

    Numbers that are not finite, of a network that has failed, leave the last box.
    """
    if not all(math.isfinite(number) for number in xywh):
        return last_xywh
    x, y, w, h = xywh
    width, height = view.size_wh
    cx, cy = min(max(x + w / 2, -width), 2.0 * width), min(max(y + h / 2, -height), 2.0 * height)
    w, h = min(max(w, _MIN_SIDE), float(width)), min(max(h, _MIN_SIDE), float(height))
    return cx - w / 2, cy - h / 2, w, h
