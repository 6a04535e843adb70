"""The reader and pyulog, PX4's own, find the same in every shared log that is whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from fusetune.px4.flight import Flight, TopicTable
from fusetune.px4.ulog.reader import read_ulog

DAMAGED = {"Auterion__corrupt_format_not_utf8", "Auterion__corrupt_unregistered_msg_id"}
"""Behind damage pyulog waits for the next synchronisation record; the reader goes on at the next record that fits."""

STORED_TIME = {"PX4__sample_log_small"}
"""Its mission was stored in an earlier run and has that run's time, which pyulog takes for the newest of the log."""


def table_of(data: ULog.Data) -> TopicTable:
    types = {field.field_name: field.type_str for field in data.field_data}
    table = {}
    for name, values in data.data.items():
        if "_padding" in name:
            continue
        is_time = name.rsplit(".", 1)[-1].startswith("timestamp") and values.dtype == np.uint64
        table[name] = values.astype(bool if types[name] == "bool" else np.int64 if is_time else values.dtype)
    return table


def same_tables(flight: Flight, judge: ULog) -> None:
    expected = {(data.name, data.multi_id): data for data in judge.data_list}
    assert flight.topics.keys() == expected.keys(), flight.name
    assert flight.left_out == (), flight.name
    for key, data in expected.items():
        table, judged = flight.topics[key], table_of(data)
        assert list(table) == list(judged), (flight.name, key)
        for name, values in judged.items():
            assert table[name].dtype == values.dtype, (flight.name, key, name)
            np.testing.assert_array_equal(table[name], values, err_msg=f"{flight.name} {key} {name}")


def same_parameters_texts_and_dropouts(flight: Flight, judge: ULog) -> None:
    assert repr(flight.info) == repr(judge.msg_info_dict), flight.name
    assert flight.start_timestamp == judge.start_timestamp
    assert {name: repr(value) for name, value in flight.parameters.initial.items()} == {
        name: repr(value) for name, value in judge.initial_parameters.items()
    }
    for own, kind in ((flight.parameters.default_system, 0), (flight.parameters.default_current_setup, 1)):
        assert own == judge.get_default_parameters(kind), flight.name
    tagged = [text for texts in judge.logged_messages_tagged.values() for text in texts]
    texts = sorted((text.timestamp, text.message) for text in [*judge.logged_messages, *tagged])
    assert sorted((text.timestamp, text.text) for text in flight.messages) == texts
    if flight.name not in STORED_TIME:
        assert flight.last_timestamp == judge.last_timestamp, flight.name
        assert [tuple(one) for one in flight.dropouts] == [(one.timestamp, one.duration) for one in judge.dropouts]
        assert [tuple(one) for one in flight.parameters.changed] == judge.changed_parameters, flight.name


def test_same_tables_parameters_texts_and_dropouts(shared_logs: Path) -> None:
    for log in [log for log in sorted(shared_logs.glob("*.ulg")) if log.stem not in DAMAGED]:
        flight, judge = read_ulog(log), ULog(str(log))
        same_tables(flight, judge)
        same_parameters_texts_and_dropouts(flight, judge)


@pytest.mark.parametrize("name", sorted(DAMAGED))
def test_behind_damage_nothing_is_found_less(name: str, shared_logs: Path) -> None:
    flight, judge = read_ulog(shared_logs / f"{name}.ulg"), ULog(str(shared_logs / f"{name}.ulg"))
    left_out = {(one.topic, one.instance): one.rows for one in flight.left_out}
    for data in judge.data_list:
        key = (data.name, data.multi_id)
        assert len(flight.topics[key]["timestamp"]) + left_out.get(key, 0) >= len(data.data["timestamp"]), key
    assert flight.corruption
