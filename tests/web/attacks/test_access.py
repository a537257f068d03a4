"""Requests without the token or from a foreign origin are refused."""

import pytest
from websockets.exceptions import InvalidStatus

from helpers.live_clients import Client
from helpers.live_server import serving
from helpers.raw_sockets import handshake, status_of

TOKENS = ["", "?token=", "?token=wrong", "?token=" + "x" * 4000, "?Token={}", "?token={}x"]


def test_without_a_token_other_pages_of_the_browser_are_refused():
    with serving(needs_token=False) as live:
        here = f"127.0.0.1:{live.port}"
        assert live.get("/health", f"Origin: http://{here}")[0] == 200
        for origin in ("http://evil.example", f"http://localhost:{live.port}", "null"):
            assert live.get("/health", f"Origin: {origin}")[0] == 403
            with pytest.raises(InvalidStatus, match="403"):
                Client(live, origin=origin)
        assert live.get("/health", host=f"evil.example:{live.port}")[0] == 403, "DNS rebinding"


@pytest.mark.parametrize("query", TOKENS)
def test_without_the_token_every_path_is_refused(live, token, query):
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
def test_a_foreign_origin_is_refused(live, token, origin):
    origin = origin.format(live.port)
    assert status_of(live.http(handshake(live, f"Origin: {origin}"))) == 403
    assert live.get(f"/health?token={token}", f"Origin: {origin}")[0] == 403


def test_the_own_origin_is_accepted(live):
    with Client(live, origin=f"http://127.0.0.1:{live.port}") as client:
        client.next("step")


HOSTS = ["evil.example:{}", "evil.example", "127.0.0.1.evil.example:{}", "127.0.0.1", "10.0.0.1:{}"]


@pytest.mark.parametrize("host", HOSTS)
def test_a_foreign_host_name_is_refused(live, token, host):
    host = host.format(live.port)
    request = handshake(live).replace(f"127.0.0.1:{live.port}".encode(), host.encode())
    assert status_of(live.http(request)) == 403
    for path in ("/", "/page/main.js", f"/health?token={token}"):
        assert live.get(path, host=host)[0] == 403


NO_HOSTS = [
    ("none", b"GET / HTTP/1.1\r\n\r\n", 400),
    ("none, HTTP/1.0", b"GET / HTTP/1.0\r\n\r\n", 403),
    ("empty", b"GET / HTTP/1.1\r\nHost:\r\n\r\n", 403),
    ("two", b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n", 400),
    ("in the target", b"GET http://evil.example/ HTTP/1.1\r\nHost: evil.example\r\n\r\n", 403),
]


@pytest.mark.parametrize(
    ("request_", "status"), [h[1:] for h in NO_HOSTS], ids=[h[0] for h in NO_HOSTS]
)
def test_a_request_must_have_exactly_one_host(live, request_, status):
    assert status_of(live.http(request_)) == status
