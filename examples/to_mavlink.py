"""Track a target in a camera or a stream, and send its position to an autopilot (MAVLink).

    python to_mavlink.py rtsp://camera/stream 120,80,40,60 udpout:127.0.0.1:14550

The source may also be a camera's number or a file. The box is x,y,width,height in pixels of the
first frame. It needs ssiam[web,mavlink]; `ssiam live --headless --mavlink` does the same and more.
"""

import sys
import time

import ssiam
from ssiam.web import Add, Session, Step
from ssiam.web.mavlink.camera import MavlinkCamera


def first_step(session: Session) -> Step:
    """Wait for the first frame."""
    while (step := session.newest) is None:
        time.sleep(0.02)
    return step


def main(source: str, box: str, address: str) -> None:
    """Track and send until the source ends, or until Ctrl-C."""
    session = Session.open(source, ssiam.load_tracker())
    with session, MavlinkCamera(session, address):
        x, y, w, h = map(float, box.split(","))
        session.submit(Add((x, y, w, h), first_step(session).number)).result()
        while (step := first_step(session)).playback != "ended":
            print(f"\r{step.targets[0].track if step.targets else 'waiting'}", end="")
            time.sleep(1)


if __name__ == "__main__":
    main(*sys.argv[1:])
