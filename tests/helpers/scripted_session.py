"""A session whose steps are made by the test."""

import queue
import threading
import time
from concurrent.futures import Future

import numpy as np

from ssiam.geometry import IDENTITY
from ssiam.track import Track
from ssiam.video import Frame
from ssiam.web.events import Listeners
from ssiam.web.types import Add, CommandError, Remove, SessionInfo, Step, Target

SECONDS = 10  # timeout of a test
SIZE = (640, 360)


class ScriptedSession:
    """A stand-in for `Session`, on its own thread, that makes a step when `step` is called.

    `targets` are those of the next step; `submitted` are all commands so far. Commands are
    executed while `ready` is set, and refused with the code `refusal` if it is not None.
    """

    def __init__(self):
        self.newest = None
        self.targets, self.submitted, self.refusal = {}, [], None
        self.ready = threading.Event()
        self.ready.set()
        self._last_id = 0
        self._listeners = Listeners()
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

    def notify(self, note):
        """Notes are discarded."""

    def listen(self, listener):
        return self._listeners.add(listener)

    def submit(self, command):
        answer = Future()
        self._work.put((command, answer))
        return answer

    def step(self):
        """Make a step, and wait until all listeners were called."""
        return self.submit("step").result(SECONDS)

    def set_target(self, id, box, lost=False):
        """Set a target's box from the next step on."""
        self._last_id = max(self._last_id, id)
        self.targets[id] = Target(id, f"target {id}", "#ffffff", Track(box, lost=lost))

    def _run(self):
        while True:
            command, answer = self._work.get()
            if command is None:
                return
            if command == "step":
                answer.set_result(self._step())
                continue
            self.ready.wait(SECONDS)
            self.submitted.append(command)
            try:
                answer.set_result(self._execute(command))
            except CommandError as error:
                answer.set_exception(error)

    def _execute(self, command):
        match command:
            case Add(xywh) if self.refusal is None:
                self.set_target(self._last_id + 1, xywh)
                return self._last_id
            case Add():
                raise CommandError(self.refusal, "refused by the script")
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
        self._listeners.notify(self.newest)
        return self.newest
