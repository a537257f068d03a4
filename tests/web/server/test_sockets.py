"""Which steps and images are sent to a client, and how many without acknowledgment."""

import asyncio
import time

import pytest

from helpers.live_clients import Client, step_until
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.sockets import Outbox


def test_steps_are_sent_with_their_images(client):
    first, images = client.next("step")
    assert list(images) == ["raw", "steadied"]
    assert all(image.shape == (120, 160, 3) for image in images.values())
    second, _ = client.next("step")
    assert second["number"] > first["number"]
    assert second["motion"] is not None
    assert second["playing"] == "playing"


VIEWS = [
    (True, True, 64, ["raw", "steadied"]),
    (False, True, 160, ["steadied"]),
    (True, False, 4096, ["raw"]),
    (False, False, 64, []),
]


@pytest.mark.parametrize(("raw", "steadied", "width", "names"), VIEWS)
def test_a_client_gets_the_images_of_its_view(client, raw, steadied, width, names):
    view = {"type": "view", "raw": raw, "steadied": steadied, "width": width, "quality": 60}
    assert client.ask(**view) == {"type": "done", "ask": 7, "answer": None}
    client.next("step")  # may have been sent before
    client.next("step")
    _, images = client.next("step")
    assert list(images) == names
    assert all(image.shape[1] == min(width, 160) for image in images.values())


def test_a_new_view_is_sent_while_paused(live, client):
    client.ask(type="pause")
    try:
        paused = step_until(client, lambda header: header["playing"] == "paused")
        client.send(type="view", raw=True, steadied=False, width=64, quality=60)
        header, images = client.next("step")
        assert header["index"] == paused["index"]
        assert images["raw"].shape[1] == 64
    finally:
        client.ask(type="resume")


def test_at_most_two_steps_are_unacknowledged_and_the_newest_is_next(live):
    with Client(live, acknowledge=False) as client:
        first, second = client.next("step")[0], client.next("step")[0]
        with pytest.raises(TimeoutError):
            client.next("step", seconds=0.5)
        newest = live.session.newest.number
        client.send(type="shown", number=first["number"])
        third = client.next("step")[0]
        assert third["number"] >= newest
        between = third["number"] - second["number"] - 1
        assert between > 3
        assert third["skipped"] == second["skipped"] + between
        client.send(type="shown", number=third["number"])  # and those before
        client.next("step")
        client.next("step")


@pytest.mark.parametrize("ticks", range(5))
def test_stop_ends_the_sender_at_any_time(ticks):
    class NullWebSocket:
        async def send(self, event):
            pass

    async def scenario():
        outbox = Outbox(NullWebSocket(), ServerLimits(), lambda: 1)
        outbox._unacknowledged.append((1, time.monotonic()))
        task = asyncio.ensure_future(outbox.run())
        await asyncio.sleep(0.01)
        outbox.send("text")
        for _ in range(ticks):
            await asyncio.sleep(0)
        outbox.stop()
        task.cancel()
        return await asyncio.wait([task], timeout=3)

    _, pending = asyncio.run(scenario())
    assert not pending
