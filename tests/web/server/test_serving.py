"""A server that listens, serves its page, and ends."""

import logging
import re
import socket
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path

import pytest

from helpers.live_clients import Client
from helpers.live_server import serving, until
from ssiam.errors import IncompleteError
from ssiam.web.server.serving import LiveServer, ServerError, access_to, listen, page_url

FILES = [("/", "text/html"), ("/page/index.html", "text/html"), ("/page/main.js", "javascript")]


@pytest.mark.parametrize(("path", "kind"), [*FILES, ("/health", "application/json")])
def test_the_page_is_served(live, path, kind):
    status, headers, body = live.get(live.with_token(path))
    assert status == 200
    assert kind in headers["content-type"]
    assert len(body) == int(headers["content-length"]) > 0
    assert "server" not in headers
    status, head, body = live.get(live.with_token(path), method="HEAD")
    assert (status, body, head["content-length"]) == (200, b"", headers["content-length"])


def test_the_token_gives_access_and_is_never_logged(caplog):
    caplog.set_level(logging.DEBUG)
    with serving() as live:
        token = live.server.access.token
        assert live.server.address == f"http://127.0.0.1:{live.port}/#token={token}"
        with Client(live) as client:
            client.next("step")
        assert live.get("/")[0] == 200
        assert live.get("/health")[0] == 403
        assert live.get(f"/health?token={token}")[0] == 200
        assert live.get("/health", f"Authorization: Bearer {token}")[0] == 200
    ours = [record for record in caplog.records if record.name != "websockets.client"]
    assert ours
    assert all(token not in record.getMessage() for record in ours)


def test_the_port_is_released():
    with serving() as live:
        port = live.port
    with serving(port=port) as live:
        assert live.get(live.with_token("/health"))[0] == 200


def test_clients_are_disconnected_when_the_server_ends():
    with serving() as live:
        clients = [Client(live) for _ in range(3)]
        clients[0].next("step")
        live.server.close()
        live.server.close()
        assert [client.close_code() for client in clients] == [1001] * 3
        before = live.session.newest.number
        until(lambda: live.session.newest.number >= before + 3)  # the session continues


def test_run_serves_until_it_is_interrupted(tmp_path):
    code = """
import sys, signal, threading, urllib.request
sys.path.insert(0, sys.argv[1])
from helpers.live_server import serving
with serving() as live:
    live.server.close()
from ssiam.web.server.serving import LiveServer
server = LiveServer(live.session, port=0)
def request():
    print(urllib.request.urlopen(f"{server.url}health?token={server.access.token}").status)
    signal.raise_signal(signal.SIGINT)
threading.Timer(0.3, request).start()
server.run()
print("ended")
"""
    tests = str(Path(__file__).parents[2])
    done = subprocess.run(
        [sys.executable, "-c", code, tests], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["200", "ended"], done.stderr


def test_without_a_package_the_error_names_the_extra():
    code = """
import sys
for package in ("starlette", "uvicorn", "websockets"):
    sys.modules[package] = None
    try:
        import ssiam.web.server.serving
    except Exception as error:
        print(type(error).__name__, error)
    del sys.modules[package]
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    lines = done.stdout.splitlines()
    for package, line in zip(("starlette", "uvicorn", "websockets"), lines, strict=True):
        assert line.startswith(f"MissingExtraError the package {package} is not installed")
        assert line.endswith("pip install 'ssiam[web]'")


LISTENERS = [
    # host, names
    ("127.0.0.1", {"127.0.0.1", "localhost", "::1"}),
    ("localhost", {"localhost"}),
    ("127.0.0.2", {"127.0.0.2"}),
    ("0.0.0.0", {socket.gethostname().lower()}),
]


@pytest.mark.parametrize("needs_token", [True, False])
@pytest.mark.parametrize(("host", "names"), LISTENERS)
def test_access_to_a_listener(host, names, needs_token):
    with closing(listen(host, 0)) as listener:
        access = access_to(listener, host, needs_token=needs_token)
        assert access.port == listener.getsockname()[1]
        assert names <= access.names
        assert access.any_address == (host == "0.0.0.0")
        url = page_url(listener, access)
    assert re.fullmatch(r"[\w-]{43}", access.token) if needs_token else access.token is None
    assert re.fullmatch(rf"http://[\w.\[\]:]+:{access.port}/", url)
    assert "0.0.0.0" not in url


NEEDS = [
    # host, options, whether a token is needed, whether other machines need none
    ("127.0.0.1", {}, True, False),
    ("0.0.0.0", {}, True, False),
    ("127.0.0.1", {"needs_token": False}, False, False),
    ("0.0.0.0", {"needs_token": False}, False, True),
]


@pytest.mark.parametrize(("host", "options", "needed", "is_open"), NEEDS)
def test_a_token_is_needed_unless_it_is_turned_off(host, options, needed, is_open):
    with serving(host=host, **options) as live:
        assert (live.server.access.token is not None) == needed
        assert live.server.address.startswith(live.server.url)
        assert ("#token=" in live.server.address) == needed
        assert live.server.is_open_to_machines == is_open
        assert live.get("/health")[0] == (403 if needed else 200)
        with Client(live) as client:
            client.next("step")


def test_the_token_is_in_no_representation_and_no_error(monkeypatch):
    with serving() as live:
        assert live.server.access.token not in repr(live.server.access)
        server = LiveServer(live.session, port=0)

        async def broken(counter):
            raise RuntimeError("no more")

        monkeypatch.setattr(server._server, "on_tick", broken)
        monkeypatch.setattr(threading, "excepthook", lambda args: None)
        with pytest.raises(IncompleteError, match=re.escape(server.url)) as ended:
            server.run()
        assert "token" not in str(ended.value)
        stopped = LiveServer(live.session, port=0)
        monkeypatch.setattr(stopped._server, "run", lambda sockets: None)
        with pytest.raises(ServerError, match=re.escape(stopped.url)) as failed:
            stopped.start()
        assert "token" not in str(failed.value)


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="no IPv6")
@pytest.mark.parametrize(("host", "is_any"), [("::1", False), ("::", True)])
def test_ipv6_addresses(host, is_any):
    with closing(listen(host, 0)) as listener:
        access = access_to(listener, host, needs_token=True)
        assert access.accepts_host(f"[::1]:{access.port}")
        assert access.accepts_host(f"[2001:db8::7]:{access.port}") == is_any
        assert "[::]" not in page_url(listener, access)


def test_tokens_are_unique():
    with closing(listen("127.0.0.1", 0)) as listener:
        tokens = {access_to(listener, "x", needs_token=True).token for _ in range(3)}
    assert len(tokens) == 3


def test_a_port_in_use_is_named_in_one_line():
    with closing(listen("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(ServerError, match=rf"127\.0\.0\.1, port {port} .*--port") as caught:
            listen("127.0.0.1", port)
    assert "\n" not in str(caught.value)


INVALID = [("203.0.113.9", 0), ("no such name", 0), ("x" * 300, 0), ("127.0.0.1", 65536)]


@pytest.mark.parametrize(
    ("host", "port"), INVALID, ids=["foreign address", "unknown name", "long", "port"]
)
def test_an_invalid_address_is_named_in_one_line(host, port):
    with pytest.raises(ServerError) as caught:
        listen(host, port)
    assert "\n" not in str(caught.value)
