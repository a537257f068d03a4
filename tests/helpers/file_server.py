"""A server on loopback that serves one file as badly as a test asks for."""

import re
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


class Behavior:
    """What the server does; `requests` has the headers of each request."""

    def __init__(self, content, **settings):
        self.content = content
        self.cut_after = None  # bytes of each answer, then the connection is closed
        self.cuts = 10**9  # how many answers are cut
        self.length = None  # Content-Length instead of the true one
        self.pause = 0.0  # seconds between two thirds of the content
        self.redirects = 0  # redirections before the file
        self.target = None  # where the last redirection points
        self.status = 200
        self.tag = '"one"'
        self.requests = []
        self.__dict__.update(settings)


@contextmanager
def serve(content, **settings):
    """Yield the address of a file and the `Behavior` of its server."""
    behavior = Behavior(content, **settings)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            behavior.requests.append({"path": self.path, **self.headers})
            if behavior.status != 200:
                self.send_error(behavior.status)
                return
            if behavior.redirects:
                behavior.redirects -= 1
                last = behavior.target if not behavior.redirects else None
                self.send_response(302)
                self.send_header("Location", last or f"/moved{behavior.redirects}")
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            self.send_file()

        def send_file(self):
            start, tag = 0, self.headers.get("If-Range")
            asked = re.fullmatch(r"bytes=(\d+)-", self.headers.get("Range", ""))
            if asked and tag == behavior.tag:
                start = int(asked[1])
            body = behavior.content[start:]
            self.send_response(206 if start else 200)
            self.send_header("ETag", behavior.tag)
            if start:
                total = len(behavior.content)
                self.send_header("Content-Range", f"bytes {start}-{total - 1}/{total}")
            self.send_header("Content-Length", str(behavior.length or len(body)))
            self.end_headers()
            if behavior.cut_after is not None and behavior.cuts > 0:
                behavior.cuts -= 1
                body = body[: behavior.cut_after]
            third = len(body) // 3 + 1
            for begin in range(0, len(body), third):
                self.wfile.write(body[begin : begin + third])
                self.wfile.flush()
                time.sleep(behavior.pause)
            self.close_connection = True

        def log_message(self, *arguments):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/file.bin", behavior
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
