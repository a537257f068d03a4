"""Malformed requests, and paths outside of the page, are refused."""

from contextlib import closing
from pathlib import Path

import pytest

from helpers.live_server import read_all, until
from helpers.raw_sockets import handshake, raw_socket, status_of

TARGETS = [
    *("/page/../serving.py", "/page/%2e%2e/serving.py", "/page/..%2fserving.py", "/../etc/passwd"),
    *("/page/%2e%2e%2f%2e%2e%2fweb%2fserving.py", "//etc/passwd", "/page//etc/passwd", "/page/"),
    *("/page/..\\serving.py", "/page/..%5cserving.py", "/page/%252e%252e/serving.py", "/page"),
    *("/page/index.html%00", "/page/%00", "/page/index.html/", "/page/./index.html", "/page/."),
    *("/page/INDEX.HTML", "/page/index.html%20", "/page/%ff%fe", "/page/index.html::$DATA"),
    f"/page/{Path(__file__)}",
    f"/page/{str(Path(__file__)).replace('/', '%2f')}",
    f"file://{Path(__file__)}",
    *(f"/recordings/{name}" for name in ("", "..", "../..", "%2e%2e/passwd", "a/b", "a/%00")),
    *("/recordings/..%2f..%2fetc/passwd", "/recordings//etc/passwd", "/recordings/a/b/c"),
    *("/session/../page/../serving.py", "/.git/config", "/app.py", "/page/__init__.py", "*"),
]


@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_no_path_reaches_other_files(live, token, method):
    for target in TARGETS:
        for query in ("", f"?token={token}"):
            status, headers, body = live.get(target + query, method=method)
            expected = {404} if query else {404, 403}
            assert status in expected, target
            assert len(body) < 100
            assert "location" not in headers


BROKEN = [
    ("noise", bytes(range(256)) * 8),
    ("NUL in the path", b"GET /page/\x00 HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    ("space in the path", b"GET /page/a b HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    ("non-ASCII letters", "GET /pägé HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()),
    ("two lengths", b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n"),
    ("folded header", b"GET / HTTP/1.1\r\n Host: a\r\n\r\n"),
    ("another protocol", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(500)),
    ("endless header", b"GET / HTTP/1.1\r\nHost: a\r\nX: " + b"x" * 300_000),
    ("endless line", b"GET /" + b"x" * 300_000),
]


@pytest.mark.parametrize("request_", [b[1] for b in BROKEN], ids=[b[0] for b in BROKEN])
def test_a_malformed_request_is_refused(live, request_):
    with closing(raw_socket(live)) as raw:
        try:
            raw.sendall(request_)
            answer = read_all(raw)
        except (ConnectionResetError, BrokenPipeError):
            return
    assert answer == b"" or status_of(answer) == 400


def test_only_get_and_head_are_allowed(live, token):
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"):
        assert live.get(f"/health?token={token}", method=method)[0] == 405
    request = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\nContent-Length: 1000000\r\n\r\n"
    with closing(raw_socket(live)) as raw:
        raw.sendall(request.encode())
        assert status_of(raw.recv(1000)) == 405


HANDSHAKES = [
    ("no key", lambda head: head.replace(b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n", b"")),
    ("bad key", lambda head: head.replace(b"AAAA==", b"!")),
    ("old version", lambda head: head.replace(b"Version: 13", b"Version: 8")),
    ("long line", lambda head: head[:-2] + b"X: " + b"x" * 9000 + b"\r\n\r\n"),
    ("many lines", lambda head: head[:-2] + b"X: x\r\n" * 200 + b"\r\n"),
    ("other path", lambda head: head.replace(b"/session", b"/page/index.html")),
]


@pytest.mark.parametrize("change", [h[1] for h in HANDSHAKES], ids=[h[0] for h in HANDSHAKES])
def test_a_malformed_handshake_is_refused_and_closed(live, change):
    before = live.connections
    assert 400 <= status_of(live.http(change(handshake(live)))) < 500
    until(lambda: live.connections <= before)
