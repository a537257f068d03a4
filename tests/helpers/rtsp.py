"""`RtspServer`: the program rtsp_server.py as a process."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

_SYSTEM_PYTHON = "/usr/bin/python3"
_SERVER = Path(__file__).with_name("rtsp_server.py")
# Debian's packages; gstreamer1.0-plugins-good is a dependency.
_PACKAGES = "gir1.2-gst-rtsp-server-1.0 python3-gi"
_PROBE = (
    "import gi; gi.require_version('GstRtspServer', '1.0');"
    "from gi.repository import Gst, GstRtspServer; Gst.init(None);"
    "assert all(map(Gst.ElementFactory.find, ('qtdemux', 'appsrc', 'rtph264pay', 'rtpbin')))"
)
TIMEOUT = 20.0  # seconds


def missing_rtsp():
    """Why no server can run on this machine, or None."""
    found = shutil.which(_SYSTEM_PYTHON) is not None
    if not found or subprocess.run([_SYSTEM_PYTHON, "-c", _PROBE], capture_output=True).returncode:
        return f"no GStreamer RTSP server here: apt install {_PACKAGES}"
    return None


def wait_for(condition):
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end, "timed out"
        time.sleep(0.01)


class RtspServer:
    """The server's process, always on the same port; a context manager."""

    def __init__(self):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.address = f"rtsp://user:secret@127.0.0.1:{self.port}/clip"
        self._process = None

    def start(self, clip):
        command = [_SYSTEM_PYTHON, _SERVER, str(self.port), clip]
        self._process = subprocess.Popen(command)
        wait_for(self._answers)
        return self

    def signal(self, number):
        os.kill(self._process.pid, number)

    def kill(self):
        self._process.kill()
        self._process.wait()

    def _answers(self):
        assert self._process.poll() is None, "the server has ended"
        try:
            socket.create_connection(("127.0.0.1", self.port)).close()
        except ConnectionRefusedError:
            return False
        return True

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        self.kill()
