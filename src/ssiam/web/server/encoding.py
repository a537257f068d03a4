"""`StepPictures`: the pictures of a step as JPEG, each made once for all who want it."""

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
from ssiam.web.server.messages import View
from ssiam.web.step import Step

ViewName: TypeAlias = Literal["raw", "steadied"]


class StepPictures:
    """A step and its pictures; to be used on one event loop, the work is done by `pool`.

    Parameters
    ----------
    step : Step
    pool : Executor
        Of threads.
    """

    def __init__(self, step: Step, pool: Executor) -> None:
        self.step = step
        self._pool = pool
        self._made: dict[tuple[ViewName, int, int], asyncio.Future[bytes]] = {}

    async def wanted(self, view: View) -> list[tuple[ViewName, bytes]]:
        """The pictures that a client wants to see, in the protocol's order."""
        return [(name, await self._jpeg(name, view)) for name in _names(view)]

    async def _jpeg(self, name: ViewName, view: View) -> bytes:
        width = min(view.width, self.step.frame.image.shape[1])
        key = name, width, view.quality
        if key not in self._made:
            loop = asyncio.get_running_loop()
            self._made[key] = loop.run_in_executor(self._pool, self._encode, *key)
        # Others wait for it too: a client that leaves does not take it along.
        return await asyncio.shield(self._made[key])

    def _encode(self, name: ViewName, width: int, quality: int) -> bytes:
        image = self.step.frame.image if name == "raw" else self._steadied
        return encode_jpeg(image, width, quality)

    @cached_property
    def _steadied(self) -> Image:
        return FrameView(self.step.frame.image, self.step.stab_from_raw).render()


def _names(view: View) -> Iterator[ViewName]:
    if view.raw:
        yield "raw"
    if view.steadied:
        yield "steadied"


def encode_jpeg(image: Image, width: int, quality: int) -> bytes:
    """An image (H, W, 3) uint8 BGR as JPEG, made smaller if it is wider than `width` pixels."""
    height_now, width_now = image.shape[:2]
    if width < width_now:
        size_wh = width, max(1, round(height_now * width / width_now))
        image = np.asarray(cv2.resize(image, size_wh, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return jpeg.tobytes()
