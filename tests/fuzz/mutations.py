"""Damages of valid inputs: flipped bytes, truncation, repetition, hostile numbers and words."""

from __future__ import annotations

import re
from collections.abc import Callable
from random import Random

_NUMBER = re.compile(rb"-?[0-9]+(?:\.[0-9]+)?")
_MAX_BYTES = 1 << 18
_WORDS = (
    *(b"nan", b"-inf", b"1e308", b"1e-308", b"1e999", b"-1", b"0", b"-0.0", b"1e9", b"2147483648"),
    *(
        b"9" * 400,
        b"9" * 5000,
        b"0x" + b"f" * 300,
        b"1_0",
        "²".encode(),
        "٣".encode(),
        b"1e99999999",
    ),
    *(
        b"null",
        b"true",
        b"[]",
        b"{}",
        b'""',
        b"[[[]]]",
        b'"\\ud800"',
        b'"\\u0000"',
        b"\0",
        b"\xff\xfe",
    ),
    *(
        b"[" * 3000,
        b'{"a":' * 3000,
        b"../" * 30,
        b"/dev/zero",
        b"\n",
        b",",
        b"\r",
        b'"',
        b"<",
        b"&",
    ),
    *(b"\xed\xa0\x80", b"%00", b"file://[x", b" " * 5000, b"\xef\xbb\xbf", b"99999999999999999999"),
)


_STRETCHED = tuple(bytes([each]) for each in b" \t\n,;:@?#=/.'\"()[]{}<>&\\-09a")


def mutated(random: Random, seed: bytes) -> bytes:
    """`seed` with one to four damages."""
    data = seed
    for _ in range(random.choice((1, 1, 2, 4))):
        data = random.choice(_DAMAGES)(random, data)[:_MAX_BYTES]
    return data


def _flipped(random: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 3, 16))):
        if changed:
            changed[random.randrange(len(changed))] = random.choice((0, 255, random.randrange(256)))
    return bytes(changed)


def _truncated(random: Random, data: bytes) -> bytes:
    return data[: random.randrange(len(data) + 1)]


def _removed(random: Random, data: bytes) -> bytes:
    start = random.randrange(len(data) + 1)
    return data[:start] + data[start + random.choice((1, 4, 40)) :]


def _inserted(random: Random, data: bytes) -> bytes:
    start = random.randrange(len(data) + 1)
    return data[:start] + random.choice(_WORDS) + data[start:]


def _renumbered(random: Random, data: bytes) -> bytes:
    numbers = list(_NUMBER.finditer(data))
    if not numbers:
        return _flipped(random, data)
    found = random.choice(numbers)
    return data[: found.start()] + random.choice(_WORDS) + data[found.end() :]


def _repeated(random: Random, data: bytes) -> bytes:
    start = random.randrange(len(data) + 1)
    part = data[start : start + random.choice((1, 10, 200))]
    return data[:start] + part * random.choice((2, 20, 300)) + data[start:]


def _stretched(random: Random, data: bytes) -> bytes:
    """One character many times, on which a search that starts again and again stands out."""
    start, count = random.randrange(len(data) + 1), random.choice((5_000, 5_000, _MAX_BYTES))
    character = random.choice((*_STRETCHED, data[start : start + 1]))
    return data[:start] + character * count + data[start:][: random.choice((0, _MAX_BYTES))]


def _number_bytes(random: Random, data: bytes) -> bytes:
    """A binary number of 2 or 4 bytes replaced by an extreme one."""
    start, size = random.randrange(len(data) + 1), random.choice((2, 4, 8))
    value = random.choice((0, 1, 2 ** (8 * size) - 1, 2 ** (8 * size - 1), 2 ** (4 * size)))
    return (
        data[:start] + value.to_bytes(size, random.choice(("little", "big"))) + data[start + size :]
    )


_DAMAGES: tuple[Callable[[Random, bytes], bytes], ...] = (
    *(_flipped, _flipped, _truncated, _removed, _inserted),
    *(_renumbered, _renumbered, _repeated, _stretched, _number_bytes),
)
