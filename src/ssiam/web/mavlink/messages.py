"""What the MAVLink camera says, and what the boxes in its commands mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.metadata import version
from typing import Final, TypeAlias

from ssiam.errors import MissingExtraError
from ssiam.geometry import XYWH
from ssiam.web.step import Step, Target

try:
    # Version 2 of the protocol by its module: pymavlink's mavutil would ask the environment.
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
# Half a side of the box around a point that comes without a size, as a share of the width.
_RADIUS: Final = 0.025


def heartbeat() -> Message:
    """HEARTBEAT of a camera that works."""
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_CAMERA,
        dialect.MAV_AUTOPILOT_INVALID,
        base_mode=0,
        custom_mode=0,
        system_status=dialect.MAV_STATE_ACTIVE,
        mavlink_version=3,
    )


def information(size_wh: tuple[int, int] | None, boot_ms: int) -> Message:
    """CAMERA_INFORMATION; the size of the frames is 0x0 as long as none has come."""
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
    """CAMERA_SETTINGS: it takes video, and nobody knows its lens."""
    return dialect.MAVLink_camera_settings_message(
        boot_ms, dialect.CAMERA_MODE_VIDEO, zoomLevel=_UNKNOWN, focusLevel=_UNKNOWN
    )


def acknowledgement(command: int, result: int, sender: tuple[int, int]) -> Message:
    """COMMAND_ACK for the `sender`, a system and a component."""
    return dialect.MAVLink_command_ack_message(
        command, result, target_system=sender[0], target_component=sender[1]
    )


def tracking_status(step: Step, own: int | None, mode: int) -> Message:
    """CAMERA_TRACKING_IMAGE_STATUS: the target `own`, or else the first one of the session.

    `mode` is how the target `own` was begun; others are rectangles. A lost target has no place.
    """
    target = next((each for each in step.targets if each.id == own), None)
    if target is None:
        target, mode = next(iter(step.targets), None), RECTANGLE
    if target is None:
        return _status(dialect.CAMERA_TRACKING_STATUS_FLAGS_IDLE, dialect.CAMERA_TRACKING_MODE_NONE)
    if target.track.lost:
        return _status(dialect.CAMERA_TRACKING_STATUS_FLAGS_ERROR, mode)
    height, width = step.frame.image.shape[:2]
    return _status(
        dialect.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE, mode, *_place(target, mode, (width, height))
    )


def rectangle_box(params: Sequence[float], size_wh: tuple[int, int]) -> XYWH | None:
    """(x, y, w, h) in pixels of the corners of MAV_CMD_CAMERA_TRACK_RECTANGLE; None if it is none.

    They are the left, top, right and bottom as shares of the width and height.
    """
    left, top, right, bottom = params[:4]
    if not all(0 <= value <= 1 for value in params[:4]) or right <= left or bottom <= top:
        return None
    width, height = size_wh
    return left * width, top * height, (right - left) * width, (bottom - top) * height


def point_box(params: Sequence[float], size_wh: tuple[int, int]) -> XYWH | None:
    """(x, y, w, h) in pixels of the square around MAV_CMD_CAMERA_TRACK_POINT; None if it is none.

    The radius is a share of the width; 0 stands for a twentieth of it from side to side.
    """
    if not all(0 <= value <= 1 for value in params[:3]):
        return None
    width, height = size_wh
    x, y, radius = params[0] * width, params[1] * height, (params[2] or _RADIUS) * width
    left, top = max(0.0, x - radius), max(0.0, y - radius)
    right, bottom = min(float(width), x + radius), min(float(height), y + radius)
    return left, top, right - left, bottom - top


def _place(
    target: Target, mode: int, size_wh: tuple[int, int]
) -> tuple[float, float, float, float, float, float, float]:
    """Point, radius, and the rectangle's left, top, right and bottom: shares of the frame."""
    (x, y, w, h), (width, height) = target.track.box, size_wh
    centre = _share(x + w / 2, width), _share(y + h / 2, height)
    radius = max(w, h) / 2 / width if mode == POINT else _UNKNOWN
    top_left = _share(x, width), _share(y, height)
    return *centre, radius, *top_left, _share(x + w, width), _share(y + h, height)


def _status(status: int, mode: int, *place: float) -> Message:
    data = dialect.CAMERA_TRACKING_TARGET_DATA_IN_STATUS if place else 0
    return dialect.MAVLink_camera_tracking_image_status_message(
        status, mode, data, *(place or [_UNKNOWN] * 7)
    )


def _share(pixels: float, whole: int) -> float:
    return min(1.0, max(0.0, pixels / whole))


def _firmware() -> int:
    """The version as CAMERA_INFORMATION has it: a byte each, the major one lowest."""
    parts = [int(part) if part.isdigit() else 0 for part in version("ssiam").split(".")[:3]]
    return sum(part << 8 * place for place, part in enumerate(parts))
