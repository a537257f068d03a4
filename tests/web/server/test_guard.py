"""Access by host, origin, token, path and method."""

import asyncio

import pytest

from ssiam.web.server.guard import Access, Guard

PORT = 8765
TOKEN = "s3cret-token"
OPEN = Access(PORT)
CLOSED = Access(PORT, token=TOKEN)
NETWORK = Access(PORT, frozenset({"boat.local"}), any_address=True, token=TOKEN)
HERE = {"host": f"127.0.0.1:{PORT}"}
PAGE = {"/", "/page/main.js"}


def request(access, kind="http", path="/health", query="", method="GET", headers=HERE):
    """Status and headers of the response; 200 (101 for a WebSocket) if the app was reached."""
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
    # access, Host, whether it is accepted
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
    status, _ = request(access, kind, query=query, headers={"host": host})
    assert (status != 403) == known


def test_the_host_is_checked_first():
    assert request(OPEN, path="/", headers={})[0] == 403
    assert request(OPEN, path="/", headers=[("host", "localhost:8765")] * 2)[0] == 403
    assert request(OPEN, path="/", headers={"host": "evil.example"})[0] == 403


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
    assert (request(OPEN, kind, headers=HERE | {"origin": origin})[0] != 403) == own


TOKENS = [
    # query, Authorization, whether it is accepted
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
@pytest.mark.parametrize(("query", "authorization", "accepted"), TOKENS)
def test_the_token_must_be_correct(query, authorization, accepted, kind):
    headers = HERE if authorization is None else HERE | {"authorization": authorization}
    assert (request(CLOSED, kind, query=query, headers=headers)[0] != 403) == accepted
    assert request(OPEN, kind, query=query, headers=headers)[0] != 403


PATHS = [("/", 200), ("/page/main.js", 200), ("/page/other.js", 403), ("/page/", 403)]


@pytest.mark.parametrize(
    ("path", "status"), [*PATHS, ("/recordings/a/b", 403), ("//", 403), ("/session", 403)]
)
def test_only_the_page_is_public(path, status):
    assert request(CLOSED, path=path)[0] == status
    assert request(CLOSED, "websocket", path=path)[0] == 403


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "get", "BREW"])
def test_only_get_and_head_are_allowed(method):
    status, headers = request(OPEN, path="/", method=method)
    assert status == 405
    assert headers[b"allow"] == b"GET, HEAD"


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "evil.example"])
def test_every_response_has_security_headers(host):
    _, headers = request(OPEN, path="/", headers={"host": host})
    policy = headers[b"content-security-policy"].decode()
    assert policy.startswith("default-src 'none';")
    assert "unsafe" not in policy
    assert headers[b"x-content-type-options"] == b"nosniff"
    assert headers[b"referrer-policy"] == b"no-referrer"
    assert headers[b"cache-control"] == b"no-store"
