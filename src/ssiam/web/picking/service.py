"""`PickService`: the messages of the picking page (docs/reference/live-protocol.md)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from ssiam.geometry import XYWH, Image
from ssiam.web.picking.commands import (
    AddBox,
    Adjust,
    Click,
    Correct,
    Discard,
    Finish,
    MarkAbsent,
    PickCommand,
    PickState,
    Preview,
    Seek,
    TrackAll,
    Undo,
)
from ssiam.web.picking.session import PickSession, target_name
from ssiam.web.server.incoming import (
    MAX_NUMBER,
    VIEW_PARSERS,
    Fields,
    Message,
    Parsers,
    parse_message,
)
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.outgoing import PROTOCOL, as_json, rounded
from ssiam.web.targets import target_color
from ssiam.web.types import HealthState, Step


def _frame(fields: Fields, name: str = "frame") -> int:
    return fields.integer(name, 0, MAX_NUMBER)


def _id(fields: Fields) -> int:
    return fields.integer("id", 1, MAX_NUMBER)


def _optional_id(fields: Fields) -> int | None:
    return _id(fields) if "id" in fields else None


def _optional_frame(fields: Fields) -> int | None:
    return _frame(fields) if "frame" in fields else None


_PARSERS: Final[Parsers] = {
    "seek": lambda fields: Seek(_frame(fields, "index")),
    "add": lambda fields: AddBox(_frame(fields), fields.box(), _optional_id(fields)),
    "click": lambda fields: Click(_frame(fields), fields.point(), _optional_id(fields)),
    "absent": lambda fields: MarkAbsent(_frame(fields), _id(fields)),
    "adjust": lambda fields: Adjust(_id(fields), fields.box(), _optional_frame(fields)),
    "remove": lambda fields: Discard(_id(fields), _optional_frame(fields)),
    "undo": lambda fields: Undo(),
    "preview": lambda fields: Preview(_optional_id(fields)),
    "track": lambda fields: TrackAll(),
    "finish": lambda fields: Finish(),
    "correct": lambda fields: Correct(),
    **VIEW_PARSERS,
}


class PickService:
    """Connects a picking session to its page.

    Parameters
    ----------
    session : PickSession
    on_clients : callable
        Called on the server's thread with the number of clients, whenever it changes.
    """

    index = "pick.html"
    folder = "written"
    takes_images = False
    state: HealthState = "running"

    def __init__(self, session: PickSession, on_clients: Callable[[int], None]) -> None:
        self._session = session
        self.set_clients = on_clients
        self.files: dict[str, Path] = {}
        """The written files by name, set before they are announced."""

    @property
    def newest(self) -> Step | None:
        """The frame that is shown."""
        return self._session.newest

    def first_texts(self, limits: ServerLimits) -> list[str]:
        """Greeting and state."""
        session = self._session
        hello = as_json(
            type="hello",
            protocol=PROTOCOL,
            ssiam=version("ssiam"),
            source=session.source,
            size=session.size_wh,
            fps=rounded(session.fps),
            length=session.state.length,
            tracker=session.tracker_name,
            limits={"targets": session.limits.targets, "message": limits.message_bytes},
        )
        return [hello, _state_message(session.state)]

    def listen(
        self, on_step: Callable[[Step], None], on_text: Callable[[str], None]
    ) -> list[Callable[[], None]]:
        """Forward frames and states."""
        return self._session.listen(on_step, lambda state: on_text(_state_message(state)))

    def parse(self, text: str) -> Message:
        """Parse a command of the picking page."""
        return parse_message(text, _PARSERS)

    def submit(self, command: PickCommand) -> Future[Any]:
        """Queue a command."""
        return self._session.submit(command)

    def push(self, image: Image) -> None:
        """No frames come from the page."""

    def file(self, path: str) -> tuple[Path, str]:
        """A written file by its name."""
        return self.files[path], path


def _state_message(state: PickState) -> str:
    progress = state.progress
    return as_json(
        type="picking",
        phase=state.phase,
        length=state.length,
        targets=[
            {
                "id": each.id,
                "name": target_name(number),
                "colour": target_color(number),
                "frame": each.frame,
                "box": _rounded_box(each.xywh),
                "keyframes": [
                    {
                        "frame": keyframe.frame,
                        "box": None if keyframe.xywh is None else _rounded_box(keyframe.xywh),
                    }
                    for keyframe in each.keyframes
                ],
            }
            for number, each in enumerate(state.targets)
        ],
        undo=state.can_undo,
        progress=None
        if progress is None
        else {
            "done": progress.done,
            "total": progress.total,
            "fps": None if progress.fps is None else rounded(progress.fps),
        },
        files=[{"kind": each.kind, "name": each.name, "bytes": each.size} for each in state.files],
        notes=state.notes,
    )


def _rounded_box(xywh: XYWH) -> list[float]:
    return [rounded(value) for value in xywh]
