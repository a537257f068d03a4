"""The messages that the server sends (docs/reference/live-protocol.md), as text and bytes."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any, Final

from ssiam.errors import SsiamError
from ssiam.geometry import frame_center, rigid_parameters
from ssiam.motion import Motion
from ssiam.web.server.incoming import METHODS
from ssiam.web.server.limits import ServerLimits
from ssiam.web.types import (
    CommandError,
    Health,
    Note,
    SessionInfo,
    SessionLimits,
    Step,
    Target,
)

PROTOCOL: Final = 1

_DIGITS: Final = 4  # decimals of pixels, scores and seconds
_FINE_DIGITS: Final = 8  # decimals of angles and transforms, which are multiplied by pixels


def hello_message(info: SessionInfo, session: SessionLimits, server: ServerLimits) -> str:
    """The first message to a client."""
    return as_json(
        type="hello",
        protocol=PROTOCOL,
        ssiam=version("ssiam"),
        source=info.source,
        size=info.size_wh,
        fps=None if info.fps is None else rounded(info.fps),
        length=info.length,
        tracker=info.tracker,
        methods=METHODS,
        seekable=info.seekable,
        webcam=info.webcam,
        limits={
            "targets": session.targets,
            "message": server.message_bytes,
            "picture": server.image_bytes,
        },
    )


def done_message(ask: int, result: Any) -> str:
    """The result of a command."""
    return as_json(type="done", ask=ask, answer=result)


def error_message(ask: int | None, error: SsiamError) -> str:
    """Why a command was refused."""
    code = error.code if isinstance(error, CommandError) else "not-possible"
    return as_json(type="error", ask=ask, code=code, message=str(error))


def note_message(note: Note) -> str:
    """A note for people."""
    return as_json(type="note", level=note.level, message=note.message)


def health_message(health: Health) -> str:
    """Whether the targets are still tracked."""
    return as_json(type="health", state=health.state, message=health.message)


def recordings_message(listing: list[dict[str, Any]]) -> str:
    """The list of recordings."""
    return as_json(type="recordings", recordings=listing)


def step_message(
    step: Step, images: Sequence[tuple[str, bytes]], *, skipped: int, clients: int
) -> bytes:
    """A step as a binary message: length of the header, header, JPEG images.

    Parameters
    ----------
    step : Step
    images : sequence of (view, JPEG)
    skipped : int
        Number of steps that were not sent to this client.
    clients : int
        Number of clients of the server.
    """
    header = as_json(
        type="step",
        number=step.number,
        index=step.frame.index,
        size=[step.frame.image.shape[1], step.frame.image.shape[0]],
        time=None if step.frame.time is None else rounded(step.frame.time),
        stabilize=step.stabilize,
        camera=step.camera,
        pictures=[{"view": view, "bytes": len(jpeg)} for view, jpeg in images],
        targets=[_target(target) for target in step.targets],
        waiting=[
            {"id": each.id, "name": each.name, "colour": each.color, "frame": each.frame}
            for each in step.waiting
        ],
        motion=None if step.motion is None else _motion(step.motion),
        stab_from_raw=[[rounded(v, _FINE_DIGITS) for v in row] for row in step.stab_from_raw[:2]],
        latency=rounded(step.done - step.arrived),
        fps=rounded(step.fps),
        dropped=step.dropped,
        skipped=skipped,
        clients=clients,
        playing=step.playback,
        recording=step.recording,
        error=step.error or None,
    ).encode()
    return b"".join([struct.pack(">I", len(header)), header, *(jpeg for _, jpeg in images)])


def _target(target: Target) -> dict[str, Any]:
    track = target.track
    corners = None
    if track.corners is not None:
        corners = [[rounded(v) for v in corner] for corner in track.corners]
    return {
        "id": target.id,
        "name": target.name,
        "colour": target.color,
        "box": [rounded(v) for v in track.box],
        "corners": corners,
        "score": rounded(track.score),
        "lost": bool(track.lost),
        "found": target.redetected,
        "error": target.error or None,
    }


def _motion(motion: Motion) -> dict[str, Any]:
    dx, dy, angle = rigid_parameters(motion.cur_from_prev, frame_center(motion.size_wh))
    return {
        "dx": rounded(dx),
        "dy": rounded(dy),
        "angle": rounded(angle, _FINE_DIGITS),
        "inliers": rounded(motion.inliers),
        "reliable": bool(motion.reliable),
    }


def rounded(value: float, digits: int = _DIGITS) -> float:
    """The value rounded; 0 for NaN and infinity, which JSON does not have."""
    return round(float(value), digits) if math.isfinite(value) else 0.0


def as_json(**fields: Any) -> str:
    """A message as JSON, without spaces."""
    return json.dumps(fields, separators=(",", ":"), allow_nan=False)
