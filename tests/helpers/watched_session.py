"""A session whose steps are all kept, so that a test can wait for one."""

import queue

import ssiam
from ssiam.web import commands
from ssiam.web.feeds.feed import open_feed
from ssiam.web.info import SessionLimits
from ssiam.web.recording import Recordings
from ssiam.web.session import Session

SECONDS = 20  # after which a test gives up


class Watched:
    """A session with all its steps in a queue."""

    def __init__(self, path, *, stabilize="predict", targets=16, pace="fast"):
        self.steps = queue.Queue()
        self.session = Session(
            open_feed(str(path), pace=pace, notes=lambda note: None),
            ssiam.load_tracker("csrt", stabilize=stabilize),
            "csrt",
            Recordings(),
            limits=SessionLimits(targets),
        )
        self.session.listen(self.steps.put)

    def __enter__(self):
        self.ask_before_it_begins()
        self.session.start()
        self.until(lambda step: True)
        return self

    def __exit__(self, *exc):
        self.session.close()

    def ask_before_it_begins(self):
        """Stand still on the first frame."""
        self.session.submit(commands.Pause(True))
        self.session.submit(commands.Advance())

    def ask(self, command):
        return self.session.submit(command).result(SECONDS)

    def until(self, wanted):
        """The first step from here on that is as wanted."""
        while True:
            step = self.steps.get(timeout=SECONDS)
            if wanted(step):
                return step
