"""JPEG images sent to clients (`StepImages`), and those of a browser (`BrowserCamera`)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from concurrent.futures import Executor
from functools import cached_property
from typing import Literal, TypeAlias

import cv2
import numpy as np

from ssiam.geometry import Image
from ssiam.stabilize import FrameView
from ssiam.web.feeds.pushed import decode_jpeg
from ssiam.web.server.incoming import View
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.service import Service
from ssiam.web.types import CommandError, Step

ViewName: TypeAlias = Literal["raw", "steadied"]
"""The views by their names in the protocol."""


class StepImages:
    """The views of a step as JPEG, each encoded once for all clients that request it.

    To be used on one event loop.

    Parameters
    ----------
    step : Step
    pool : Executor
        Threads that encode.
    """

    def __init__(self, step: Step, pool: Executor) -> None:
        self.step = step
        self._pool = pool
        self._encoded: dict[tuple[ViewName, int, int], asyncio.Future[bytes]] = {}

    async def encoded(self, view: View) -> list[tuple[ViewName, bytes]]:
        """The JPEG images that a client requests, in the protocol's order."""
        return [(name, await self._jpeg(name, view)) for name in _names(view)]

    async def _jpeg(self, name: ViewName, view: View) -> bytes:
        width = min(view.width, self.step.frame.image.shape[1])
        key = name, width, view.quality
        if key not in self._encoded:
            loop = asyncio.get_running_loop()
            self._encoded[key] = loop.run_in_executor(self._pool, self._encode, *key)
        # Other clients await it too, so a client that leaves must not cancel it.
        return await asyncio.shield(self._encoded[key])

    def _encode(self, name: ViewName, width: int, quality: int) -> bytes:
        image = self.step.frame.image if name == "raw" else self._stabilized
        return encode_jpeg(image, width, quality)

    @cached_property
    def _stabilized(self) -> Image:
        return FrameView(self.step.frame.image, self.step.stab_from_raw).render()


class BrowserCamera:
    """Passes one client's camera frames to the service. To be used on one event loop.

    Parameters
    ----------
    service : Service
    pool : Executor
        Threads that decode.
    limits : ServerLimits
    """

    def __init__(self, service: Service, pool: Executor, limits: ServerLimits) -> None:
        self._service, self._pool, self._limits = service, pool, limits
        self._owner: object = None
        self._decoding: asyncio.Future[None] | None = None

    def take(self, client: object, jpeg: bytes) -> asyncio.Future[None] | None:
        """Decode a frame and push it to the service.

        Returns
        -------
        Future or None
            Raises `SsiamError` if the frame cannot be used. None if the frame was dropped,
            because the previous one is still being decoded.

        Raises
        ------
        CommandError
            Another client's camera is the source.
        """
        self._owner = self._owner or client
        if self._owner is not client:
            raise CommandError("not-possible", "another browser's camera is already the source")
        if self._decoding is not None and not self._decoding.done():
            return None
        loop = asyncio.get_running_loop()
        self._decoding = loop.run_in_executor(self._pool, self._push, jpeg)
        return self._decoding

    def release(self, client: object) -> None:
        """If this client is the source, allow another one to be it."""
        if self._owner is client:
            self._owner = None

    def _push(self, jpeg: bytes) -> None:
        self._service.push(decode_jpeg(jpeg, self._limits.image_pixels))


def encode_jpeg(image: Image, width: int, quality: int) -> bytes:
    """An image (H, W, 3) uint8 BGR as JPEG, scaled down to at most `width` pixels."""
    height_now, width_now = image.shape[:2]
    if width < width_now:
        size_wh = width, max(1, round(height_now * width / width_now))
        image = np.asarray(cv2.resize(image, size_wh, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return jpeg.tobytes()


def _names(view: View) -> Iterator[ViewName]:
    if view.raw:
        yield "raw"
    if view.stabilized:
        yield "steadied"
