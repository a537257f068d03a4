"""A server that listens, serves its page, and ends."""

import logging
import re
import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from helpers.live_clients import Client
from helpers.live_server import serving, until
from ssiam.web.server.serving import ServerError, access_to, listen, page_address

FILES = [("/", "text/html"), ("/page/index.html", "text/html"), ("/page/main.js", "javascript")]


@pytest.mark.parametrize(("path", "kind"), [*FILES, ("/health", "application/json")])
def test_the_page_is_served(live, path, kind):
    status, headers, body = live.get(path)
    assert status == 200
    assert kind in headers["content-type"]
    assert len(body) == int(headers["content-length"]) > 0
    assert "server" not in headers
    status, head, body = live.get(path, method="HEAD")
    assert (status, body, head["content-length"]) == (200, b"", headers["content-length"])


def test_the_token_gives_access_and_is_never_logged(caplog):
    caplog.set_level(logging.DEBUG)
    with serving(needs_token=True) as live:
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
        assert live.get("/health")[0] == 200


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
    print(urllib.request.urlopen(f"http://127.0.0.1:{server.access.port}/health").status)
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
    # host, needs_token, whether a token is needed, names
    ("127.0.0.1", False, False, {"127.0.0.1", "localhost", "::1"}),
    ("localhost", False, False, {"localhost"}),
    ("127.0.0.2", False, False, {"127.0.0.2"}),
    ("127.0.0.1", True, True, {"127.0.0.1"}),
    ("0.0.0.0", False, True, {socket.gethostname().lower()}),
]


@pytest.mark.parametrize(("host", "needs_token", "needed", "names"), LISTENERS)
def test_only_the_loopback_needs_no_token(host, needs_token, needed, names):
    with closing(listen(host, 0)) as listener:
        access = access_to(listener, host, needs_token=needs_token)
        assert access.port == listener.getsockname()[1]
        assert (access.token is not None) == needed
        assert names <= access.names
        assert access.any_address == (host == "0.0.0.0")
        address = page_address(listener, access)
    pattern = rf"http://[\w.\[\]:]+:{access.port}/(#token=[\w-]{{43}})?"
    assert re.fullmatch(pattern, address)
    assert ("#token=" in address) == needed
    assert "0.0.0.0" not in address


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="no IPv6")
@pytest.mark.parametrize(("host", "needed"), [("::1", False), ("::", True)])
def test_ipv6_addresses(host, needed):
    with closing(listen(host, 0)) as listener:
        access = access_to(listener, host, needs_token=False)
        assert (access.token is not None) == needed
        assert access.accepts_host(f"[::1]:{access.port}")
        assert access.accepts_host(f"[2001:db8::7]:{access.port}") == needed
        assert "[::]" not in page_address(listener, access)


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
