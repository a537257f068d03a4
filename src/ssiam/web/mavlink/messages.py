"""The messages of a MAVLink camera, and the boxes in its commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.metadata import version
from typing import Final, TypeAlias

from ssiam.errors import MissingExtraError
from ssiam.geometry import XYWH
from ssiam.parsing import is_number_word
from ssiam.web.types import Step, Target

try:
    # Version 2 of the protocol. pymavlink's mavutil would take it from environment variables.
    from pymavlink.dialects.v20 import common
except ModuleNotFoundError as error:
    if error.name is None or not error.name.startswith("pymavlink"):
        raise
    raise MissingExtraError(
        "the package pymavlink is not installed, which --mavlink needs: "
        "pip install 'ssiam[mavlink]'"
    ) from error

dialect: Final = common
Message: TypeAlias = common.MAVLink_message
COMPONENT: Final[int] = dialect.MAV_COMP_ID_CAMERA
POINT: Final[int] = dialect.CAMERA_TRACKING_MODE_POINT
RECTANGLE: Final[int] = dialect.CAMERA_TRACKING_MODE_RECTANGLE

_FLAGS: Final[int] = (
    dialect.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT | dialect.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
)
_NAME: Final = list(b"ssiam".ljust(32, b"\0"))
_UNKNOWN: Final = math.nan
# Half a side of the box around a point without a radius, as a fraction of the frame width.
_DEFAULT_RADIUS: Final = 0.025


def heartbeat() -> Message:
    """HEARTBEAT of an active camera."""
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_CAMERA,
        dialect.MAV_AUTOPILOT_INVALID,
        base_mode=0,
        custom_mode=0,
        system_status=dialect.MAV_STATE_ACTIVE,
        mavlink_version=3,
    )


def information(size_wh: tuple[int, int] | None, boot_ms: int) -> Message:
    """CAMERA_INFORMATION; the resolution is 0x0 before the first frame."""
    width, height = size_wh or (0, 0)
    return dialect.MAVLink_camera_information_message(
        boot_ms,
        vendor_name=_NAME,
        model_name=_NAME,
        firmware_version=_firmware(),
        focal_length=_UNKNOWN,
        sensor_size_h=_UNKNOWN,
        sensor_size_v=_UNKNOWN,
        resolution_h=width,
        resolution_v=height,
        lens_id=0,
        flags=_FLAGS,
        cam_definition_version=0,
        cam_definition_uri=b"",
    )


def settings(boot_ms: int) -> Message:
    """CAMERA_SETTINGS: video mode; zoom and focus are unknown."""
    return dialect.MAVLink_camera_settings_message(
        boot_ms, dialect.CAMERA_MODE_VIDEO, zoomLevel=_UNKNOWN, focusLevel=_UNKNOWN
    )


def acknowledgement(command: int, result: int, sender: tuple[int, int]) -> Message:
    """COMMAND_ACK for `sender` (system and component)."""
    return dialect.MAVLink_command_ack_message(
        command, result, target_system=sender[0], target_component=sender[1]
    )


def tracking_status(step: Step, target_id: int | None, mode: int) -> Message:
    """CAMERA_TRACKING_IMAGE_STATUS of the target `target_id`, or else of the session's first one.

    Parameters
    ----------
    step : Step
    target_id : int or None
        Id of the ground station's target.
    mode : int
        Tracking mode in which that target was started; other targets have RECTANGLE.

    Returns
    -------
    Message
        Without a position (NaN) if the target is lost or there is none.
    """
    target = next((each for each in step.targets if each.id == target_id), None)
    if target is None:
        target, mode = next(iter(step.targets), None), RECTANGLE
    if target is None:
        return _status(dialect.CAMERA_TRACKING_STATUS_FLAGS_IDLE, dialect.CAMERA_TRACKING_MODE_NONE)
    if target.track.lost:
        return _status(dialect.CAMERA_TRACKING_STATUS_FLAGS_ERROR, mode)
    height, width = step.frame.image.shape[:2]
    return _status(
        dialect.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE, mode, *_position(target, mode, (width, height))
    )


def rectangle_box(params: Sequence[float], size_wh: tuple[int, int]) -> XYWH | None:
    """The box (x, y, w, h), pixels, of MAV_CMD_CAMERA_TRACK_RECTANGLE; None if it is invalid.

    The parameters are left, top, right and bottom as fractions of the width and height.
    """
    left, top, right, bottom = params[:4]
    if not all(0 <= value <= 1 for value in params[:4]) or right <= left or bottom <= top:
        return None
    width, height = size_wh
    return left * width, top * height, (right - left) * width, (bottom - top) * height


def point_box(params: Sequence[float], size_wh: tuple[int, int]) -> XYWH | None:
    """The box (x, y, w, h), pixels, around MAV_CMD_CAMERA_TRACK_POINT; None if it is invalid.

    The parameters are x, y and the radius, which is half a side of the box, as fractions of the
    width, the height and the width. A radius of 0 stands for 0.025.
    """
    if not all(0 <= value <= 1 for value in params[:3]):
        return None
    width, height = size_wh
    x, y, radius = params[0] * width, params[1] * height, (params[2] or _DEFAULT_RADIUS) * width
    left, top = max(0.0, x - radius), max(0.0, y - radius)
    right, bottom = min(float(width), x + radius), min(float(height), y + radius)
    return left, top, right - left, bottom - top


def _position(
    target: Target, mode: int, size_wh: tuple[int, int]
) -> tuple[float, float, float, float, float, float, float]:
    """Point, radius, and the rectangle's left, top, right, bottom: fractions of the frame."""
    (x, y, w, h), (width, height) = target.track.box, size_wh
    center = _fraction(x + w / 2, width), _fraction(y + h / 2, height)
    radius = max(w, h) / 2 / width if mode == POINT else _UNKNOWN
    top_left = _fraction(x, width), _fraction(y, height)
    return *center, radius, *top_left, _fraction(x + w, width), _fraction(y + h, height)


def _status(status: int, mode: int, *position: float) -> Message:
    data = dialect.CAMERA_TRACKING_TARGET_DATA_IN_STATUS if position else 0
    return dialect.MAVLink_camera_tracking_image_status_message(
        status, mode, data, *(position or [_UNKNOWN] * 7)
    )


def _fraction(pixels: float, size: int) -> float:
    return min(1.0, max(0.0, pixels / size))


def _firmware() -> int:
    """Ssiam's version in the format of CAMERA_INFORMATION: a byte each, major version lowest."""
    parts = [int(part) if is_number_word(part) else 0 for part in version("ssiam").split(".")[:3]]
    return sum(part << 8 * index for index, part in enumerate(parts))
