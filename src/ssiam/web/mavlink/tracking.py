"""`OwnTarget`: the one target that a ground station has begun."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from ssiam.errors import SsiamError
from ssiam.geometry import XYWH
from ssiam.web.commands import Add, Remove
from ssiam.web.errors import CommandError
from ssiam.web.mavlink.commands import Asked
from ssiam.web.mavlink.messages import RECTANGLE, dialect

if TYPE_CHECKING:
    from ssiam.web.session import Session

_log = logging.getLogger(__name__)

_MOST_WAITING: Final = 4  # commands that the session has not answered yet


@dataclass(frozen=True)
class Shown:
    """What the status is to tell of: the target's id, None if there is none, and its mode."""

    id: int | None = None
    mode: int = RECTANGLE


@dataclass(frozen=True)
class _Waiting:
    asked: Asked
    answer: Future[Any]
    mode: int | None  # of the target to be added; None where one was removed
    turn: int


class OwnTarget:
    """Begins and ends a target in a session; targets of others are left alone.

    Nothing here waits: `answered` gives the results of what the session has carried out. To be
    used by one thread; `shown` may be read by any.

    Parameters
    ----------
    session : Session
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._waiting: list[_Waiting] = []
        self._turn = 0
        self.shown = Shown()

    def begin(self, asked: Asked, xywh: XYWH, mode: int) -> int | None:
        """Follow what is in `xywh` (raw-frame pixels) in place of the target before.

        A MAV_RESULT where that is known at once, else None, and `answered` will give it.
        """
        if len(self._waiting) >= _MOST_WAITING:
            return int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
        self._give_up()
        answer = self._session.submit(Add(xywh))
        self._waiting.append(_Waiting(asked, answer, mode, self._turn))
        return None

    def end(self, asked: Asked) -> int | None:
        """Follow the target no longer; what comes out is as with `begin`."""
        answer = self._give_up()
        if answer is None:
            return int(dialect.MAV_RESULT_ACCEPTED)
        self._waiting.append(_Waiting(asked, answer, None, self._turn))
        return None

    def answered(self) -> Iterator[tuple[Asked, int]]:
        """What the session has answered since the last call, with its MAV_RESULT."""
        done = [each for each in self._waiting if each.answer.done()]
        self._waiting = [each for each in self._waiting if each not in done]
        for each in done:
            result = _result(each.answer)
            if each.mode is None:
                # Gone is gone, whoever removed it.
                result = dialect.MAV_RESULT_ACCEPTED
            elif result == dialect.MAV_RESULT_ACCEPTED:
                self._take(each.answer.result(), each.mode, each.turn)
            yield each.asked, result

    def _take(self, id: int, mode: int, turn: int) -> None:
        if turn == self._turn:
            self.shown = Shown(id, mode)
        else:
            # Another command came while the session was busy with this one.
            self._session.submit(Remove(id))

    def _give_up(self) -> Future[Any] | None:
        self._turn += 1
        id, self.shown = self.shown.id, Shown()
        return None if id is None else self._session.submit(Remove(id))


def _result(answer: Future[Any]) -> int:
    """The MAV_RESULT that says what became of a command."""
    if answer.cancelled():
        return int(dialect.MAV_RESULT_FAILED)
    error = answer.exception()
    if error is None:
        return int(dialect.MAV_RESULT_ACCEPTED)
    if not isinstance(error, SsiamError):
        _log.error("a MAVLink command failed", exc_info=error)
    if isinstance(error, CommandError) and error.code == "bad-box":
        return int(dialect.MAV_RESULT_DENIED)
    return int(dialect.MAV_RESULT_FAILED)
