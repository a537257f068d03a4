"""Who is let in, and where the server listens."""

import asyncio
import re
import socket
from contextlib import closing

import pytest

from ssiam.web.server.guard import Access, Guard
from ssiam.web.server.listening import ServerError, access_to, listen, page_address

PORT = 8765
TOKEN = "s3cret-token"
OPEN = Access(PORT)
CLOSED = Access(PORT, token=TOKEN)
NETWORK = Access(PORT, frozenset({"boat.local"}), any_address=True, token=TOKEN)
HERE = {"host": f"127.0.0.1:{PORT}"}
PAGE = {"/", "/page/main.js"}


def ask(access, kind="http", path="/health", query="", method="GET", headers=HERE):
    """Status and headers of the answer; 200, and 101 for sockets, where the app was reached."""
    sent = []

    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200 if kind == "http" else 101})

    async def receive():
        return {"type": f"{kind}.connect"}

    async def send(event):
        sent.append(event)

    pairs = headers.items() if isinstance(headers, dict) else headers
    scope = {
        **{"type": kind, "path": path, "query_string": query.encode(), "method": method},
        "headers": [(k.encode(), v.encode("latin-1")) for k, v in pairs],
    }
    asyncio.run(Guard(app, access, PAGE.__contains__)(scope, receive, send))
    first = sent[0]
    status = 403 if first["type"] == "websocket.close" else first["status"]
    return status, dict(first.get("headers", []))


HOSTS = [
    # access, Host, whether it is this server
    (OPEN, "127.0.0.1:8765", True),
    (OPEN, "localhost:8765", True),
    (OPEN, "LocalHost:8765", True),
    (OPEN, "[::1]:8765", True),
    (OPEN, "127.0.0.1", False),
    (OPEN, "127.0.0.1:80", False),
    (OPEN, "127.0.0.1:87650", False),
    (OPEN, "127.0.0.1:", False),
    (OPEN, "127.0.0.1:+8765", False),
    (OPEN, "127.0.0.1:8765:8765", False),
    (OPEN, "127.0.0.1:\xb28765", False),
    (OPEN, "127.0.0.1:" + "8" * 6000, False),
    (OPEN, "[::1]", False),
    (OPEN, "[]:8765", False),
    (OPEN, "evil.example:8765", False),
    (OPEN, "localhost.evil.example:8765", False),
    (OPEN, "127.0.0.1.evil.example:8765", False),
    (OPEN, "evil.example:8765@127.0.0.1:8765", False),
    (OPEN, "192.168.1.5:8765", False),
    (OPEN, "", False),
    (Access(80), "localhost", True),
    (Access(80), "[::1]", True),
    (Access(80), "localhost:80", True),
    (NETWORK, "192.168.1.5:8765", True),
    (NETWORK, "[fe80::1]:8765", True),
    (NETWORK, "boat.local:8765", True),
    (NETWORK, "evil.example:8765", False),
    (NETWORK, "1.2.3.4.evil.example:8765", False),
]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(("access", "host", "known"), HOSTS)
def test_host_must_be_this_server(access, host, known, kind):
    query = f"token={access.token}"
    status, _ = ask(access, kind, query=query, headers={"host": host})
    assert (status != 403) == known


def test_host_is_asked_for_before_anything_else():
    assert ask(OPEN, path="/", headers={})[0] == 403
    assert ask(OPEN, path="/", headers=[("host", "localhost:8765")] * 2)[0] == 403
    assert ask(OPEN, path="/", headers={"host": "evil.example"})[0] == 403


ORIGINS = [
    ("http://127.0.0.1:8765", True),
    ("HTTP://127.0.0.1:8765", True),
    ("https://127.0.0.1:8765", False),
    ("http://localhost:8765", False),
    ("http://127.0.0.1:8766", False),
    ("http://127.0.0.1", False),
    ("http://evil.example", False),
    ("http://127.0.0.1:8765.evil.example", False),
    ("null", False),
    ("", False),
]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(("origin", "own"), ORIGINS)
def test_origin_must_be_this_server(origin, own, kind):
    assert (ask(OPEN, kind, headers=HERE | {"origin": origin})[0] != 403) == own


TOKENS = [
    # query, Authorization, whether that is enough
    ("token=s3cret-token", None, True),
    ("", "Bearer s3cret-token", True),
    ("", "bearer  s3cret-token", True),
    ("token=s3cret-token", "Bearer s3cret-token", True),
    ("token=s3cret%2Dtoken", None, True),
    ("", None, False),
    ("token=", None, False),
    ("token=S3cret-token", None, False),
    ("token=s3cret-toke", None, False),
    ("token=s3cret-token%00", None, False),
    ("token=%ff%fe", None, False),
    ("token=wrong&token=s3cret-token", None, False),
    ("token=wrong", "Bearer s3cret-token", False),
    ("Token=s3cret-token", None, False),
    ("", "Basic s3cret-token", False),
    ("", "s3cret-token", False),
    ("", "Bearer \xfe", False),
]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(("query", "authorization", "enough"), TOKENS)
def test_token_is_asked_for_where_it_is_needed(query, authorization, enough, kind):
    headers = HERE if authorization is None else HERE | {"authorization": authorization}
    assert (ask(CLOSED, kind, query=query, headers=headers)[0] != 403) == enough
    assert ask(OPEN, kind, query=query, headers=headers)[0] != 403


PATHS = [("/", 200), ("/page/main.js", 200), ("/page/other.js", 403), ("/page/", 403)]


@pytest.mark.parametrize(
    ("path", "status"), [*PATHS, ("/recordings/a/b", 403), ("//", 403), ("/session", 403)]
)
def test_only_the_page_is_read_without_a_token(path, status):
    assert ask(CLOSED, path=path)[0] == status
    assert ask(CLOSED, "websocket", path=path)[0] == 403


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "get", "BREW"])
def test_only_reading_is_possible(method):
    status, headers = ask(OPEN, path="/", method=method)
    assert status == 405
    assert headers[b"allow"] == b"GET, HEAD"


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "evil.example"])
def test_every_answer_tells_browsers_to_be_careful(host):
    _, headers = ask(OPEN, path="/", headers={"host": host})
    policy = headers[b"content-security-policy"].decode()
    assert policy.startswith("default-src 'none';")
    assert "unsafe" not in policy
    assert headers[b"x-content-type-options"] == b"nosniff"
    assert headers[b"referrer-policy"] == b"no-referrer"
    assert headers[b"cache-control"] == b"no-store"


LISTENERS = [
    # host, whether a token is asked for, needed at last, names
    ("127.0.0.1", False, False, {"127.0.0.1", "localhost", "::1"}),
    ("localhost", False, False, {"localhost"}),
    ("127.0.0.2", False, False, {"127.0.0.2"}),
    ("127.0.0.1", True, True, {"127.0.0.1"}),
    ("0.0.0.0", False, True, {socket.gethostname().lower()}),
]


@pytest.mark.parametrize(("host", "wanted", "needed", "names"), LISTENERS)
def test_only_the_loopback_needs_no_token(host, wanted, needed, names):
    with closing(listen(host, 0)) as listener:
        access = access_to(listener, host, needs_token=wanted)
        assert access.port == listener.getsockname()[1]
        assert (access.token is not None) == needed
        assert names <= access.names
        assert access.any_address == (host == "0.0.0.0")
        address = page_address(listener, access)
    pattern = rf"http://[\w.\[\]:]+:{access.port}/(#token=[\w-]{{43}})?"
    assert re.fullmatch(pattern, address)
    assert ("#token=" in address) == needed
    assert "0.0.0.0" not in address


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="no addresses of version 6")
@pytest.mark.parametrize(("host", "needed"), [("::1", False), ("::", True)])
def test_addresses_of_version_6_are_as_good(host, needed):
    with closing(listen(host, 0)) as listener:
        access = access_to(listener, host, needs_token=False)
        assert (access.token is not None) == needed
        assert access.knows(f"[::1]:{access.port}")
        assert access.knows(f"[2001:db8::7]:{access.port}") == needed
        assert "[::]" not in page_address(listener, access)


def test_tokens_are_never_the_same():
    with closing(listen("127.0.0.1", 0)) as listener:
        tokens = {access_to(listener, "x", needs_token=True).token for _ in range(3)}
    assert len(tokens) == 3


def test_a_taken_port_is_named_in_one_line():
    with closing(listen("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(ServerError, match=rf"127\.0\.0\.1, port {port} .*--port") as caught:
            listen("127.0.0.1", port)
    assert "\n" not in str(caught.value)


PLACES = [("203.0.113.9", 0), ("no such name", 0), ("x" * 300, 0), ("127.0.0.1", 65536)]


@pytest.mark.parametrize(("host", "port"), PLACES, ids=["elsewhere", "no name", "long", "port"])
def test_where_nobody_can_listen_is_named_in_one_line(host, port):
    with pytest.raises(ServerError) as caught:
        listen(host, port)
    assert "\n" not in str(caught.value)
