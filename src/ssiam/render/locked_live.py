"""`LockedCamera`: the locked view of a live stream, without delay."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from ssiam.geometry import XYWH, Transform, frame_center
from ssiam.motion import Motion
from ssiam.render.banded import Floats
from ssiam.render.leveled import camera_steps
from ssiam.render.locked import EDGE_ZOOM, LEAST_WIDE, check_rate, check_recorded, views_from_scene
from ssiam.render.locked_config import LockedConfig

# Times, s, after which 37 % of a deviation is left
_LEVEL: Final = 0.7  # roll and zoom of the recording camera that last longer are kept
_CATCH: Final = 0.10  # distance of the camera from the target
_CATCH_AGAIN: Final = 0.25  # the same when the target was found again
_GRIP: Final = 0.5  # how long it takes from the second to the first
_STOP: Final = 0.3  # speed of the camera while the target is lost
_ZOOM: Final = 0.5  # size of the view
_STILL: Final = 0.4  # path of the recording camera without its shake
_SHAKING: Final = 1.0  # strength of the shake

_MEMORY: Final = 0.6  # of the filter of the target's path (Morrison's fading memory), per frame
_HASTE: Final = 5.0  # how much faster the camera gets if the target leaves the tolerance
_FIRST_SHAKE: Final = 0.02  # frame widths: standard deviation of the shake before it is known
_SHAKE: Final = 3.0  # standard deviations of the shake for which a view leaves room


class LockedCamera:
    """The view that holds the target at its position, frame by frame.

    Threads: one thread at a time for each object; several objects are independent.

    Unlike `locked_views` it does not know what comes: it follows a target that starts or stops
    with a short lag, and a view at the frame's edge moves with the edge.

    Parameters
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    config : LockedConfig, optional
    rate : float
        Frames per second.

    Raises
    ------
    ArgumentError
        The rate is not positive and finite.

    Examples
    --------
    >>> camera = LockedCamera((1920, 1080), LockedConfig(aspect="9:16"))
    >>> for frame in frames:
    ...     track = tracker.update(frame)
    ...     out_from_raw = camera.update(track.motion, None if track.lost else track.box)
    ...     image = cv2.warpAffine(frame, out_from_raw[:2], camera.out_size_wh)
    """

    def __init__(
        self, size_wh: tuple[int, int], config: LockedConfig | None = None, rate: float = 30.0
    ) -> None:
        check_rate(rate)
        self._config = LockedConfig() if config is None else config
        self._frame_wh, self._rate = size_wh, rate
        self._center_xy = np.array(frame_center(size_wh))
        self._aspect = self._config.ratio(size_wh)
        self._full_width = self._config.full_width(size_wh)
        self._scene = _Scene(self._center_xy, rate)
        self._target: _FilteredPath | None = None
        self._target_wh, self._grip = (0.0, 0.0), 1.0
        self._camera_xy, self._speed_xy = self._center_xy.copy(), np.zeros(2)
        self._width = self._full_width
        self._width_speed = 0.0
        self._fixed_width: float | None = None  # that of the first target, if it is to be kept
        self._started = False

    def __repr__(self) -> str:
        return f"LockedCamera({self._frame_wh!r}, {self._config!r}, rate={self._rate})"

    @property
    def out_size_wh(self) -> tuple[int, int]:
        """Width and height of the output, pixels; even."""
        return self._config.size_wh(self._frame_wh)

    def update(self, motion: Motion, box: XYWH | None) -> Transform:
        """The view of the next frame.

        Parameters
        ----------
        motion : Motion
            Camera motion to this frame; that of the first frame is not used.
        box : (x, y, w, h) or None
            The target in this frame, raw-frame pixels; None if it is lost or there is none.

        Returns
        -------
        (3, 3) float64
            out_from_raw: maps raw-frame pixels to output pixels.

        Raises
        ------
        ArgumentError
            The motion is of frames of another size, or the box is empty or not finite.
        """
        check_recorded(motion, box, self._frame_wh)
        self._scene.move(motion if self._started else Motion.none(self._frame_wh, reliable=True))
        if box is None:
            self._grip = 0.0
        else:
            self._see(box)
        if self._started:
            self._move(seen=box is not None)
        elif self._target is not None:
            self._camera_xy = self._wanted_xy(self._width)
            self._width = self._wanted_width(seen=True)
            self._camera_xy = self._wanted_xy(self._width)
        self._started = True
        self._stay_inside()
        out_from_scene = views_from_scene(
            self._camera_xy[None], np.array([self._width]), self.out_size_wh
        )
        return np.asarray(out_from_scene[0] @ self._scene.scene_from_raw)

    def _see(self, box: XYWH) -> None:
        x, y, w, h = box
        scene_xy = self._scene.to_scene(np.array([x + w / 2, y + h / 2]))
        if self._target is None or self._grip == 0:
            self._target = _FilteredPath(scene_xy, _MEMORY)
        else:
            self._target.update(scene_xy)
        self._target_wh = w, h
        if self._started:
            self._grip = min(self._grip + 1 / (_GRIP * self._rate), 1.0)

    def _wanted_width(self, *, seen: bool) -> float:
        """Width of the view from the target's size, and from the room around it."""
        if self._fixed_width is not None:
            return self._fixed_width
        if self._target is None or not seen:
            return self._wide_width()
        w, h = self._target_wh
        needed = max(w, h * self._aspect)
        magnified = self._config.least_width(self._frame_wh)
        contains = min(self._config.least_share * needed, self._wide_width())
        fitting = max(self._fitting_width(self._target.xy), contains, magnified / EDGE_ZOOM)
        wanted = max(needed / self._config.target_share, contains, magnified)
        width = min(wanted, fitting, self._full_width)
        if self._config.zoom == "fixed":
            self._fixed_width = width
        return width

    def _wide_width(self) -> float:
        """Width of the view that shows most, and has room for the shake."""
        width, height = self._scene.still_wh(self._frame_wh).tolist()
        return float(max(min(width, height * self._aspect), LEAST_WIDE * self._full_width))

    def _fitting_width(self, scene_xy: Floats) -> float:
        """Largest width of a view with room for the shake and the target at its position."""
        still_wh = self._scene.still_wh(self._frame_wh)
        position = np.array(self._config.position_xy)
        from_low = scene_xy - self._scene.still.xy + still_wh / 2
        sides = np.array([1, 1 / self._aspect])
        low, high = from_low / (position * sides), (still_wh - from_low) / ((1 - position) * sides)
        return float(min(low.min(), high.min()))

    def _wanted_xy(self, width: float) -> Floats:
        """Center of the view, scene coordinates, that has the target at its position."""
        assert self._target is not None
        shift = 0.5 - np.array(self._config.position_xy)
        return self._target.xy + shift * (width, width / self._aspect)

    def _move(self, *, seen: bool) -> None:
        """Move the camera by one frame."""
        self._zoom(seen=seen)
        if seen and self._target is not None:
            away = self._wanted_xy(self._width) - self._camera_xy
            tolerance = self._config.tolerance * math.sqrt(max(math.prod(self._target_wh), 1))
            excess = min(max(float(np.hypot(*away)) / tolerance, 1.0), _HASTE)
            haste = 1 + (excess - 1) * self._grip
            time = (_CATCH_AGAIN + (_CATCH - _CATCH_AGAIN) * self._grip) / haste
            stiff = min(1 / (time * self._rate), 1.0)
            relative = self._target.speed_xy - self._speed_xy
            change = stiff**2 * away + (1 - (1 - stiff) ** 2) * relative
        else:
            reached = self._within(self._camera_xy)
            stiff = min(1 / (_STOP * self._rate), 1.0)
            change = stiff**2 * (reached - self._camera_xy) - 2 * stiff * self._speed_xy
        width = self._frame_wh[0]
        fastest = self._config.max_speed * width / self._rate
        strongest = self._config.max_acceleration * width / self._rate**2
        speed = np.clip(self._speed_xy + np.clip(change, -strongest, strongest), -fastest, fastest)
        self._camera_xy, self._speed_xy = self._camera_xy + speed, speed

    def _zoom(self, *, seen: bool) -> None:
        """Change the size of the view by one frame: critically damped."""
        stiff = min(1 / (_ZOOM * self._rate), 1.0)
        away = math.log(self._wanted_width(seen=seen) / self._width)
        fastest = math.log(self._config.max_zoom_speed) / self._rate
        speed = self._width_speed + stiff**2 * away - 2 * stiff * self._width_speed
        self._width_speed = min(max(speed, -fastest), fastest)
        self._width = min(self._width * math.exp(self._width_speed), self._full_width)

    def _view_wh(self) -> Floats:
        return np.array([self._width, self._width / self._aspect])

    def _within(self, scene_xy: Floats) -> Floats:
        """The nearest center of a view that has room for the shake."""
        still_wh, still_xy = self._scene.still_wh(self._frame_wh), self._scene.still.xy
        room = np.maximum(still_wh - self._view_wh(), 0) / 2
        return np.clip(scene_xy, still_xy - room, still_xy + room)

    def _stay_inside(self) -> None:
        """Move the center so that the view is inside of the frame."""
        cos, sin = abs(math.cos(self._scene.roll)), abs(math.sin(self._scene.roll))
        grown = math.exp(self._scene.log_zoom)
        w, h = (grown * self._view_wh()).tolist()
        turned = np.array([cos * w + sin * h, cos * h + sin * w])
        room = np.maximum((np.array(self._frame_wh) - turned) / 2, 0)
        raw_xy = self._scene.to_raw(self._camera_xy)
        inside = np.clip(raw_xy, self._center_xy - room, self._center_xy + room)
        if not np.array_equal(inside, raw_xy):
            self._camera_xy = self._scene.to_scene(inside)


class _FilteredPath:
    """A path, by a fading-memory filter of first degree: constant speed without lag."""

    def __init__(self, xy: Floats, memory: float) -> None:
        self.xy: Floats = xy
        self.speed_xy: Floats = np.zeros(2)
        self._memory = memory

    def update(self, xy: Floats) -> None:
        """Take the position in the next frame."""
        expected = self.xy + self.speed_xy
        missed = xy - expected
        self.xy = expected + (1 - self._memory**2) * missed
        self.speed_xy = self.speed_xy + (1 - self._memory) ** 2 * missed


class _Scene:
    """Scene coordinates of the current frame, and the path of the recording camera."""

    def __init__(self, center_xy: Floats, rate: float) -> None:
        self._center_xy = center_xy
        self._origin_xy = center_xy.copy()
        self._keep = math.exp(-1 / (_LEVEL * rate))
        self._follow = 1 - math.exp(-1 / (_SHAKING * rate))
        self.still = _FilteredPath(center_xy, math.exp(-1 / (_STILL * rate)))
        self._shake = np.full(2, (_FIRST_SHAKE * 2 * center_xy[0]) ** 2)  # variance
        self.roll = self.log_zoom = 0.0
        self.scene_from_raw = np.eye(3)

    def move(self, motion: Motion) -> None:
        """Take the motion to the next frame."""
        dx, dy, angle, log_zoom = camera_steps(motion)
        self.roll = self._keep * (self.roll + angle)
        self.log_zoom = self._keep * (self.log_zoom + log_zoom)
        scale = math.exp(-self.log_zoom)
        cos, sin = scale * math.cos(self.roll), scale * math.sin(self.roll)
        turned = np.array([[cos, sin], [-sin, cos]])
        self._origin_xy = self._origin_xy - turned @ (dx, dy)
        self.still.update(self._origin_xy)
        away = self._origin_xy - self.still.xy
        self._shake = self._shake + self._follow * (away**2 - self._shake)
        self.scene_from_raw = np.eye(3)
        self.scene_from_raw[:2, :2] = turned
        self.scene_from_raw[:2, 2] = self._origin_xy - turned @ self._center_xy

    def to_scene(self, raw_xy: Floats) -> Floats:
        """A point of the frame in scene coordinates."""
        return np.asarray(self.scene_from_raw[:2, :2] @ raw_xy + self.scene_from_raw[:2, 2])

    def to_raw(self, scene_xy: Floats) -> Floats:
        """A point of the scene in the frame."""
        linear, shift = self.scene_from_raw[:2, :2], self.scene_from_raw[:2, 2]
        return np.asarray(np.linalg.solve(linear, scene_xy - shift))

    def still_wh(self, frame_wh: tuple[int, int]) -> Floats:
        """Width and height of the part of the scene that stays in the shaking frame."""
        return np.asarray(np.maximum(np.array(frame_wh) - 2 * _SHAKE * np.sqrt(self._shake), 0))
