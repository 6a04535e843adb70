"""The stream under pyulog makes headway whatever the bytes are."""

from __future__ import annotations

import io

import numpy as np

from fusetune.px4.guarded_stream import GuardedStream


def test_reads_and_seeks_like_any_stream() -> None:
    stream = GuardedStream(bytes(range(100)))
    assert stream.read(10) == bytes(range(10))
    assert stream.seek(-4, io.SEEK_CUR) == 6
    assert stream.read(2) == bytes([6, 7])
    assert stream.seek(50) == 50
    assert stream.read() == bytes(range(50, 100))


def test_step_back_after_a_short_read_counts_from_what_was_asked_for() -> None:
    stream = GuardedStream(bytes(20))
    stream.seek(10)
    head = stream.read(3)  # a head that claims 1000 bytes
    assert len(head) == 3
    assert len(stream.read(1000)) == 7
    # pyulog goes back by the claimed length and two bytes of the head: to the byte after the head's first
    assert stream.seek(-2 - 1000, io.SEEK_CUR) == 11


def test_ends_after_too_many_steps_back() -> None:
    stream = GuardedStream(bytes(1000), most_steps_back=5)
    for position in range(5):
        stream.read(3)
        assert stream.seek(-2, io.SEEK_CUR) == position + 1
    stream.read(3)
    stream.seek(-2, io.SEEK_CUR)
    assert stream.read(3) == b""
    assert stream.gave_up_at == 8


def test_rubbish_is_passed_in_one_sweep() -> None:
    content = np.random.default_rng(1).integers(0, 256, 5000, np.uint8).tobytes()
    stream = GuardedStream(content)
    visited = []
    while head := stream.read(3):
        if len(head) < 3:
            break
        visited.append(stream.tell() - 3)
        size = int.from_bytes(head[:2], "little")
        stream.read(size)
        stream.seek(-2 - size, io.SEEK_CUR)
    assert visited == list(range(len(content) - 2))
