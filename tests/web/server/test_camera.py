"""A browser's camera as the source."""

import pytest

from helpers.live_clients import Client
from helpers.live_server import serving, until
from helpers.synthetic import world
from ssiam.web.server.images import encode_jpeg
from ssiam.web.server.limits import ServerLimits


def test_only_one_client_is_the_source():
    with serving(webcam=True) as live, Client(live) as client, Client(live) as other:
        assert client.next("hello")["size"] is None
        client.socket.send(encode_jpeg(world(3, (200, 100)), 200, 90))
        _, images = client.next("step")
        assert images["raw"].shape == (100, 200, 3)
        other.socket.send(encode_jpeg(world(3, (200, 100)), 200, 90))
        assert other.next("error")["code"] == "not-possible"
        client.socket.send(b"\xff\xd8 not an image")
        assert client.next("error")["code"] == "bad-message"
        client.close()
        until(lambda: live.clients == 1)
        other.socket.send(encode_jpeg(world(3, (300, 100)), 300, 90))
        while other.next("step")[1]["raw"].shape != (100, 300, 3):
            pass


TOO_LARGE = [("image", b"\xff\xd8" + bytes(90_000)), ("text", "x" * 70_000)]


@pytest.mark.parametrize("message", [t[1] for t in TOO_LARGE], ids=[t[0] for t in TOO_LARGE])
def test_messages_of_the_source_are_limited_in_size(message):
    limits = ServerLimits(image_bytes=80_000)
    with serving(webcam=True, limits=limits) as live, Client(live) as client:
        client.socket.send(message)
        assert client.close_code() == 1009
