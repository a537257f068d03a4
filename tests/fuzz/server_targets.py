"""Servers and clients: the page's HTTP and WebSocket, TraX, and what annotation tools send."""

from __future__ import annotations

import json
import logging
import os
import socket
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from fuzz.target import Target, text
from helpers.live_server import serving
from helpers.raw_sockets import UPGRADE, frame
from ssiam.errors import ArgumentError
from ssiam.evaluation.vot.trax import serve
from ssiam.exchange.labelstudio import region_annotations
from ssiam.geometry import check_box
from ssiam.integrations.cvat_agent import box_of_shape
from ssiam.integrations.label_studio_backend import LabelStudioBackend
from ssiam.parsing import parse_json
from ssiam.track import Track

_TIMEOUT = 5.0  # seconds until a server must have answered
_SIZE = (32, 24)


def server_targets(folder: Path) -> Iterable[Target]:
    """The server of the page, the TraX server, and functions that tools call with their JSON."""
    folder.mkdir(parents=True)
    yield from _page_targets(folder / "recordings")
    yield _trax_target(folder)
    yield from _tool_targets()


class _Recorded:
    """In place of `Logger.error`: what the server reports of its own failures."""

    def __init__(self, *loggers: str) -> None:
        self.reports: list[str] = []
        for name in loggers:
            logging.getLogger(name).error = self  # type: ignore[method-assign,assignment]

    def __call__(self, message: object, *args: object, **options: Any) -> None:
        self.reports.append(f"{message} {args} {options.get('exc_info')!r}")


def _page_targets(folder: Path) -> Iterable[Target]:
    stack = ExitStack()
    live = stack.enter_context(serving(webcam=True, tracker="kcf", recordings=folder))
    recorded = _Recorded("uvicorn.error", "asyncio")
    host, token = f"127.0.0.1:{live.port}".encode(), str(live.server.access.token).encode()

    def send(data: bytes) -> None:
        data = data.replace(b"HOST", host).replace(b"TOKEN", token)
        raw = socket.create_connection(("127.0.0.1", live.port), _TIMEOUT)
        with raw, suppress(ConnectionError):
            raw.sendall(data)
            with suppress(OSError):  # the server has disconnected
                raw.shutdown(socket.SHUT_WR)
            while raw.recv(1 << 16):
                pass
        if recorded.reports:
            raise RuntimeError(recorded.reports.pop())

    gets = [
        f"GET {path}?token=TOKEN HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n".encode()
        for path in ("/", "/health", "/recordings/1/video.mkv")
    ]
    post = b"POST /recordings HTTP/1.1\r\nHost: HOST\r\nContent-Length: 4\r\n\r\nabcd"
    yield Target("page's HTTP", (*gets, post), send, 2, stack.close)
    lines = ["GET /session?token=TOKEN HTTP/1.1", "Host: HOST", *UPGRADE]
    handshake = "\r\n".join([*lines, "", ""]).encode()
    message = frame(1, b'{"type": "add", "box": [1, 2, 3, 4], "ask": 1}')
    parts = frame(1, b'{"type":', first=0) + frame(0, b' "pause"}')
    close = frame(8, b"\x03\xe8")
    seeds = (handshake + message + close, handshake + parts + frame(9, b"ping") + close)
    yield Target(
        "page's WebSocket", (*seeds, handshake + frame(2, b"\xff\xd8\xff") + close), send, 2
    )


class _Still:
    """A tracker that stays at its first box."""

    def init(self, image: Any, box: Any) -> None:
        if len(box) == 8:
            box = cv2.boundingRect(np.reshape(box, (4, 2)).astype(np.float32))
        self._box = check_box(box, (image.shape[1], image.shape[0]))

    def update(self, image: Any) -> Track:
        return Track(self._box)


def _trax_target(folder: Path) -> Target:
    """The requests of a client, in the file that libtrax reads instead of standard input."""
    image, requests = folder / "1.png", folder / "requests"
    cv2.imwrite(str(image), np.zeros((_SIZE[1], _SIZE[0], 3), np.uint8))

    def read(data: bytes) -> None:
        requests.write_bytes(data)
        given = os.open(requests, os.O_RDONLY)
        answers = os.open(os.devnull, os.O_WRONLY)
        os.environ["TRAX_IN"], os.environ["TRAX_OUT"] = str(given), str(answers)
        try:
            serve(_Still())  # type: ignore[arg-type]
        finally:
            relayed = int(os.environ.pop("TRAX_IN"))
            del os.environ["TRAX_OUT"]
            if relayed != given:
                with suppress(OSError):
                    os.close(relayed)
            os.close(given)
            os.close(answers)

    one = f'@@TRAX:frame "file://{image}" \n'
    boxes = '"10.0,10.0,8.0,9.0"', '"2,3,9,3,9,12,2,12"'
    seeds = (f"@@TRAX:initialize {box} \n{one}{one}@@TRAX:quit \n".encode() for box in boxes)
    return Target("TraX", tuple(seeds), read, 2)


def _tool_targets() -> Iterable[Target]:
    keyframe = {"frame": 1, "enabled": True, "x": 10.0, "y": 20.0, "width": 30.0, "height": 40.0}
    value = {"framesCount": 4, "duration": 0.2, "sequence": [keyframe], "labels": ["boat"]}
    region = {"id": "a", "type": "videorectangle", "value": value}
    task = {"id": 1, "data": {"video": "/nowhere.mp4"}, "annotations": [{"result": [region]}]}
    backend = LabelStudioBackend(None)  # type: ignore[arg-type]  # no video is opened

    def predict(given: str) -> None:
        tasks = _json(given)
        backend.predict(tasks)
        region_annotations(region | {"value": tasks[0].get("value")}, _SIZE, 25)

    yield Target("Label Studio's tasks", (json.dumps([task]).encode(),), text(predict), 4)

    def sequence(given: str) -> None:
        region_annotations(_json(given), _SIZE, 25)

    yield Target("Label Studio's region", (json.dumps(region).encode(),), text(sequence), 4)

    def shape(given: str) -> None:
        drawn = _json(given)
        if isinstance(drawn, dict):
            check_box(box_of_shape(drawn.get("type", ""), drawn.get("points")), _SIZE)

    kinds = {
        "rectangle": [1.0, 2.0, 9.0, 9.0],
        "polygon": [1, 2, 9, 2, 9, 9],
        "mask": [3, 1, 1, 2, 2],
    }
    shapes = (json.dumps({"type": kind, "points": points}) for kind, points in kinds.items())
    yield Target("CVAT's shape", tuple(each.encode() for each in shapes), text(shape), 4)


def _json(given: str) -> Any:
    """The tool's server has parsed it already."""
    try:
        return parse_json(given)
    except ValueError as error:
        raise ArgumentError(str(error)) from None
