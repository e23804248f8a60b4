"""Damage to a file, as disks, networks and attackers do it; what is drawn comes from `random.Random`."""

from __future__ import annotations

import random
import re
import struct

NUMBER = re.compile(rb"-?\d+(\.\d+)?(e-?\d+)?")

TEXT_EXTREMES = (
    b"0", b"-1", b"nan", b"inf", b"-inf", b"1e309", b"1e-320", b"255", b"65536", b"2147483648", b"4294967295",
    b"99999999999", b"18446744073709551616", b'""', b"null", b"true", b"[]", b"{}", b"\xff", b"../x",
)  # fmt: skip
"""What stands in for a number of a text."""

BINARY_EXTREMES = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1)
"""What stands in for an integer of 2, 4 or 8 bytes."""


def mutate(data: bytes, chance: random.Random) -> bytes:
    """The bytes with one to four damages."""
    for _ in range(chance.randint(1, 4)):
        data = chance.choice(DAMAGES)(data, chance)
    return data


def _place(data: bytes, chance: random.Random) -> int:
    """Half of all damage is done to the beginning, where headers are."""
    end = len(data) if chance.random() < 0.5 else min(len(data), 256)
    return chance.randint(0, end)


def _truncate(data: bytes, chance: random.Random) -> bytes:
    return data[: _place(data, chance)]


def _flip(data: bytes, chance: random.Random) -> bytes:
    flipped = bytearray(data)
    for _ in range(chance.randint(1, 8) if data else 0):
        flipped[min(_place(data, chance), len(data) - 1)] ^= 1 << chance.randint(0, 7)
    return bytes(flipped)


def _insert(data: bytes, chance: random.Random) -> bytes:
    place = _place(data, chance)
    return data[:place] + chance.randbytes(chance.randint(1, 16)) + data[place:]


def _delete(data: bytes, chance: random.Random) -> bytes:
    place = _place(data, chance)
    return data[:place] + data[place + chance.randint(1, 64) :]


def _repeat(data: bytes, chance: random.Random) -> bytes:
    place = _place(data, chance)
    piece = data[place : place + chance.randint(1, 256)]
    return data[:place] + chance.randint(1, 50) * piece + data[place:]


def _extreme_text(data: bytes, chance: random.Random) -> bytes:
    found = list(NUMBER.finditer(data[:100_000]))
    if not found:
        return data
    number = chance.choice(found)
    return data[: number.start()] + chance.choice(TEXT_EXTREMES) + data[number.end() :]


def _extreme_binary(data: bytes, chance: random.Random) -> bytes:
    place, size = _place(data, chance), chance.choice((2, 4, 8))
    value = chance.choice(BINARY_EXTREMES) % 2 ** (8 * size)
    kind = chance.choice("<>") + {2: "H", 4: "I", 8: "Q"}[size]
    return data[:place] + struct.pack(kind, value) + data[place + size :]


DAMAGES = (_truncate, _flip, _insert, _delete, _repeat, _extreme_text, _extreme_text, _extreme_binary)
