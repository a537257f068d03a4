"""A session that keeps all its steps, so that a test can wait for one."""

import queue

import ssiam
from ssiam.web import Advance, Pause
from ssiam.web.feeds.opening import open_feed
from ssiam.web.recording import Recordings
from ssiam.web.session import Session
from ssiam.web.types import SessionLimits

SECONDS = 20  # timeout of a test


class WatchedSession:
    """A session with all its steps in a queue, paused on the first frame."""

    def __init__(self, path, *, stabilize="predict", targets=16, pace="fast"):
        self.steps = queue.Queue()
        self.session = Session(
            open_feed(str(path), pace=pace, notify=lambda note: None),
            ssiam.load_tracker("csrt", stabilize=stabilize),
            "csrt",
            Recordings(),
            limits=SessionLimits(targets),
        )
        self.session.listen(self.steps.put)

    def __enter__(self):
        self._pause_on_first_frame()
        self.session.start()
        self.until(lambda step: True)
        return self

    def __exit__(self, *exc):
        self.session.close()

    def _pause_on_first_frame(self):
        self.session.submit(Pause(True))
        self.session.submit(Advance())

    def ask(self, command):
        return self.session.submit(command).result(SECONDS)

    def until(self, condition):
        """The next step that meets the condition."""
        while True:
            step = self.steps.get(timeout=SECONDS)
            if condition(step):
                return step
