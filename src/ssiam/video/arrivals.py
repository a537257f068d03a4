"""`arriving`: packets with the moment at which they came, however long each one is worked on."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterable, Iterator

from av.packet import Packet
from av.stream import Stream

# Packets that may wait, one picture each. A program that is later than that slows the sender.
_MOST_WAITING = 64
# Seconds between two looks at whether anybody still waits for packets.
_LOOK = 0.2


def arriving(packets: Iterable[Packet[Stream]]) -> Iterator[tuple[Packet[Stream], float]]:
    """Each packet and the second (`time.monotonic`) at which it came.

    They are read on a thread of its own, which has ended when the iterator has: that may take
    until the next packet comes. What reading raises is raised here, after the packets before it.
    """
    waiting: queue.Queue[tuple[Packet[Stream], float] | Exception | None] = queue.Queue(
        _MOST_WAITING
    )
    closed = threading.Event()

    def put(item: tuple[Packet[Stream], float] | Exception | None) -> None:
        while not closed.is_set():
            try:
                waiting.put(item, timeout=_LOOK)
            except queue.Full:
                continue
            return

    def read() -> None:
        end: Exception | None = None
        try:
            for packet in packets:
                put((packet, time.monotonic()))
                if closed.is_set():
                    return
        except Exception as error:
            end = error
        put(end)

    reader = threading.Thread(target=read, name="ssiam-arrivals", daemon=True)
    reader.start()
    try:
        while (item := waiting.get()) is not None:
            if isinstance(item, Exception):
                raise item
            yield item
    finally:
        closed.set()
        reader.join()
