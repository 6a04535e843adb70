"""A ULog file in memory, with everything wrong about it told in words."""

from __future__ import annotations

import hashlib
import io
import os
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
from pyulog import ULog

from fusetune.errors import UserError
from fusetune.px4.flight import Dropout, Flight, LoggedMessage, ParameterChange, ParameterHistory, TopicKey, TopicTable
from fusetune.px4.guarded_stream import GuardedStream

_MAGIC = ULog.HEADER_BYTES
_HEADER_BYTES = 16
_SYSTEM_DEFAULT, _CURRENT_SETUP_DEFAULT = 0, 1
_LEVELS = ("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING", "NOTICE", "INFO", "DEBUG")
_COPY_AGAIN = "Copy the log from the vehicle once more; what the logger did not write cannot be recovered"


def read_ulog(path: str | os.PathLike[str]) -> Flight:
    """Read a ULog file.

    Records that cannot be made sense of are passed over and noted in `Flight.corruption`; a topic whose definition is
    damaged is missing. Topic columns have the dtypes of the log, except that `bool` fields are NumPy booleans and
    64-bit time stamps (`timestamp*`) are int64.

    Raises
    ------
    UserError
        The file cannot be opened, is empty, is no ULog, or holds no message that can be read.
    """
    file = Path(path)
    content = _content(file)
    log, printed = _parse(file, content)
    topics = _topics(log)
    if not topics:
        raise UserError(file, "holds no message that can be read", _COPY_AGAIN)
    return Flight(
        name=file.stem,
        topics=topics,
        parameters=_parameters(log),
        info=dict(log.msg_info_dict),
        multi_info=_multi_info(log),
        dropouts=[Dropout(int(dropout.timestamp), int(dropout.duration)) for dropout in log.dropouts],
        messages=_messages(log),
        start_timestamp=int(log.start_timestamp),
        last_timestamp=int(log.last_timestamp),
        checksum=hashlib.sha256(content).hexdigest(),
        size_bytes=len(content),
        corruption=_corruption(log, printed),
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
    if len(content) <= _HEADER_BYTES:
        raise UserError(file, "ends after its header", _COPY_AGAIN)
    return content


def _parse(file: Path, content: bytes) -> tuple[ULog, list[str]]:
    printed, stream = io.StringIO(), GuardedStream(content)
    try:
        with redirect_stdout(printed):
            log = ULog(stream)
    except Exception as error:  # pyulog raises whatever the damaged bytes happen to cause
        reason = f"cannot be parsed ({type(error).__name__}: {error})"
        raise UserError(file, reason, _COPY_AGAIN) from error
    notes = [line.strip() for line in printed.getvalue().splitlines() if line.strip()]
    if stream.gave_up_at is not None:
        notes.append(f"everything after byte {stream.gave_up_at} is damaged and was left out")
    return log, notes


def _topics(log: ULog) -> dict[TopicKey, TopicTable]:
    topics: dict[TopicKey, TopicTable] = {}
    for data in log.data_list:
        if "timestamp" not in data.data or not len(data.data["timestamp"]):
            continue
        types = {field.field_name: field.type_str for field in data.field_data}
        table = {
            name: _column(name, types.get(name, ""), values)
            for name, values in data.data.items()
            if "_padding" not in name
        }
        key = (data.name, int(data.multi_id))
        topics[key] = _appended(topics[key], table) if key in topics else table
    return dict(sorted(topics.items()))


def _column(name: str, type_name: str, values: np.ndarray) -> np.ndarray:
    if type_name == "bool":
        return values.astype(np.bool_)
    if values.dtype == np.uint64 and name.rsplit(".", 1)[-1].startswith("timestamp"):
        return values.astype(np.int64)
    return np.ascontiguousarray(values)


def _appended(first: TopicTable, second: TopicTable) -> TopicTable:
    """Both parts of a topic that was subscribed twice (data appended after a crash)."""
    if first.keys() != second.keys():
        return max(first, second, key=lambda table: len(table["timestamp"]))
    return {name: np.concatenate([first[name], second[name]]) for name in first}


def _parameters(log: ULog) -> ParameterHistory:
    return ParameterHistory(
        initial=dict(sorted(log.initial_parameters.items())),
        changed=[ParameterChange(int(time), name, value) for time, name, value in log.changed_parameters],
        default_system=dict(sorted(log.get_default_parameters(_SYSTEM_DEFAULT).items())),
        default_current_setup=dict(sorted(log.get_default_parameters(_CURRENT_SETUP_DEFAULT).items())),
    )


def _multi_info(log: ULog) -> dict[str, list[str]]:
    """Multi-line information whose parts are text, each entry joined."""
    return {
        key: ["".join(parts) for parts in entries]
        for key, entries in sorted(log.msg_info_multiple_dict.items())
        if all(isinstance(part, str) for parts in entries for part in parts)
    }


def _messages(log: ULog) -> list[LoggedMessage]:
    tagged = [message for messages in log.logged_messages_tagged.values() for message in messages]
    found = [
        LoggedMessage(int(message.timestamp), _level_name(message.log_level), message.message)
        for message in [*log.logged_messages, *tagged]
    ]
    return sorted(found, key=lambda message: message.timestamp)


def _level_name(level: int) -> str:
    """Name of a syslog level, which ULog stores as its ASCII digit."""
    number = level - ord("0")
    return _LEVELS[number] if 0 <= number < len(_LEVELS) else "UNKNOWN"


def _corruption(log: ULog, printed: list[str]) -> tuple[str, ...]:
    notes = list(dict.fromkeys(printed))
    missing = sorted(log._missing_message_ids)
    if missing:
        ids = ", ".join(str(message_id) for message_id in missing)
        notes = [note for note in notes if "no subscription found" not in note]
        notes.append(f"data records of message ids that the log does not define ({ids}) were passed over")
    if log.file_corruption and not notes:
        notes.append("damaged records were passed over")
    return tuple(notes)
