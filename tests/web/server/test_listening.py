"""Where the server listens, and whether it needs a token there."""

import re
import socket
from contextlib import closing

import pytest

from ssiam.web.server.serving import ServerError, access_to, listen, page_address

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
        assert access.knows(f"[::1]:{access.port}")
        assert access.knows(f"[2001:db8::7]:{access.port}") == needed
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
