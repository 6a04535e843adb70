"""The blob's bytes are those that the viewer reads, and give back what was packed."""

from __future__ import annotations

import gzip
import json
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusetune.errors import UserError
from fusetune.report.flight_data.blob import ArrayStore, pack, unpack, with_header


def packed(store: ArrayStore, **header: object) -> bytes:
    return pack({"version": 1, "arrays": store.entries, **header}, store.content)


def test_the_bytes_by_hand() -> None:
    """1.0 is 0x3F800000 and −2.0 0xC0000000; times 0, 2.5 and 7.5 ms are the differences 0, 25 and 50 ticks."""
    store = ArrayStore()
    assert store.figures(np.array([1.0, -2.0])) == 0
    assert store.times(np.array([0, 25, 75])) == 1
    assert store.flags(np.array([True, False])) == 2
    raw = gzip.decompress(packed(store, title="°"))
    (length,) = struct.unpack("<I", raw[:4])
    assert length % 4 == 0
    header = json.loads(raw[4 : 4 + length].decode())
    assert header["title"] == "°"
    assert header["arrays"] == [
        {"offset": 0, "count": 2, "type": "f4"},
        {"offset": 8, "count": 3, "type": "dt"},
        {"offset": 20, "count": 2, "type": "u1"},
    ]
    # lowest bytes of all elements first
    assert raw[4 + length :].hex(" ") == (
        "00 00 00 00 80 00 3f c0  00 19 32 00 00 00 00 00 00 00 00 00  01 00".replace("  ", " ")
    )


@settings(max_examples=200, deadline=None)
@given(arrays(np.float32, st.integers(0, 50), elements=st.floats(width=32, allow_nan=True)))
def test_figures_keep_sixteen_bits_of_their_mantissa(values: np.ndarray) -> None:
    """Rounded to nearest, so within half of the last bit, 2⁻¹⁷ of the figure; the largest are cut, within 2⁻¹⁶."""
    store = ArrayStore()
    store.figures(values)
    found = unpack(packed(store)).arrays[0]
    known = np.isfinite(values)
    assert np.isnan(found[~known]).all()
    figures = values[known].astype(np.float64)
    error = np.abs(found[known] - figures)
    normal = np.abs(figures) >= np.finfo(np.float32).tiny
    largest = np.abs(figures) > np.finfo(np.float32).max * (1 - 2.0**-16)
    assert np.all(error[normal & ~largest] <= 2.0**-17 * np.abs(figures[normal & ~largest]))
    assert np.all(error[largest] <= 2.0**-16 * np.abs(figures[largest]))
    assert not (found.view(np.uint32)[known] & 0x7F).any()


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 40_000_000), max_size=60))
def test_times_are_exact_to_a_tenth_of_a_millisecond(ticks: list[int]) -> None:
    """Up to more than an hour after the log began."""
    store = ArrayStore()
    store.times(np.array(sorted(ticks), np.int64))
    found = unpack(packed(store)).arrays[0]
    assert np.rint(found * 1e4).astype(int).tolist() == sorted(ticks)


def test_the_same_array_is_stored_once() -> None:
    store = ArrayStore()
    time = np.arange(0, 1000, 10)
    assert store.times(time) == store.times(time.copy())
    assert store.figures(time) != store.figures(time + 1)
    assert len(store.entries) == 3


def test_the_same_content_gives_the_same_bytes() -> None:
    store = ArrayStore()
    store.figures(np.arange(10.0))
    assert packed(store) == packed(store)


def test_a_header_can_be_changed_without_the_arrays() -> None:
    store = ArrayStore()
    store.figures(np.arange(3.0))
    found = unpack(with_header(packed(store, label="before"), {"label": "after"}))
    assert found.header["label"] == "after"
    assert found.arrays[0].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    "broken",
    [b"", b"no gzip", gzip.compress(b"\x04\x00\x00\x00[]  ", mtime=0), gzip.compress(b"\xff", mtime=0)],
    ids=["empty", "text", "no header", "cut off"],
)
def test_what_is_no_blob_is_told(broken: bytes) -> None:
    with pytest.raises(UserError, match=r"flight\.blob.*holds no data of a flight"):
        unpack(broken, "flight.blob")


def test_another_version_is_told() -> None:
    with pytest.raises(UserError, match="in the form 2, which is not 1"):
        unpack(pack({"version": 2, "arrays": []}, b""))
