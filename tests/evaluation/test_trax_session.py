"""A TraX session in this process, with a given client."""

import io
import os
import socket
import sys
from threading import Thread
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from ssiam.errors import MissingExtraError, SourceError, StreamError
from ssiam.track import Track

trax = pytest.importorskip("trax")

from ssiam.evaluation.vot.trax import (  # noqa: E402
    _region_from_track,
    check_trax,
    reserve_stdout,
    serve,
)

BOX = (5.0, 6.0, 7.0, 8.0)


class Scripted:
    """A tracker that records what it gets, and moves its box by a pixel in each frame."""

    def __init__(self):
        self.started, self.images, self.count = [], [], 0

    def init(self, image, box):
        self.started.append((image, box))
        self.count = 0

    def update(self, image):
        self.images.append(image)
        self.count += 1
        x, y, w, h = BOX
        return Track((x + self.count, y, w, h), score=0.25)


class Server:
    """The interface of `trax.Server`: given requests, and the recorded replies."""

    def __init__(self, regions, images, **options):
        self.made = regions, images, options
        self.sent, self.reasons = [], []

    def wait(self):
        request = self.requests.pop(0)
        if isinstance(request, Exception):
            raise request
        return request

    def status(self, objects):
        self.sent.append(objects)

    def quit(self, reason):
        self.reasons.append(reason)


@pytest.fixture
def server(monkeypatch):
    """Makes `trax.Server` return a server with these requests."""
    silent, write_end = os.pipe()
    monkeypatch.setenv("TRAX_IN", str(silent))  # else standard input is read
    made = []

    def of(*requests):
        def make(*given, **options):
            made.append(Server(*given, **options))
            made[-1].requests = list(requests)
            return made[-1]

        monkeypatch.setattr(trax, "Server", make)
        return made

    yield of
    os.close(write_end)


def request(path=None, region=None, kind=None):
    return SimpleNamespace(
        type=trax.TraxStatus.FRAME if kind is None else kind,
        image=None if path is None else {"color": trax.FileImage.create(str(path))},
        objects=[] if region is None else [(region, {})],
    )


QUIT = SimpleNamespace(type=trax.TraxStatus.QUIT, image=None, objects=None)


@pytest.fixture
def paths(tmp_path):
    found = []
    for number in range(4):
        found.append(tmp_path / f"{number}.png")
        cv2.imwrite(str(found[-1]), np.full((12, 16, 3), 10 * number, np.uint8))
    return found


def test_each_frame_has_a_reply(server, paths):
    start = trax.Rectangle.create(*BOX)
    made = server(request(paths[0], start), *map(request, paths[1:]), QUIT)
    tracker = Scripted()
    serve(tracker)
    (found,) = made
    ((image, box),) = tracker.started
    assert (image.mean(), box) == (0, list(BOX))
    assert [image.mean() for image in tracker.images] == [10, 20, 30]
    regions, confidences = zip(*(objects[0] for objects in found.sent), strict=True)
    assert [each.bounds()[0] for each in regions] == [5, 6, 7, 8]
    assert [each["confidence"] for each in confidences] == [1.0, 0.25, 0.25, 0.25]
    assert found.reasons == [None]
    kinds, images, options = found.made
    assert kinds == [trax.Region.RECTANGLE, trax.Region.POLYGON]
    assert images == [trax.Image.PATH]
    assert options == {"tracker_name": "ssiam"}


def test_a_second_start_takes_the_new_region(server, paths):
    polygon = trax.Polygon.create([(1, 2), (9, 2), (9, 8), (1, 8)])
    made = server(
        request(paths[0], trax.Rectangle.create(*BOX)),
        request(paths[1]),
        request(paths[2], polygon),
        request(paths[3]),
        QUIT,
    )
    tracker = Scripted()
    serve(tracker)
    assert tracker.started[1][1] == [1, 2, 9, 2, 9, 8, 1, 8]
    types = [objects[0][0].type for objects in made[0].sent]
    assert types == ["rectangle", "rectangle", "polygon", "polygon"]


def test_all_frames_have_the_levels_of_the_first(server, tmp_path):
    """Of 16 bits; alone, each image would be scaled by its own levels."""
    paths = []
    for number, top in enumerate((4000, 2000)):
        image = np.tile(np.linspace(0, top, 64).astype(np.uint16), (48, 1))
        paths.append(tmp_path / f"{number}.png")
        cv2.imwrite(str(paths[-1]), image)
    server(request(paths[0], trax.Rectangle.create(*BOX)), request(paths[1]), QUIT)
    tracker = Scripted()
    serve(tracker)
    first, second = tracker.started[0][0], tracker.images[0]
    assert second.max() == pytest.approx(first.max() / 2, rel=0.1)


def test_an_error_is_the_reason_of_the_end(server, paths, tmp_path):
    start = trax.Rectangle.create(*BOX)
    made = server(request(paths[0], start), request(tmp_path / "missing.png"))
    with pytest.raises(SourceError, match=r"missing\.png: does not exist"):
        serve(Scripted())
    (reason,) = made[0].reasons
    assert reason.startswith(f"{tmp_path / 'missing.png'}: does not exist")


def test_a_client_that_disconnects(server):
    made = server(trax.TraxException("gone"))
    with pytest.raises(StreamError, match="the TraX client disconnected, or violated"):
        serve(Scripted())
    assert len(made[0].reasons) == 1


def test_without_trax_the_extra_is_named(monkeypatch):
    check_trax()
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for call in (check_trax, lambda: serve(Scripted())):
        with pytest.raises(MissingExtraError, match=r"needs vot-trax: pip install 'ssiam\[vot\]'"):
            call()


def test_reported_regions():
    """Polygons end at the last pixels, rectangles have the width of the box."""
    rectangle = trax.Rectangle.create(*BOX)
    polygon = trax.Polygon.create([(1, 2), (9, 2), (9, 8), (1, 8)])
    assert _region_from_track(Track(BOX), rectangle).bounds() == pytest.approx(BOX)
    corners = [(5, 6), (11, 6), (11, 13), (5, 13)]
    np.testing.assert_allclose(list(_region_from_track(Track(BOX), polygon)), corners)


@pytest.mark.parametrize("one_pipe", [False, True])
def test_standard_output_is_reserved(monkeypatch, one_pipe):
    """Descriptors 1 and 2 of this process, for a moment those of two pipes."""
    out_reader, out_writer = os.pipe()
    err_reader, err_writer = os.pipe()
    kept = os.dup(1), os.dup(2)
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.delenv("TRAX_OUT", raising=False)
    try:
        os.dup2(out_writer, 1)
        os.dup2(out_writer if one_pipe else err_writer, 2)
        with reserve_stdout():
            os.write(1, b"other output;")
            os.write(int(os.environ["TRAX_OUT"]), b"message;")
            os.write(2, b"error;")
        os.write(2, b"last words")
        os.write(1, b".")
        os.close(int(os.environ["TRAX_OUT"]))
    finally:
        for number, descriptor in zip((1, 2), kept, strict=True):
            os.dup2(descriptor, number)
            os.close(descriptor)
        os.close(out_writer)
        os.close(err_writer)
    with open(out_reader, "rb") as out, open(err_reader, "rb") as err:
        found = out.read(), err.read()
    if one_pipe:
        assert found == (b"message;last words", b"")
    else:
        assert found == (b"message;", b"other output;error;last words.")


def served(tmp_path, monkeypatch, text):
    """Serve the requests of a file, with the real libtrax."""
    (tmp_path / "requests").write_bytes(text)
    with (tmp_path / "requests").open("rb") as requests, open(os.devnull, "wb") as answers:
        monkeypatch.setenv("TRAX_IN", str(requests.fileno()))
        monkeypatch.setenv("TRAX_OUT", str(answers.fileno()))
        tracker = Scripted()
        try:
            serve(tracker)
        finally:
            os.close(int(os.environ["TRAX_IN"]))
    return tracker


def test_messages_that_are_whole_are_relayed(tmp_path, monkeypatch, paths):
    frame = f'@@TRAX:frame "file://{paths[0]}" \n'
    text = f'other output\n@@TRAX:initialize "5,6,7,8" \n{frame}{frame}@@TRAX:quit \n'
    tracker = served(tmp_path, monkeypatch, text.encode())
    assert [box for _, box in tracker.started] == [[5, 6, 7, 8]]
    assert tracker.count == 1


@pytest.mark.parametrize(
    "text",
    [
        b'@@TRAX:initialize "5,6,7,8" \n',  # libtrax waited without end
        b'@@TRAX:initialize "5,6,7',  # this one too
        b'@@TRAX:initialize "" \n@@TRAX:frame "x" \n@@TRAX:quit \n',  # the process ended
        b'@@TRAX:initialize "5,6,[],8" \n@@TRAX:frame "x" \n',
        b'@@TRAX:frame "x\n@@TRAX:quit \n',
        b'@@TRAX:frame "file:///x.png" \n@@TRAX:quit \n',
        b"@@TRAX:" + b"x" * 3_000_000,
    ],
)
def test_a_client_that_breaks_off_or_sends_other_messages(tmp_path, monkeypatch, text):
    with pytest.raises(StreamError, match="the TraX client"):
        served(tmp_path, monkeypatch, text)


def served_on_a_socket(monkeypatch, text):
    """Serve a client that listens on a port; returns the tracker, the answers and the error."""
    listener = socket.create_server(("127.0.0.1", 0))
    monkeypatch.setenv("TRAX_SOCKET", str(listener.getsockname()[1]))
    monkeypatch.setenv("TRAX_IN", "0")
    monkeypatch.setenv("TRAX_OUT", "1")
    tracker, errors = Scripted(), []

    def run():
        try:
            serve(tracker)
        except Exception as error:
            errors.append(error)

    server = Thread(target=run, daemon=True)  # libtrax waits without end if it reads by itself
    server.start()
    client, _ = listener.accept()
    with listener, client:
        client.sendall(text)
        client.shutdown(socket.SHUT_WR)
        server.join(20)
        assert not server.is_alive()
        assert "TRAX_SOCKET" not in os.environ
        client.settimeout(20)
        answers = b"".join(iter(lambda: client.recv(1 << 16), b""))  # until the server's end
        return tracker, answers, errors


def test_a_client_with_a_socket_is_served(monkeypatch, paths):
    frame = f'@@TRAX:frame "file://{paths[0]}" \n'
    text = f'@@TRAX:initialize "5,6,7,8" \n{frame}{frame}@@TRAX:quit \n'
    tracker, answers, errors = served_on_a_socket(monkeypatch, text.encode())
    assert (tracker.count, errors) == (1, [])
    assert b"@@TRAX:hello" in answers
    assert answers.count(b"@@TRAX:state") == 2


@pytest.mark.parametrize(
    "text", [b'@@TRAX:initialize "5,6,7', b'@@TRAX:initialize "" \n@@TRAX:frame "x" \n']
)
def test_a_client_with_a_socket_that_breaks_off(monkeypatch, text):
    _, _, (error,) = served_on_a_socket(monkeypatch, text)
    assert isinstance(error, StreamError)


@pytest.mark.parametrize(
    ("variable", "value"),
    [("TRAX_SOCKET", "9" * 400), ("TRAX_SOCKET", "\u00b2"), ("TRAX_IN", "x"), ("TRAX_IN", "9999")],
)
def test_variables_of_no_client_are_one_line(monkeypatch, variable, value):
    monkeypatch.setenv("TRAX_IN", "0")
    monkeypatch.setenv(variable, value)
    with pytest.raises(StreamError, match=f"no TraX client.*{variable}="):
        serve(Scripted())
