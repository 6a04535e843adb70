"""A ULog file in memory, with everything wrong about it told in words."""

from __future__ import annotations

import hashlib
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusetune.errors import UserError
from fusetune.px4.flight import (
    Dropout,
    Flight,
    LeftOut,
    LoggedMessage,
    ParameterChange,
    ParameterHistory,
    TopicKey,
    TopicTable,
)
from fusetune.px4.layouts.release_layouts import ESTIMATOR_TOPICS
from fusetune.px4.release_signs import flag_signs
from fusetune.px4.releases import FIRST, NEWEST, name_of
from fusetune.px4.ulog.definitions import MessageLayout, is_padding
from fusetune.px4.ulog.reading_limits import RAISE_LIMITS, ReadingLimits
from fusetune.px4.ulog.records import DATA_HEAD_BYTES, HEADER_BYTES, Scan, Scanner
from fusetune.px4.ulog.times import STORED_TOPICS, ImpossibleRows, clock_of, impossible_rows, newest_before
from fusetune.px4.ulog.used_topics import is_used, within_limits
from fusetune.px4.ulog.values import LoggedValues, logged_values
from fusetune.time_limit import Deadline, TimeLimitError

_MAGIC = b"ULog\x01\x12\x35"
_NEWEST_VERSION = 1
_FLAG_BITS = struct.Struct("<HB8s8s3Q")
_DATA_APPENDED = 1
_LATEST_START_US = 1 << 62
_IMU = ("sensor_combined", 0)
_COPY_AGAIN = "Copy the log from the vehicle once more; what the logger did not write cannot be recovered"


class _Messages(NamedTuple):
    """The messages of one topic instance and where in the file they lie."""

    table: TopicTable
    places: np.ndarray


def read_ulog(
    path: str | os.PathLike[str], limits: ReadingLimits | None = None, deadline: Deadline | None = None
) -> Flight:
    """Read a ULog file.

    Records that cannot be made sense of are passed over and noted in `Flight.corruption`; a topic whose definition is
    damaged is missing, and noted in `Flight.undefined_topics`. Messages whose time stamps cannot be are left out, and
    counted in `Flight.left_out`. Topics beyond the limits are named in `Flight.beyond_limits`. Topic columns have the
    dtypes of the log, except that `bool` fields are NumPy booleans and 64-bit time stamps (`timestamp*`) are int64.

    Parameters
    ----------
    limits
        How many tables the log may have and how long reading it may take.
    deadline
        Of work that reading is a part of, in place of the limits' own.

    Raises
    ------
    UserError
        The file cannot be opened, is empty, is no ULog, holds no message that can be read, or takes too long.
    """
    limits = limits or ReadingLimits()
    deadline = deadline or Deadline(limits.time_limit_s)
    try:
        return _read(Path(path), limits, deadline)
    except TimeLimitError as error:
        raise takes_too_long(path, deadline) from error


def _is_input(key: TopicKey) -> bool:
    return key[0] in ESTIMATOR_TOPICS


def takes_too_long(path: str | os.PathLike[str], deadline: Deadline) -> UserError:
    """The error for a log that the time was not enough for."""
    reason = f"takes longer than {deadline.seconds:g} s: it is very large, or made of what no vehicle logs"
    return UserError(path, reason, "If the log is sound, raise reading.time_limit_s in the configuration")


def _read(file: Path, limits: ReadingLimits, deadline: Deadline) -> Flight:
    content = _content(file)
    scanner = Scanner(content, deadline)
    notes = _scan_sections(file, content, scanner)
    scan = scanner.finish()
    values = logged_values(content, scan, deadline)
    notes += _damage(scan, values, len(content))
    messages, beyond = _messages(content, scan, limits, deadline)
    if not messages and beyond:
        raise UserError(file, "holds too many topics, and none that is used", RAISE_LIMITS)
    if not messages:
        raise UserError(file, "holds no message that can be read", _COPY_AGAIN)
    times, places = _times(messages), _places(messages)
    clock = clock_of(times, places, _IMU, trusted=lambda key: is_used(key[0]))
    left_out = _without_impossible_rows(messages, impossible_rows(times, places, clock, _is_input))
    if not messages:
        raise UserError(file, "holds no message whose time stamp can be", _COPY_AGAIN)
    times, places = _times(messages), _places(messages)
    start, note = _start(content, times, clock)
    deadline.check()
    topics = {key: one.table for key, one in messages.items()}
    return Flight(
        name=file.stem,
        topics=topics,
        parameters=_parameters(values, times, places, start),
        info=values.info,
        multi_info=_multi_info(values),
        dropouts=_dropouts(values, times, places, start),
        messages=_texts(values),
        start_timestamp=start,
        last_timestamp=max([start, *(int(one.max()) for one in times.values())]),
        checksum=hashlib.sha256(content).hexdigest(),
        size_bytes=len(content),
        corruption=(*notes, *note),
        undefined_topics=tuple(sorted(set(scan.undefined_topics.values()))),
        left_out=left_out,
        beyond_limits=beyond,
        release_signs=flag_signs(topics),
    )


def file_checksum(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file, hexadecimal.

    Raises
    ------
    UserError
        The file cannot be read.
    """
    return hashlib.sha256(_bytes_of(Path(path))).hexdigest()


def _bytes_of(file: Path) -> bytes:
    if file.exists() and not (file.is_file() or file.is_dir()):
        raise UserError(file, "cannot be opened: it is no file", "Put a file in its place")
    try:
        return file.read_bytes()
    except OSError as error:
        reason = error.strerror or "cannot be read"
        raise UserError(file, f"cannot be opened: {reason}", "Check that the file is there and may be read") from error


def _content(file: Path) -> bytes:
    content = _bytes_of(file)
    if not content:
        raise UserError(file, "is empty", _COPY_AGAIN)
    if content[: len(_MAGIC)] != _MAGIC:
        raise UserError(file, "is not a ULog file", "Take the .ulg file that PX4 wrote to the SD card, unchanged")
    if len(content) <= HEADER_BYTES:
        raise UserError(file, "ends after its header", _COPY_AGAIN)
    return content


def _scan_sections(file: Path, content: bytes, scanner: Scanner) -> list[str]:
    """Scan the file, its appended parts each on its own; what is odd about its header in words."""
    notes = []
    if content[7] > _NEWEST_VERSION:
        notes.append(f"the file has version {content[7]} of the format, version {_NEWEST_VERSION} is known")
    begin, offsets = HEADER_BYTES, []
    if len(content) >= HEADER_BYTES + _FLAG_BITS.size:
        size, kind, _, incompatible, *appended = _FLAG_BITS.unpack_from(content, HEADER_BYTES)
        if kind == ord("B") and size >= _FLAG_BITS.size - 3:
            begin += 3 + size
            if incompatible[0] & ~_DATA_APPENDED or any(incompatible[1:]):
                reason = f"says that it needs unknown features of the format (flags {incompatible.hex()})"
                raise UserError(
                    file, reason, f"Use a log of PX4 {name_of(FIRST)} to {name_of(NEWEST)}, or copy it again"
                )
            offsets = [offset for offset in appended if offset] if incompatible[0] & _DATA_APPENDED else []
    if any(not begin <= offset <= len(content) for offset in offsets) or offsets != sorted(set(offsets)):
        notes.append("the places of appended data are damaged; they were looked for")
        offsets = []
    for stop in (*offsets, len(content)):
        scanner.run(begin, stop)
        begin = stop
    return notes


def _damage(scan: Scan, values: LoggedValues, size: int) -> list[str]:
    """What was passed over, in words."""
    notes = []
    if scan.damages:
        lost = sum(damage.end - damage.begin for damage in scan.damages)
        first = scan.damages[0].begin
        places = "one place" if len(scan.damages) == 1 else f"{len(scan.damages)} places"
        notes.append(f"{lost} bytes in {places} (the first at byte {first}) are no records and were left out")
    if scan.cut_at is not None:
        notes.append(f"the recording breaks off within a record, at byte {scan.cut_at} of {size}; all before is used")
    if scan.strange_ids:
        ids = ", ".join(str(message_id) for message_id in sorted(scan.strange_ids)[:8])
        more = ", …" if len(scan.strange_ids) > 8 else ""
        notes.append(f"data records of message ids that the log does not define ({ids}{more}) were passed over")
    if scan.unknown_kinds:
        count = sum(scan.unknown_kinds.values())
        notes.append(f"{count} {'record' if count == 1 else 'records'} of unknown kind were passed over")
    misfits = scan.misfits + values.misfits
    if misfits:
        notes.append(f"{misfits} damaged {'record was' if misfits == 1 else 'records were'} passed over")
    return notes


def _messages(
    content: bytes, scan: Scan, limits: ReadingLimits, deadline: Deadline
) -> tuple[dict[TopicKey, _Messages], tuple[str, ...]]:
    """Tables of all topic instances within the limits, and the names of the topics beyond."""
    found: dict[TopicKey, list[np.ndarray]] = {}
    for subscription in scan.subscriptions.values():
        if len(subscription.places):
            found.setdefault((subscription.topic, subscription.instance), []).append(subscription.places)
    kept = within_limits({key: scan.definitions.size(key[0]).columns for key in found}, limits)
    messages = {}
    for key in sorted(kept):
        deadline.check()
        # data appended after a crash may be under another message id
        places = found[key][0] if len(found[key]) == 1 else np.sort(np.concatenate(found[key]))
        messages[key] = _Messages(_table(content, scan.definitions.layout(key[0]), places), places)
    return messages, tuple(sorted({topic for topic, _ in found.keys() - kept}))


def _table(content: bytes, layout: MessageLayout, places: np.ndarray) -> TopicTable:
    """Columns of all messages of a topic instance."""
    width = layout.dtype.itemsize
    # every place of the file seen as the begin of a message: taking the right ones copies each message once
    anywhere = np.ndarray((len(content) - width - DATA_HEAD_BYTES + 1,), f"V{width}", content, DATA_HEAD_BYTES, (1,))
    rows = anywhere[places].view(layout.dtype)
    return {
        name: _column(name, rows[name], is_bool=name in layout.booleans)
        for name in layout.dtype.names or ()
        if not is_padding(name)
    }


def _column(name: str, values: np.ndarray, *, is_bool: bool) -> np.ndarray:
    if is_bool:
        return values != 0
    if values.dtype == np.uint64 and name.rsplit(".", 1)[-1].startswith("timestamp"):
        return values.astype(np.int64)
    return np.ascontiguousarray(values)


def _times(messages: Mapping[TopicKey, _Messages]) -> dict[TopicKey, np.ndarray]:
    """Time stamps of all topics that live by the clock of this flight."""
    return {key: one.table["timestamp"] for key, one in messages.items() if key[0] not in STORED_TOPICS}


def _places(messages: Mapping[TopicKey, _Messages]) -> dict[TopicKey, np.ndarray]:
    return {key: one.places for key, one in messages.items() if key[0] not in STORED_TOPICS}


def _without_impossible_rows(
    messages: dict[TopicKey, _Messages], wrong: Mapping[TopicKey, ImpossibleRows]
) -> tuple[LeftOut, ...]:
    """Take messages out whose time cannot be; what was taken out."""
    for key, (rows, _) in wrong.items():
        table, places = messages[key]
        messages[key] = _Messages({name: values[~rows] for name, values in table.items()}, places[~rows])
        if rows.all():
            del messages[key]
    return tuple(LeftOut(*key, int(rows.sum()), len(rows), reason) for key, (rows, reason) in wrong.items())


def _start(content: bytes, times: Mapping[TopicKey, np.ndarray], clock: TopicKey | None) -> tuple[int, list[str]]:
    """Start of the log, and a note where the header's is impossible and the first time of the data takes its place."""
    (start,) = struct.unpack_from("<Q", content, 8)
    newest = max((int(one.max()) for one in times.values()), default=0)
    if start <= newest or (not times and start < _LATEST_START_US):
        return start, []
    known = None if clock is None else times.get(clock)
    first = max(times.values(), key=len, default=np.zeros(1, np.int64)) if known is None else known
    return int(first.min()), [f"the time at which the log began is damaged ({start} µs)"]


def _parameters(
    values: LoggedValues, times: Mapping[TopicKey, np.ndarray], places: Mapping[TopicKey, np.ndarray], start: int
) -> ParameterHistory:
    changes = values.changed_parameters
    at = newest_before(np.array([place for place, _, _ in changes], np.int64), times, places, start)
    return ParameterHistory(
        initial=dict(sorted(values.initial_parameters.items())),
        changed=[ParameterChange(int(time), name, value) for time, (_, name, value) in zip(at, changes, strict=True)],
        default_system=dict(sorted(values.default_system.items())),
        default_current_setup=dict(sorted(values.default_current_setup.items())),
    )


def _dropouts(
    values: LoggedValues, times: Mapping[TopicKey, np.ndarray], places: Mapping[TopicKey, np.ndarray], start: int
) -> list[Dropout]:
    at = newest_before(np.array([place for place, _ in values.dropouts], np.int64), times, places, start)
    return [Dropout(int(time), duration) for time, (_, duration) in zip(at, values.dropouts, strict=True)]


def _multi_info(values: LoggedValues) -> dict[str, list[str]]:
    """Multi-line information whose parts are text, each entry joined."""
    return {
        key: ["".join(str(part) for part in parts) for parts in entries]
        for key, entries in sorted(values.multi_info.items())
        if all(isinstance(part, str) for parts in entries for part in parts)
    }


def _texts(values: LoggedValues) -> list[LoggedMessage]:
    found = [LoggedMessage(text.timestamp, text.level, text.text) for text in values.texts]
    return sorted(found, key=lambda message: message.timestamp)
