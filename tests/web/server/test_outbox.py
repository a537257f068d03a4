"""What is sent of the steps: who wants to see what, and how many are under way."""

import asyncio
import time

import pytest

from helpers.live_clients import Client, step_until
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.outbox import Outbox


def test_steps_come_with_their_pictures(client):
    first, pictures = client.next("step")
    assert list(pictures) == ["raw", "steadied"]
    assert all(picture.shape == (120, 160, 3) for picture in pictures.values())
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
def test_a_client_gets_what_it_wants_to_see(client, raw, steadied, width, names):
    view = {"type": "view", "raw": raw, "steadied": steadied, "width": width, "quality": 60}
    assert client.ask(**view) == {"type": "done", "ask": 7, "answer": None}
    client.next("step")  # may have been under way
    client.next("step")
    _, pictures = client.next("step")
    assert list(pictures) == names
    assert all(picture.shape[1] == min(width, 160) for picture in pictures.values())


def test_another_view_is_seen_while_all_stands_still(live, client):
    client.ask(type="pause")
    try:
        still = step_until(client, lambda header: header["playing"] == "paused")
        client.send(type="view", raw=True, steadied=False, width=64, quality=60)
        header, pictures = client.next("step")
        assert header["index"] == still["index"]
        assert pictures["raw"].shape[1] == 64
    finally:
        client.ask(type="resume")


def test_two_steps_are_under_way_and_the_newest_comes_next(live):
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
def test_sending_ends_whatever_comes_at_the_same_moment(ticks):
    class Deaf:
        async def send(self, event):
            pass

    async def scenario():
        outbox = Outbox(Deaf(), ServerLimits(), lambda: 1)
        outbox._under_way.append((1, time.monotonic()))
        task = asyncio.ensure_future(outbox.run())
        await asyncio.sleep(0.01)
        outbox.say("news")
        for _ in range(ticks):
            await asyncio.sleep(0)
        outbox.stop()
        task.cancel()
        return await asyncio.wait([task], timeout=3)

    _, pending = asyncio.run(scenario())
    assert not pending
