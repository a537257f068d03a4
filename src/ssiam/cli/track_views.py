"""`VideoOptions`: how the video of `ssiam track` looks; and the views of its virtual camera."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol, TypeAlias

import numpy as np
from cyclopts import Group, Parameter

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, map_point
from ssiam.motion import CameraMotion, MaskOf, Motion, PrefetchingCameraMotion
from ssiam.render import (
    Border,
    CameraView,
    Crop,
    LockedCamera,
    LockedConfig,
    ScenePath,
    StabilizedCamera,
    locked_views,
    stabilized_views,
)
from ssiam.render.locked_config import Aspect, Position, Zoom
from ssiam.track import Track
from ssiam.video import Frame, Overlay, Source

OUTPUT_GROUP = Group("Output", sort_key=2)

ViewName: TypeAlias = Literal["raw", "stabilized", "locked"]


@Parameter(name="*")
@dataclass(frozen=True)
class VideoOptions:
    """The look of the video.

    Parameters
    ----------
    view
        Image of the video: raw is the frame as it was shot; stabilized a virtual camera that
        moves smoothly, so that the whole image is still; locked a virtual camera that holds the
        first target in place, level, and stops and widens while it is lost. A file or folder is
        read twice, and the camera's path is planned as a whole; cameras, streams and standard input
        get a virtual camera without delay. --stabilize is something else: it moves what the tracker
        sees, not the video.
    aspect
        Width and height of the locked view.
    zoom
        Size of the locked view: follow changes it smoothly with the size of the target, fixed
        chooses one size.
    position
        Where the locked view holds the target.
    crop
        Border that the stabilized view shows: auto enlarges the image so that the border is hidden
        in 99 % of the frames, at most by 15 % of width and height, and limits the correction to
        that; none shows it; a percentage cuts so much away.
    border
        What is shown beyond the edges of the frame: black, its mirror image, or what earlier frames
        showed there.
    overlay
        What is drawn of a target: nothing, its box, box and score (and rotated box and mask),
        box and trail, or its mask.
    side_by_side
        Show the raw frame on the left, and the stabilized or locked view on the right.
    """

    view: Annotated[ViewName | None, Parameter(group=OUTPUT_GROUP, show_default=False)] = None
    aspect: Annotated[Aspect, Parameter(group=OUTPUT_GROUP)] = "source"
    zoom: Annotated[Zoom, Parameter(group=OUTPUT_GROUP)] = "follow"
    position: Annotated[Position, Parameter(group=OUTPUT_GROUP)] = "middle"
    crop: Annotated[str, Parameter(group=OUTPUT_GROUP, allow_leading_hyphen=True)] = "auto"
    border: Annotated[Border, Parameter(group=OUTPUT_GROUP)] = "mirror"
    overlay: Annotated[Overlay, Parameter(group=OUTPUT_GROUP)] = "box+score"
    side_by_side: Annotated[bool, Parameter(group=OUTPUT_GROUP, negative=())] = False

    def check(self) -> None:
        """Raise `ArgumentError` for a value out of range, or options that contradict."""
        Crop.parse(self.crop)
        for option in ("aspect", "zoom", "position"):
            value = getattr(self, option)
            if value != getattr(VideoOptions, option) and self.chosen_view != "locked":
                raise ArgumentError(
                    f"--{option} {value} is for the locked view: give --view locked, or omit it"
                )
        if self.crop != VideoOptions.crop and self.chosen_view == "locked":
            raise ArgumentError(
                f"--crop {self.crop} is for the stabilized view: the locked view is cropped by "
                "--aspect and --zoom; omit --crop"
            )
        if self.side_by_side and self.view == "raw":
            raise ArgumentError(
                "--side-by-side shows another view beside the raw frame: give --view stabilized "
                "or --view locked, or omit --view"
            )

    @property
    def chosen_view(self) -> ViewName:
        """The view; that beside the raw frame with ``--side-by-side``."""
        return self.view or ("stabilized" if self.side_by_side else "raw")

    @property
    def locked(self) -> LockedConfig:
        """The settings of the locked view."""
        return LockedConfig(aspect=self.aspect, zoom=self.zoom, position=self.position)

    @property
    def is_virtual(self) -> bool:
        """Whether the video shows another view than the raw frame."""
        return self.chosen_view != "raw"

    @property
    def needs_motion(self) -> bool:
        """Whether the camera motion is needed, whatever the tracker needs."""
        return self.is_virtual or self.overlay == "trail"


class Views(Protocol):
    """The views of a virtual camera, in the order of the frames."""

    def of(self, frame: Frame, motion: Motion | None, box: XYWH | None) -> CameraView:
        """The view of the next frame.

        Parameters
        ----------
        frame : Frame
        motion : Motion or None
            Camera motion to the frame.
        box : (x, y, w, h) or None
            The first target, raw-frame pixels; None if it is lost or has not begun.
        """

    @property
    def note(self) -> str:
        """How the views were found, for the summary; complete after the last frame."""


class RawViews:
    """The raw frames."""

    note = ""

    def of(self, frame: Frame, motion: Motion | None, box: XYWH | None) -> CameraView:
        """The raw frame."""
        return CameraView.raw((frame.image.shape[1], frame.image.shape[0]))


class LiveStabilizedViews:
    """Views of a stabilized camera without delay."""

    def __init__(self, camera: StabilizedCamera) -> None:
        self._camera = camera
        self.note = f"without delay, {_cropped(camera.share)}"

    def of(self, frame: Frame, motion: Motion | None, box: XYWH | None) -> CameraView:
        """The view of the next frame."""
        height, width = frame.image.shape[:2]
        return self._camera.update(motion or Motion.none((width, height)))


class LiveLockedViews:
    """Views of a camera that follows the target, without delay."""

    def __init__(self, camera: LockedCamera, config: LockedConfig) -> None:
        self._camera = camera
        self._distance = _TargetDistance(config)

    def of(self, frame: Frame, motion: Motion | None, box: XYWH | None) -> CameraView:
        """The view of the next frame."""
        height, width = frame.image.shape[:2]
        out_from_raw = self._camera.update(motion or Motion.none((width, height)), box)
        view = CameraView(out_from_raw, self._camera.out_size_wh)
        self._distance.add(view, box)
        return view

    @property
    def note(self) -> str:
        """Distance of the target from its position."""
        return f"without delay, {self._distance.note}"


class ClipViews:
    """Views of a virtual camera whose path was planned for a whole clip.

    Parameters
    ----------
    first : int
        Index of the first frame.
    views : sequence of CameraView
        Of each frame from `first` on.
    note : str
        What the plan needed.
    """

    def __init__(self, first: int, views: Sequence[CameraView], note: str) -> None:
        self._first, self._views = first, views
        self.note = f"planned for the whole clip, {note}"

    def of(self, frame: Frame, motion: Motion | None, box: XYWH | None) -> CameraView:
        """The view of a frame."""
        return self._views[frame.index - self._first]


def first_box(tracks: Sequence[Track | None]) -> XYWH | None:
    """Box of the first target; None if it is lost or has not begun."""
    track = tracks[0]
    return None if track is None or track.lost else track.box


def planned_views(
    options: VideoOptions,
    source: Source,
    indexes: range,
    motion_at: Callable[[int], Motion | None],
    box_at: Callable[[int], XYWH | None],
) -> Views:
    """The views of a clip that is read again.

    Parameters
    ----------
    options : VideoOptions
    source : Source
        Its size and rate are used.
    indexes : range
        Of the frames of the clip.
    motion_at : callable
        Camera motion to a frame; None if it is unknown. Called if the view needs it.
    box_at : callable
        The first target in a frame, raw-frame pixels; None where it is lost or has not begun.
        Called if the view needs it.
    """
    if not options.is_virtual:
        return RawViews()
    fps, unknown = float(source.fps), Motion.none(source.size_wh)
    motions = [motion_at(index) or unknown for index in indexes]
    if options.chosen_view == "stabilized":
        path = ScenePath(motions, source.size_wh)
        views, share = stabilized_views(path, fps, crop=Crop.parse(options.crop))
        return ClipViews(indexes.start, views, _cropped(share))
    boxes = [box_at(index) for index in indexes]
    planned = locked_views(motions, boxes, options.locked, fps)
    views = [CameraView(matrix, planned.size_wh) for matrix in planned.out_from_raw]
    distance = _TargetDistance(options.locked)
    for view, box in zip(views, boxes, strict=True):
        distance.add(view, box)
    return ClipViews(indexes.start, views, distance.note)


def live_views(options: VideoOptions, size_wh: tuple[int, int], fps: float) -> Views:
    """The views of a source that is read once, of (width, height) pixels."""
    match options.chosen_view:
        case "raw":
            return RawViews()
        case "stabilized":
            camera = StabilizedCamera(size_wh, fps, crop=Crop.parse(options.crop))
            return LiveStabilizedViews(camera)
        case "locked":
            return LiveLockedViews(LockedCamera(size_wh, options.locked, fps), options.locked)


def _cropped(share: float) -> str:
    return f"{100 * share:.1f} % of width and height cropped"


class _TargetDistance:
    """Root mean square distance of the target from its position in the view, pixels."""

    def __init__(self, config: LockedConfig) -> None:
        self._position = np.array(config.position_xy)
        self._total, self._count, self._width = 0.0, 0, 0

    def add(self, view: CameraView, box: XYWH | None) -> None:
        """Add a frame; None is a target that is lost or has not begun."""
        self._width = view.size_wh[0]
        if box is None:
            return
        x, y, w, h = box
        center_xy = map_point(view.out_from_raw, x + w / 2, y + h / 2)
        self._total += float(np.sum((center_xy - self._position * view.size_wh) ** 2))
        self._count += 1

    @property
    def note(self) -> str:
        """The distance and the width of the view."""
        if not self._count:
            return "no target was followed"
        distance = math.sqrt(self._total / self._count)
        return f"the target is {distance:.1f} px (RMS) from its position, of {self._width} px"


class ViewMotion:
    """Estimates the camera motion for the video while the tracker runs.

    The estimate has a zoom and needs no stabilization; the tracker's own has no zoom.

    Parameters
    ----------
    static_mask : callable
        The mask of what moves with the camera, as `CameraMotion` takes it.
    """

    def __init__(self, static_mask: MaskOf) -> None:
        camera = CameraMotion(model="similarity", mask=static_mask)
        self._camera = PrefetchingCameraMotion(camera)
        self._exclude: list[XYWH] = []

    def start(self, frame: Frame) -> None:
        """Start estimating the motion to the next frame, in another thread."""
        self._camera.start(frame.image, self._exclude or None)

    def finish(self, frame: Frame, tracks: Sequence[Track | None]) -> Motion:
        """The motion to the frame that was started, or to the first one.

        `tracks` are those of the frame; the targets are left out of the next estimate.
        """
        motion = self._camera.update(frame.image)
        self._exclude = [track.box for track in tracks if track is not None and not track.lost]
        return motion
