"""Clients of a real session, over real sockets: messages and answers."""

import json

import pytest

from helpers.live_clients import Client, Watcher, step_until
from helpers.live_server import SECONDS, SIZE, serving, until
from ssiam.web.server.limits import ServerLimits
from ssiam.web.types import Note


def test_the_order_of_the_first_messages(client):
    hello, listed, step = (client.socket.recv(timeout=SECONDS) for _ in range(3))
    assert json.loads(hello)["type"] == "hello"
    assert json.loads(hello)["size"] == list(SIZE)
    assert json.loads(listed)["type"] == "recordings"
    assert isinstance(step, bytes)


def test_commands_are_answered(client):
    added = client.ask(type="add", box=[40, 30, 40, 30], name="boat")
    assert added["type"] == "done"
    number = added["answer"]
    header = step_until(client, lambda header: header["targets"])
    assert [(t["id"], t["name"]) for t in header["targets"]] == [(number, "boat")]
    assert client.ask(type="rename", id=number, name="ship")["type"] == "done"
    assert client.ask(type="remove")["type"] == "done"
    step_until(client, lambda header: not header["targets"])


REFUSED = [
    ({"type": "remove", "id": 999}, "no-such-target"),
    ({"type": "add", "box": [1000, 1000, 5, 5]}, "bad-box"),
    ({"type": "add", "box": [0, 0, 0, 5]}, "bad-box"),
    ({"type": "add", "box": [9, 9, 30, 30], "number": 10**9}, "too-old"),
    ({"type": "restart"}, "not-possible"),
    ({"type": "fly"}, "bad-message"),
    ({"type": "remove", "id": "1"}, "bad-message"),
]


@pytest.mark.parametrize(("command", "code"), REFUSED)
def test_a_command_that_fails_is_answered_with_an_error(client, command, code):
    error = client.ask(**command)
    assert (error["type"], error["code"]) == ("error", code)
    assert error["message"]


def test_without_ask_only_errors_are_answered(client):
    client.send(type="resume")
    client.socket.send("what?")
    message = client.next("error")
    assert (message["ask"], message["code"]) == (None, "bad-message")


def test_a_recording_is_announced_and_downloaded(live, client):
    name = client.ask(type="record", on=True)["answer"]
    step_until(client, lambda header: header["recording"] == name)
    client.next("step")
    assert live.get(live.with_token(f"/recordings/{name}/video.mp4"))[0] == 404
    assert client.ask(type="record", on=False)["answer"] == name
    listed = client.next("recordings")["recordings"]
    while listed[-1]["open"] or not listed[-1]["files"]:
        listed = client.next("recordings")["recordings"]
    file = listed[-1]["files"][0]
    path = live.with_token(f"/recordings/{name}/{file}")
    status, headers, body = live.get(path)
    assert status == 200
    assert headers["content-disposition"] == f'attachment; filename="{name}-{file}"'
    assert body == live.session.recordings.path(name, file).read_bytes()
    assert live.get(path, "Range: bytes=0-9")[2] == body[:10]
    assert live.get(f"/recordings/{name}/{file}")[0] == 403, "without the token"


def test_notes_are_sent_to_all_clients(live, client):
    with Client(live) as other:
        for each in (client, other):
            each.next("step")
        live.notes.notify(Note("warning", "the camera was lost"))
        expected = {"type": "note", "level": "warning", "message": "the camera was lost"}
        assert client.next("note") == other.next("note") == expected


def test_clients_are_counted(live, client):
    with Client(live):
        step_until(client, lambda header: header["clients"] == 2)
    step_until(client, lambda header: header["clients"] == 1)


def test_the_number_of_clients_is_limited():
    with serving(limits=ServerLimits(clients=2)) as live, Client(live), Client(live) as second:
        with pytest.raises(Exception, match="403"):
            Client(live)
        second.close()
        until(lambda: live.clients == 1)
        Client(live).close()


def test_clients_that_leave_with_pending_commands_are_removed():
    with serving() as live:
        watcher = Watcher(live)
        with watcher.undisturbed():
            for _ in range(20):
                client = Client(live)
                client.send(type="remove", id=999, ask=1)
                client.send(type="view", ask=2)
                client.vanish()
        watcher.close()
