"""Local servers for the tests of feeds: a file server and a JPEG camera."""

from __future__ import annotations

import http.server
import socketserver
import threading
import time
from contextlib import contextmanager
from functools import partial

import cv2

from helpers.video_clips import numbered_image


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True


@contextmanager
def _serving(handler, port=0):
    with _Server(("127.0.0.1", port), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield server.server_address[1]
        server.shutdown()


@contextmanager
def file_server(folder):
    """A server of the files in `folder`; yields its address."""
    with _serving(partial(_Quiet, directory=folder)) as port:
        yield f"http://127.0.0.1:{port}"


class JpegCamera:
    """A network camera: an endless stream of numbered JPEGs over HTTP.

    `hang_up` closes all connections and refuses new ones until `come_back`.
    """

    def __init__(self, fps=100):
        self._fps = fps
        self._is_up = threading.Event()
        self.size = (160, 96)
        self.sent = 0
        self.come_back()

    def hang_up(self):
        self._is_up.clear()

    def come_back(self, size=(160, 96)):
        self.size = size
        self._is_up.set()

    @contextmanager
    def on_air(self):
        """Start the server; yields its address, which contains a password."""
        camera = self

        class Handler(_Quiet):
            def do_GET(self):
                camera._answer(self)

        with _serving(Handler) as port:
            yield f"http://anna:hunter2@127.0.0.1:{port}/live?key=hunter2"
            self.hang_up()

    def _answer(self, request):
        if not self._is_up.is_set():
            request.send_error(503)
            return
        request.send_response(200)
        request.send_header("Content-Type", "multipart/x-mixed-replace; boundary=part")
        request.end_headers()
        try:
            while self._is_up.is_set():
                request.wfile.write(self._part())
                time.sleep(1 / self._fps)
        except ConnectionError:
            pass

    def _part(self):
        data = cv2.imencode(".jpg", numbered_image(self.sent % 256, *self.size))[1].tobytes()
        self.sent += 1
        head = f"--part\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
        return head.encode() + data + b"\r\n"
