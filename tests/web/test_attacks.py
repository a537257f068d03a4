"""Whoever means no good is refused or dropped, and nobody else notices.

In every test a good client is connected all along, and is sent the session's steps at their rate.
"""

import json
import socket
import struct
import time
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from live_server import HASTY, SECONDS, Client, Watcher, read_all, serving, until
from message_fuzz import fuzzed
from websockets.exceptions import InvalidStatus

from ssiam.web import commands
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.messages import BadMessage, Shown, View, parse_message
from synthetic import generator

PATIENT = ServerLimits(bad_messages=10**6, messages_a_second=10**6, burst=10**6)


@pytest.fixture(scope="module")
def served():
    with serving(needs_token=True) as live:
        watcher = Watcher(live)
        yield live, watcher
        watcher.close()


@pytest.fixture
def live(served):
    """A server that must not be disturbed by what the test does."""
    live, watcher = served
    with watcher.undisturbed():
        yield live
    until(lambda: live.clients == 1)


@pytest.fixture
def token(live):
    return live.server.access.token


def raw_socket(live, *, buffer=None):
    """A connection that has said nothing yet."""
    raw = socket.socket()
    if buffer is not None:
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    raw.settimeout(SECONDS)
    raw.connect(("127.0.0.1", live.port))
    return raw


UPGRADE = (
    *("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13"),
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
)


def handshake(live, *headers, target=None):
    """The request that opens a socket."""
    target = target or "/session?" + live.url.partition("?")[2]
    lines = [f"GET {target} HTTP/1.1", f"Host: 127.0.0.1:{live.port}", *UPGRADE, *headers]
    return "\r\n".join([*lines, "", ""]).encode("latin-1")


def opened(live, **options):
    """A raw connection that has become a socket."""
    raw = raw_socket(live, **options)
    raw.sendall(handshake(live))
    assert raw.recv(12) == b"HTTP/1.1 101"
    return raw


def frame(opcode, payload, *, first=0x80, masked=True, length=None):
    """One frame of a WebSocket, its mask 0."""
    length = len(payload) if length is None else length
    mask = 0x80 if masked else 0
    size = (
        bytes([mask | length]) if length < 126 else struct.pack(">BH", mask | 126, length % 65536)
    )
    if length > 65535:
        size = struct.pack(">BQ", mask | 127, length)
    return bytes([first | opcode]) + size + (bytes(4) if masked else b"") + payload


def read_code(raw):
    """The code that the server closes with."""
    with raw.makefile("rb") as stream:
        while stream.readline() != b"\r\n":
            pass
        while True:
            first, length = stream.read(2)
            if length > 125:
                (length,) = struct.unpack(
                    *((">H", stream.read(2)) if length == 126 else (">Q", stream.read(8)))
                )
            payload = stream.read(length)
            if first == 0x88:
                return int.from_bytes(payload[:2], "big")


def send_until_cut_off(raw, data):
    """Send the same again and again, until nobody takes it."""
    give_up = time.monotonic() + SECONDS
    while time.monotonic() < give_up:
        try:
            raw.sendall(data)
        except (BrokenPipeError, ConnectionResetError):
            return
    raise AssertionError("the server goes on taking it")


def status_of(answer):
    return int(answer.split(b" ", 2)[1])


# Refused before anything happens.

TOKENS = ["", "?token=", "?token=wrong", "?token=" + "x" * 4000, "?Token={}", "?token={}x"]


@pytest.mark.parametrize("query", TOKENS)
def test_without_the_token_nothing_opens(live, token, query):
    query = query.format(token)
    assert live.get(f"/health{query}")[0] == 403
    assert live.get(f"/recordings/a/b{query}")[0] == 403
    assert status_of(live.http(handshake(live, target=f"/session{query}"))) == 403


FOREIGN = [
    "http://evil.example",
    "null",
    "https://127.0.0.1:{}",
    "http://127.0.0.1.evil.example:{}",
]


@pytest.mark.parametrize("origin", FOREIGN)
def test_a_page_from_elsewhere_opens_nothing(live, token, origin):
    origin = origin.format(live.port)
    assert status_of(live.http(handshake(live, f"Origin: {origin}"))) == 403
    assert live.get(f"/health?token={token}", f"Origin: {origin}")[0] == 403


def test_our_own_page_opens_the_socket(live):
    with Client(live, origin=f"http://127.0.0.1:{live.port}") as client:
        client.next("step")


HOSTS = ["evil.example:{}", "evil.example", "127.0.0.1.evil.example:{}", "127.0.0.1", "10.0.0.1:{}"]


@pytest.mark.parametrize("host", HOSTS)
def test_a_name_that_was_made_to_point_here_opens_nothing(live, token, host):
    host = host.format(live.port)
    request = handshake(live).replace(f"127.0.0.1:{live.port}".encode(), host.encode())
    assert status_of(live.http(request)) == 403
    for path in ("/", "/page/main.js", f"/health?token={token}"):
        assert live.get(path, host=host)[0] == 403


NO_HOSTS = [
    ("none", b"GET / HTTP/1.1\r\n\r\n", 400),
    ("none, of old", b"GET / HTTP/1.0\r\n\r\n", 403),
    ("empty", b"GET / HTTP/1.1\r\nHost:\r\n\r\n", 403),
    ("two", b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n", 400),
    ("in the target", b"GET http://evil.example/ HTTP/1.1\r\nHost: evil.example\r\n\r\n", 403),
]


@pytest.mark.parametrize(
    ("request_", "status"), [h[1:] for h in NO_HOSTS], ids=[h[0] for h in NO_HOSTS]
)
def test_a_request_without_one_host_is_refused(live, request_, status):
    assert status_of(live.http(request_)) == status


SECRET = Path(__file__).name  # a file that is there, and must not be found
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
def test_no_path_leads_out_of_the_page(live, token, method):
    for target in TARGETS:
        for query in ("", f"?token={token}"):
            status, headers, body = live.get(target + query, method=method)
            wanted = {404} if query else {404, 403}
            assert status in wanted, target
            assert len(body) < 100
            assert "location" not in headers


BROKEN = [
    ("noise", bytes(range(256)) * 8),
    ("NUL in the path", b"GET /page/\x00 HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    ("space in the path", b"GET /page/a b HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    ("letters beyond ASCII", "GET /pägé HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()),
    ("two lengths", b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n"),
    ("folded header", b"GET / HTTP/1.1\r\n Host: a\r\n\r\n"),
    ("another protocol", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(500)),
    ("endless header", b"GET / HTTP/1.1\r\nHost: a\r\nX: " + b"x" * 300_000),
    ("endless line", b"GET /" + b"x" * 300_000),
]


@pytest.mark.parametrize("request_", [b[1] for b in BROKEN], ids=[b[0] for b in BROKEN])
def test_what_is_no_request_is_refused(live, request_):
    with closing(raw_socket(live)) as raw:
        try:
            raw.sendall(request_)
            answer = read_all(raw)
        except (ConnectionResetError, BrokenPipeError):
            return
    assert answer == b"" or status_of(answer) == 400


def test_only_reading_is_possible(live, token):
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
    ("elsewhere", lambda head: head.replace(b"/session", b"/page/index.html")),
]


@pytest.mark.parametrize("change", [h[1] for h in HANDSHAKES], ids=[h[0] for h in HANDSHAKES])
def test_a_broken_handshake_opens_nothing_and_leaves_nothing(live, change):
    before = live.connections
    assert 400 <= status_of(live.http(change(handshake(live)))) < 500
    until(lambda: live.connections <= before)


# Sent away for what they send.

FRAMES = [
    # name, what is sent, what it is closed with
    ("large text", frame(1, b'"' + b"x" * 65_536), 1009),
    ("claims to be huge", frame(1, b"", length=2**62), 1009),
    ("large in parts", frame(1, b"x" * 40_000, first=0) + frame(0, b"x" * 40_000), 1009),
    ("binary", frame(2, b"\xff\xd8"), 1008),
    ("large binary", frame(2, bytes(70_000)), 1009),
    ("no UTF-8", frame(1, b"\xff\xfe"), 1007),
    ("no mask", frame(1, b"{}", masked=False), 1002),
    ("compressed", frame(1, b"{}", first=0xC0), 1002),
    ("unknown opcode", frame(3, b"{}"), 1002),
    ("long ping", frame(9, bytes(126)), 1002),
    ("part of nothing", frame(0, b"{}"), 1002),
    ("too many that are bad", frame(1, b"{") * 20, 1008),
    ("too many", frame(1, b'{"type":"shown","number":1}') * 600, 1008),
    ("bad close", frame(8, b"\x00"), 1002),
]


@pytest.mark.parametrize(("sent", "code"), [f[1:] for f in FRAMES], ids=[f[0] for f in FRAMES])
def test_a_client_that_sends_what_it_must_not_is_sent_away(live, sent, code):
    with closing(opened(live)) as raw:
        raw.sendall(sent)
        assert read_code(raw) == code


def test_a_text_of_the_largest_size_is_read(live):
    with Client(live) as client:
        client.socket.send(json.dumps({"type": "view", "ask": 7, "x": ""}).ljust(65_536))
        assert client.next("error")["code"] == "bad-message"
        client.socket.send(
            b" " * 0 + json.dumps({"type": "hold"}).rjust(65_537).encode(), text=True
        )
        assert client.close_code() == 1009


def is_harmless(text):
    """Whether the session goes on as it was: the good client does not wait for a paused one."""
    try:
        content = parse_message(text).content
    except BadMessage:
        return True
    return isinstance(content, (Shown, View, commands.Remove, commands.Rename, commands.Hold))


def test_thousands_of_bad_messages_change_nothing():
    texts = [text for text in fuzzed(seed=21, count=3000) if is_harmless(text)]
    assert len(texts) > 2000
    with serving(limits=PATIENT) as live:
        watcher = Watcher(live)
        with watcher.undisturbed(), Client(live) as client:
            for number, text in enumerate(texts):
                client.socket.send(text)
                if number % 50 == 0:  # who does not read is sent away
                    client.ask(type="view")
            assert client.ask(type="steady", method="off")["type"] == "done"
            assert client.next("step")[0]["stabilize"] == "off"
        watcher.close()


def test_noise_on_many_sockets_changes_nothing(live):
    r = generator(22)
    for _ in range(60):
        with closing(opened(live)) as raw:
            for _ in range(20):
                opcode, payload = int(r.integers(16)), r.bytes(int(r.integers(200)))
                first = int(r.choice([0x80, 0x80, 0, 0xF0]))
                try:
                    raw.sendall(frame(opcode, payload, first=first))
                except (BrokenPipeError, ConnectionResetError):
                    break
        until(lambda: live.clients < 4)


# Dropped for what they do not do.


def test_connections_that_say_nothing_are_dropped(live):
    with ExitStack() as stack:
        silent = [stack.enter_context(closing(raw_socket(live))) for _ in range(200)]
        # Meanwhile everybody else gets in.
        assert live.get("/")[0] == 200
        with Client(live) as client:
            client.next("step")
            assert live.connections <= HASTY.connections + 1
        assert [read_all(raw) for raw in silent] == [b""] * 200


def test_sockets_that_say_nothing_are_refused_or_dropped(live):
    with ExitStack() as stack:
        silent, refused = [], 0
        for _ in range(200):
            try:
                client = Client(live, acknowledge=False)
            except InvalidStatus as error:
                refused += error.response.status_code == 403
                continue
            silent.append(stack.enter_context(client))
        assert len(silent) + refused == 200
        assert refused > 0
        assert live.get("/")[0] == 200
        assert {client.close_code() for client in silent} == {1013}


def test_a_client_that_acknowledges_nothing_is_sent_away(live):
    with Client(live, acknowledge=False) as client:
        began = time.monotonic()
        assert client.close_code() == 1013
        assert time.monotonic() - began > 0.9 * HASTY.stall_seconds


def test_a_client_that_acknowledges_but_never_reads_is_dropped():
    with serving(size=(640, 360)) as live:
        watcher = Watcher(live)
        with watcher.undisturbed(), closing(opened(live, buffer=4096)) as raw:
            view = {"type": "view", "raw": True, "steadied": True, "width": 4096, "quality": 95}
            raw.sendall(frame(1, json.dumps(view).encode()))
            number = 0
            try:
                while live.clients > 1:
                    number = live.session.newest.number
                    shown = json.dumps({"type": "shown", "number": number})
                    raw.sendall(frame(1, shown.encode()))
                    time.sleep(0.02)
            except (BrokenPipeError, ConnectionResetError):
                until(lambda: live.clients == 1)
            assert number > 10
            until(lambda: live.connections == 1)
        watcher.close()


def test_one_that_makes_the_server_speak_and_does_not_listen_is_dropped(live):
    # Few enough a second that only their answers are too many.
    limits = ServerLimits(unread_bytes=2**20, frames_a_second=10**9, stall_seconds=999)
    with serving(limits=limits) as other:
        with closing(opened(other, buffer=4096)) as raw:
            send_until_cut_off(raw, frame(9, bytes(125)) * 100)
        until(lambda: other.clients == 0)


MANY = [
    ("pings", frame(9, bytes(125)) * 500),
    ("pongs", frame(10, bytes(125)) * 500),
    ("parts of nothing", frame(1, b"", first=0) + frame(0, b"", first=0) * 500),
]


@pytest.mark.parametrize("data", [m[1] for m in MANY], ids=[m[0] for m in MANY])
def test_one_that_sends_frames_without_end_is_dropped(live, data):
    with closing(opened(live)) as raw:
        send_until_cut_off(raw, data)


def test_one_that_asks_and_does_not_read_is_dropped(live):
    request = f"GET /page/index.html HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\n\r\n".encode()
    before = live.connections
    with closing(raw_socket(live, buffer=4096)) as raw:
        send_until_cut_off(raw, request * 100)
    until(lambda: live.connections <= before)


SLOW = [
    ("headers", "GET / HTTP/1.1\r\nX-Slow: ", 0),
    ("second request", "GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\nGET / HTTP/1.1\r\nX: ", 0),
    ("body", "GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Length: 99999\r\n\r\n", 0),
]


@pytest.mark.parametrize("head", [s[1] for s in SLOW], ids=[s[0] for s in SLOW])
def test_requests_that_come_byte_by_byte_are_dropped(live, head):
    with ExitStack() as stack:
        slow = [stack.enter_context(closing(raw_socket(live))) for _ in range(30)]
        for raw in slow:
            raw.sendall(head.format(live.port).encode())
        began = time.monotonic()
        while slow:
            assert time.monotonic() - began < SECONDS
            slow = [raw for raw in slow if is_heard(raw)]
            time.sleep(0.05)
        assert time.monotonic() - began > 0.9 * HASTY.handshake_seconds
        assert live.get("/")[0] == 200


def is_heard(raw):
    """Whether the other side still takes a byte."""
    try:
        raw.sendall(b"x")
    except (BrokenPipeError, ConnectionResetError):
        return False
    return True
