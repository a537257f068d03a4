"""`VideoOptions`: how the video of `ssiam track` looks; and the views of its virtual camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol, TypeAlias

from cyclopts import Group, Parameter

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.motion import CameraMotion, Motion, PrefetchingCameraMotion
from ssiam.render import Border, CameraView, Crop, ScenePath, StabilizedCamera, stabilized_views
from ssiam.track import Track
from ssiam.video import Frame, Overlay

OUTPUT_GROUP = Group("Output", sort_key=2)

ViewName: TypeAlias = Literal["raw", "stabilized"]


@Parameter(name="*")
@dataclass(frozen=True)
class VideoOptions:
    """The look of the video.

    Parameters
    ----------
    view
        Image of the video: raw is the frame as it was shot, stabilized a virtual camera that
        moves smoothly, so that the whole image is still. A file or folder is read twice, and the
        camera's path smoothed as a whole; cameras, streams and standard input get a virtual camera
        without delay. --stabilize is something else: it moves what the tracker sees, not the video.
    crop
        Border that a moved image shows: auto enlarges it so that the border is hidden in 99 % of
        the frames, at most by 15 % of width and height, and limits the correction to that; none
        shows it; a percentage cuts so much away.
    border
        What is shown beyond the edges of the frame: black, its mirror image, or what earlier frames
        showed there.
    overlay
        What is drawn of a target: nothing, its box, box and score (and rotated box and mask),
        box and trail, or its mask.
    side_by_side
        Show the raw frame on the left, and the stabilized view on the right.
    """

    view: Annotated[ViewName | None, Parameter(group=OUTPUT_GROUP, show_default=False)] = None
    crop: Annotated[str, Parameter(group=OUTPUT_GROUP, allow_leading_hyphen=True)] = "auto"
    border: Annotated[Border, Parameter(group=OUTPUT_GROUP)] = "mirror"
    overlay: Annotated[Overlay, Parameter(group=OUTPUT_GROUP)] = "box+score"
    side_by_side: Annotated[bool, Parameter(group=OUTPUT_GROUP, negative=())] = False

    def check(self) -> None:
        """Raise `ArgumentError` for a value out of range, or options that contradict."""
        Crop.parse(self.crop)
        if self.side_by_side and self.view == "raw":
            raise ArgumentError(
                "--side-by-side shows another view beside the raw frame: give --view stabilized, "
                "or omit --view"
            )

    @property
    def chosen_view(self) -> ViewName:
        """The view; that beside the raw frame with ``--side-by-side``."""
        return self.view or ("stabilized" if self.side_by_side else "raw")

    @property
    def is_virtual(self) -> bool:
        """Whether the video shows another view than the raw frame."""
        return self.chosen_view != "raw"

    @property
    def needs_motion(self) -> bool:
        """Whether the camera motion is needed, whatever the tracker needs."""
        return self.is_virtual or self.overlay == "trail"


class Views(Protocol):
    """The views of a virtual camera, in the order of the frames.

    Attributes
    ----------
    share : float
        Share of width and of height that is cropped.
    kind : str
        How the path was found, for the summary.
    """

    share: float
    kind: str

    def of(self, frame: Frame, motion: Motion | None) -> CameraView:
        """The view of the next frame, given the camera motion to it."""


class RawViews:
    """The raw frames."""

    share = 0.0
    kind = "raw"

    def of(self, frame: Frame, motion: Motion | None) -> CameraView:
        """The raw frame."""
        return CameraView.raw((frame.image.shape[1], frame.image.shape[0]))


class LiveViews:
    """Views of a virtual camera without delay."""

    kind = "without delay"

    def __init__(self, camera: StabilizedCamera) -> None:
        self._camera = camera
        self.share = camera.share

    def of(self, frame: Frame, motion: Motion | None) -> CameraView:
        """The view of the next frame."""
        height, width = frame.image.shape[:2]
        return self._camera.update(motion or Motion.none((width, height)))


@dataclass(frozen=True)
class ClipRecord:
    """What the first pass has found about a clip.

    Attributes
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    fps : float
        Frames per second.
    first : int
        Index of the first frame.
    motions : sequence of Motion
        Camera motion to each frame from `first` on.
    """

    size_wh: tuple[int, int]
    fps: float
    first: int
    motions: Sequence[Motion]


class ClipViews:
    """Views of a virtual camera whose path was planned for a whole clip.

    Parameters
    ----------
    first : int
        Index of the first frame.
    views : sequence of CameraView
        Of each frame from `first` on.
    share : float
        Share of width and of height that is cropped.
    """

    kind = "planned for the whole clip"

    def __init__(self, first: int, views: Sequence[CameraView], share: float) -> None:
        self._first, self._views, self.share = first, views, share

    def of(self, frame: Frame, motion: Motion | None) -> CameraView:
        """The view of a frame."""
        return self._views[frame.index - self._first]


def planned_views(options: VideoOptions, clip: ClipRecord) -> Views:
    """The views of a clip that is read twice."""
    match options.chosen_view:
        case "raw":
            return RawViews()
        case "stabilized":
            path = ScenePath(clip.motions, clip.size_wh)
            views, share = stabilized_views(path, clip.fps, crop=Crop.parse(options.crop))
            return ClipViews(clip.first, views, share)


def live_views(options: VideoOptions, size_wh: tuple[int, int], fps: float) -> Views:
    """The views of a source that is read once, of (width, height) pixels."""
    match options.chosen_view:
        case "raw":
            return RawViews()
        case "stabilized":
            return LiveViews(StabilizedCamera(size_wh, fps, crop=Crop.parse(options.crop)))


class ViewMotion:
    """Estimates the camera motion for the video while the tracker runs.

    The estimate has a zoom and needs no stabilization; the tracker's own has no zoom.
    """

    def __init__(self) -> None:
        self._camera = PrefetchingCameraMotion(CameraMotion(model="similarity"))
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
