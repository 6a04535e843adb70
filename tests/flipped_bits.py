"""Damage as a disk or a memory does it."""

from __future__ import annotations

from collections.abc import Iterator


def with_flipped_bits(content: bytes, all_from: int = 0) -> Iterator[bytes]:
    """Copies of some bytes with one bit flipped in each: a bit of every byte, and every bit from an index on."""
    for position in range(len(content)):
        for bit in range(8) if position >= all_from else (position % 8,):
            damaged = bytearray(content)
            damaged[position] ^= 1 << bit
            yield bytes(damaged)
