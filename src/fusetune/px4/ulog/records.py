"""The records of a ULog file: where each lies, and how to go on behind damage.

A ULog is a chain of records, each with its length and kind in front, so it can only be gone through in order. Nearly
all are data records, and what one looks like is known: its kind, and the length that belongs to its message id. So the
places of all that look like one are found with NumPy, a block of the file at a time, and runs in which each ends where
the next begins are taken as a whole; only what lies between the runs is looked at one by one. Whatever the bytes are,
the scan moves forward.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fusetune.px4.ulog.definitions import Definitions, MessageSize, topic_name
from fusetune.time_limit import Deadline

HEADER_BYTES = 16
SYNC_MAGIC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_HEAD = struct.Struct("<HB").unpack_from
DATA_HEAD_BYTES = 5
_HEAD_BYTES = 3
_DATA = ord("D")
_LEVELS = range(ord("0"), ord("8"))
_KEY = re.compile(rb"[A-Za-z]\w*(\[\d+\])? [^\x00-\x20]+")
_FORMAT_BEGIN = re.compile(rb"[A-Za-z]\w{0,99}:")
_TOPIC = re.compile(rb"[A-Za-z]\w{0,99}")
_MOST_PADDING = 64
_MOST_STRANGE_RECORDS = 8
_SMALLEST_SEARCH, _LARGEST_SEARCH = 256, 1 << 20
_FIRST_BLOCK_BYTES, _LARGEST_BLOCK_BYTES = 1 << 12, 1 << 18
"""A subscription changes what a block looks for, so blocks begin small behind each."""
_NO_LENGTH = 1 << 20

_KNOWN_KIND = np.zeros(256, np.bool_)
_KNOWN_KIND[list(b"DSOLCARFIPMQ")] = True
_TELLING_KIND = np.zeros(256, np.bool_)
_TELLING_KIND[list(b"DSAFIPMQ")] = True
"""Kinds whose content tells them from rubbish; a text, a dropout or a removal could lie anywhere."""


class Record(NamedTuple):
    """A record that is no data: its kind and the place of its content."""

    kind: int
    begin: int
    end: int


class Damage(NamedTuple):
    """Bytes that belong to no record."""

    begin: int
    end: int


@dataclass
class Subscription:
    """A topic instance that is logged under a message id."""

    topic: str
    instance: int
    size: MessageSize
    places: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """Where each of its records begins, ascending."""


@dataclass
class Scan:
    """What a file is made of."""

    definitions: Definitions = field(default_factory=Definitions)
    subscriptions: dict[int, Subscription] = field(default_factory=dict)
    records: list[Record] = field(default_factory=list)
    data_begin: int = HEADER_BYTES
    """Where the definitions end and the data begin."""
    undefined_topics: dict[int, str] = field(default_factory=dict)
    """Message ids of topics that are logged and have no readable definition."""
    strange_ids: dict[int, int] = field(default_factory=dict)
    """Message ids that no topic is logged under, with the number of their records."""
    unknown_kinds: dict[int, int] = field(default_factory=dict)
    misfits: int = 0
    """Records that are not what their kind says."""
    damages: list[Damage] = field(default_factory=list)
    cut_at: int | None = None
    """Where the last record begins, if the file ends within it."""


@dataclass
class _Block:
    """What looks like a data record in a part of the file."""

    stop: int
    places: np.ndarray
    ids: np.ndarray
    ends: np.ndarray
    run_ends: np.ndarray
    """Rows whose record does not end where the next row's begins."""


class Scanner:
    """Goes through the sections of a file and puts together its `Scan`."""

    def __init__(self, content: bytes, deadline: Deadline | None = None) -> None:
        self._content = content
        self._deadline = deadline or Deadline()
        self._bytes = np.frombuffer(content, np.uint8)
        self._shortest = np.full(0x10000, _NO_LENGTH, np.int32)
        self._longest = np.zeros(0x10000, np.int32)
        self._block: _Block | None = None
        self._block_bytes = _FIRST_BLOCK_BYTES
        self._runs: list[tuple[np.ndarray, np.ndarray]] = []
        self._in_definitions = True
        self._scan = Scan()

    def run(self, begin: int, stop: int) -> None:
        """Scan one section of the file: the bytes from `begin` to before `stop`."""
        position, self._block = begin, None
        while position < stop:
            self._deadline.check()
            behind = self._behind_data(position, stop)
            position = behind if behind > position else self._step(position, stop)

    def _behind_data(self, position: int, stop: int) -> int:
        """Take the data records that follow each other from `position` on; where they end."""
        if self._content[position + 2 : position + 3] != b"D":
            return position
        block = self._block
        if block is None or position >= block.stop:
            block = self._block = self._data_in(position, stop)
        row = int(np.searchsorted(block.places, position))
        if row == len(block.places) or block.places[row] != position:
            return position
        last = int(block.run_ends[np.searchsorted(block.run_ends, row)])
        self._runs.append((block.places[row : last + 1], block.ids[row : last + 1]))
        return int(block.ends[last])

    def finish(self) -> Scan:
        """What was found, after the last section."""
        if self._runs:
            places = np.concatenate([places for places, _ in self._runs])
            ids = np.concatenate([ids for _, ids in self._runs])
            order = np.argsort(ids, kind="stable")
            found, firsts = np.unique(ids[order], return_index=True)
            for message_id, rows in zip(found.tolist(), np.split(order, firsts[1:]), strict=True):
                self._scan.subscriptions[message_id].places = places[rows]
            self._runs = []
        return self._scan

    def _data_in(self, begin: int, stop: int) -> _Block:
        """All that looks like a data record of a topic known so far and begins in the block from `begin` on."""
        block_stop = min(begin + self._block_bytes, stop)
        self._block_bytes = min(2 * self._block_bytes, _LARGEST_BLOCK_BYTES)
        last = min(block_stop, stop - DATA_HEAD_BYTES + 1)
        content = self._bytes
        places = np.flatnonzero(content[begin + 2 : max(last, begin) + 2] == _DATA) + begin
        sizes = content[places].astype(np.int32) | content[places + 1].astype(np.int32) << 8
        ids = content[places + 3].astype(np.uint16) | content[places + 4].astype(np.uint16) << 8
        ends = places + _HEAD_BYTES + sizes
        likely = (sizes >= self._shortest[ids]) & (sizes <= self._longest[ids]) & (ends <= stop)
        places, ids, ends = places[likely], ids[likely], ends[likely]
        run_ends = np.flatnonzero(np.append(ends[:-1] != places[1:], True)) if len(places) else places
        return _Block(block_stop, places, ids, ends, run_ends)

    def _step(self, position: int, stop: int) -> int:
        """Take any record, or find the end of the damage; where to go on."""
        if self._is_record(position, stop):
            size, kind = _HEAD(self._content, position)
            end = position + _HEAD_BYTES + size
            if not self._take(Record(kind, position + _HEAD_BYTES, end)):
                self._scan.misfits += 1
            return end
        if self._leads_on(position, stop):
            return self._pass_over(position)
        found = self._next_record(position + 1, stop)
        if found is None and stop - position <= _HEAD_BYTES + 0xFFFF and self._may_be_cut(position, stop):
            self._scan.cut_at = position
        else:
            self._scan.damages.append(Damage(position, stop if found is None else found))
        return stop if found is None else found

    def _may_be_cut(self, position: int, stop: int) -> bool:
        """Whether the last bytes look like the begin of a record."""
        return stop - position < _HEAD_BYTES or bool(_KNOWN_KIND[self._content[position + 2]])

    def _is_record(self, position: int, stop: int) -> bool:
        """Whether a record of a known kind with fitting content lies here as a whole."""
        if position + _HEAD_BYTES > stop:
            return False
        content = self._content
        size, kind = _HEAD(content, position)
        begin = position + _HEAD_BYTES
        if begin + size > stop or not _KNOWN_KIND[kind]:
            return False
        match chr(kind):
            case "D":
                if size < 2:
                    return False
                message_id = content[begin] | content[begin + 1] << 8
                return bool(self._shortest[message_id] <= size <= self._longest[message_id])
            case "S":
                return size == 8 and content[begin : begin + 8] == SYNC_MAGIC
            case "O" | "R":
                return size == 2
            case "L":
                return size >= 9 and content[begin] in _LEVELS
            case "C":
                return size >= 11 and content[begin] in _LEVELS
            case "A":
                return _TOPIC.fullmatch(content, begin + 3, begin + size) is not None
            case "F":
                return _FORMAT_BEGIN.match(content, begin, begin + size) is not None
            case "I" | "P":
                return self._has_key(begin, size)
            case _:
                return size > 1 and self._has_key(begin + 1, size - 1)

    def _has_key(self, begin: int, size: int) -> bool:
        if not size:
            return False
        length = self._content[begin]
        return length < size and _KEY.fullmatch(self._content, begin + 1, begin + 1 + length) is not None

    def _leads_on(self, position: int, stop: int) -> bool:
        """Whether the length written here leads, over a few records that are not understood, to one that is."""
        for _ in range(_MOST_STRANGE_RECORDS):
            if position + _HEAD_BYTES > stop:
                return False
            size, kind = _HEAD(self._content, position)
            if not size or not chr(kind).isalpha():
                return False
            position += _HEAD_BYTES + size
            if position >= stop:
                return position == stop
            if self._is_record(position, stop):
                return True
        return False

    def _pass_over(self, position: int) -> int:
        """Step over a record that is not understood; where the next one begins."""
        size, kind = _HEAD(self._content, position)
        begin = position + _HEAD_BYTES
        scan = self._scan
        if kind == _DATA and size >= 2:
            message_id = self._content[begin] | self._content[begin + 1] << 8
            if message_id in scan.subscriptions:
                scan.misfits += 1
            elif message_id not in scan.undefined_topics:
                scan.strange_ids[message_id] = scan.strange_ids.get(message_id, 0) + 1
        elif _KNOWN_KIND[kind]:
            scan.misfits += 1
        else:
            scan.unknown_kinds[kind] = scan.unknown_kinds.get(kind, 0) + 1
        return begin + size

    def _next_record(self, position: int, stop: int) -> int | None:
        """The first place from `position` on where a record lies that another, or the end, follows."""
        for candidate in self._candidates(position, stop):
            if self._is_record(candidate, stop):
                size, _ = _HEAD(self._content, candidate)
                after = candidate + _HEAD_BYTES + size
                if after == stop or self._is_record(after, stop):
                    return candidate
        return None

    def _candidates(self, position: int, stop: int) -> Iterator[int]:
        """Places whose third byte is the kind of a record that can be told from rubbish."""
        length = _SMALLEST_SEARCH
        while position < stop:
            kinds = self._bytes[position + 2 : min(position + 2 + length, stop)]
            yield from (np.flatnonzero(_TELLING_KIND[kinds]) + position).tolist()
            position += length
            length = min(2 * length, _LARGEST_SEARCH)

    def _take(self, record: Record) -> bool:
        """Keep a record; whether it made sense."""
        kind = chr(record.kind)
        if self._in_definitions and kind in "ALC":
            self._in_definitions = False
            self._scan.data_begin = record.begin - _HEAD_BYTES
        try:
            if kind == "F":
                self._scan.definitions.add(self._content[record.begin : record.end])
            elif kind == "A":
                self._subscribe(record)
            elif kind not in "SRB":
                self._scan.records.append(record)
        except ValueError:
            return False
        return True

    def _subscribe(self, record: Record) -> None:
        instance, message_id = struct.unpack_from("<BH", self._content, record.begin)
        topic = topic_name(self._content[record.begin + 3 : record.end].decode("utf-8", "ignore"))
        known = self._scan.subscriptions.get(message_id)
        if known is not None:
            if (known.topic, known.instance) != (topic, instance):
                raise ValueError(f"message id {message_id} has two topics")
            return
        try:
            size = self._scan.definitions.size(topic)
            padding = self._scan.definitions.padding(topic)
        except ValueError:
            self._scan.undefined_topics[message_id] = topic
            raise
        self._scan.undefined_topics.pop(message_id, None)
        self._scan.subscriptions[message_id] = Subscription(topic, instance, size)
        shortest = size.size - padding + 2
        self._shortest[message_id] = shortest
        self._longest[message_id] = min(size.size + 2, shortest + _MOST_PADDING)
        self._block, self._block_bytes = None, _FIRST_BLOCK_BYTES
