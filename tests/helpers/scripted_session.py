"""A session whose every step is written by the test."""

import queue
import threading
import time
from concurrent.futures import Future

import numpy as np

from ssiam.geometry import IDENTITY
from ssiam.track import Track
from ssiam.video import Frame
from ssiam.web.commands import Add, Remove
from ssiam.web.errors import CommandError
from ssiam.web.info import SessionInfo
from ssiam.web.rota import Rota
from ssiam.web.step import Step, Target

SECONDS = 10  # after which a test gives up
SIZE = (640, 360)


class ScriptedSession:
    """Stands for a `Session`: on a thread of its own, but a step comes when it is told to.

    `targets` are those of the next step, `asked` is all that was asked for.
    """

    def __init__(self):
        self.newest = None
        self.targets, self.asked, self.refusal = {}, [], None
        self.busy = threading.Event()
        self.busy.set()
        self._given = 0
        self._listeners = Rota()
        self._work = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def info(self):
        size = SIZE if self.newest else None
        return SessionInfo("script", size, 30.0, None, "none", False, False)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exc):
        self._work.put((None, None))
        self._thread.join()

    def say(self, note):
        """Nobody listens to notes."""

    def listen(self, listener):
        return self._listeners.add(listener)

    def submit(self, command):
        answer = Future()
        self._work.put((command, answer))
        return answer

    def step(self):
        """Make a step, and wait until everybody has been told."""
        return self.submit("step").result(SECONDS)

    def draw(self, id, box, lost=False):
        """Where a target is from the next step on."""
        self._given = max(self._given, id)
        self.targets[id] = Target(id, f"target {id}", "#ffffff", Track(box, lost=lost))

    def _run(self):
        while True:
            command, answer = self._work.get()
            if command is None:
                return
            if command == "step":
                answer.set_result(self._step())
                continue
            self.busy.wait(SECONDS)
            self.asked.append(command)
            try:
                answer.set_result(self._carry_out(command))
            except CommandError as error:
                answer.set_exception(error)

    def _carry_out(self, command):
        match command:
            case Add(xywh) if self.refusal is None:
                self.draw(self._given + 1, xywh)
                return self._given
            case Add():
                raise CommandError(self.refusal, "so it was written")
            case Remove(id):
                if self.targets.pop(id, None) is None:
                    raise CommandError("no-such-target", f"there is no target {id}")

    def _step(self):
        number = self.newest.number + 1 if self.newest else 1
        frame = Frame(number - 1, None, np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
        targets, now = tuple(self.targets.values()), time.monotonic()
        self.newest = Step(
            number, frame, targets, None, IDENTITY, "off", now, now, 30.0, 0, "playing"
        )
        self._listeners.tell(self.newest)
        return self.newest
