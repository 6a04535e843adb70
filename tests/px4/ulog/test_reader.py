"""Damaged files become errors in words or readable remains, never anything else."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from fusetune.errors import UserError
from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog


@pytest.fixture(scope="module")
def sound_log(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    time = np.arange(200, dtype=np.int64) * 5000 + 1_000_000
    topics = {
        ("sensor_combined", 0): {"timestamp": time, "gyro_rad[0]": np.zeros(200, np.float32)},
        ("vehicle_status", 0): {"timestamp": time[::50], "arming_state": np.full(4, 2, np.uint8)},
    }
    path = tmp_path_factory.mktemp("sound") / "sound.ulg"
    write_ulog(path, Flight("sound", topics, ParameterHistory({"EKF2_EN": 1}), info={"sys_name": "PX4"}))
    return path.read_bytes()


def read_bytes(folder: Path, content: bytes) -> Flight:
    (folder / "log.ulg").write_bytes(content)
    return read_ulog(folder / "log.ulg")


def test_checksum_is_of_the_file(tmp_path: Path, sound_log: bytes) -> None:
    flight = read_bytes(tmp_path, sound_log)
    assert flight.checksum == hashlib.sha256(sound_log).hexdigest()
    assert flight.size_bytes == len(sound_log)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b"PK\x03\x04 not a log", "is not a ULog file"),
        (b"ULog\x01\x12\x35", "ends after its header"),
        (b"ULog\x01\x12\x35\x01" + bytes(8), "ends after its header"),
        (b"ULog\x01\x12\x35\x01" + bytes(8) + b"\xff" * 200, "holds no message"),
    ],
)
def test_what_is_no_log_is_named(tmp_path: Path, content: bytes, reason: str) -> None:
    with pytest.raises(UserError, match=reason) as error:
        read_bytes(tmp_path, content)
    assert error.value.file.endswith("log.ulg")
    assert error.value.remedy


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"absent\.ulg: cannot be opened"):
        read_ulog(tmp_path / "absent.ulg")


def test_a_folder_is_no_log(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be opened"):
        read_ulog(tmp_path)


def test_log_cut_off_keeps_what_came_before(tmp_path: Path, sound_log: bytes) -> None:
    flight = read_bytes(tmp_path, sound_log[: len(sound_log) * 3 // 4 + 1])
    rows = len(flight.topics["sensor_combined", 0]["timestamp"])
    assert 100 < rows < 200


def test_unknown_message_id_is_passed_over_and_noted(tmp_path: Path, sound_log: bytes) -> None:
    stray = (2 + 8).to_bytes(2, "little") + b"D" + (999).to_bytes(2, "little") + bytes(8)
    flight = read_bytes(tmp_path, sound_log + stray)
    assert len(flight.topics["sensor_combined", 0]["timestamp"]) == 200
    assert "999" in " ".join(flight.corruption)


def test_name_that_is_not_utf8_does_not_stop_the_rest(tmp_path: Path, sound_log: bytes) -> None:
    flight = read_bytes(tmp_path, sound_log.replace(b"vehicle_status:", b"vehicle_s\xff\xfeatus:", 1))
    assert ("sensor_combined", 0) in flight.topics
    assert ("vehicle_status", 0) not in flight.topics


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=20))
@example(changes=[(59, 0), (289, 64)])  # no message is left that lives by the clock of the flight
def test_no_damage_escapes_as_anything_but_a_user_error(
    tmp_path: Path, sound_log: bytes, changes: list[tuple[int, int]]
) -> None:
    damaged = bytearray(sound_log)
    for position, value in changes:
        damaged[position % len(damaged)] = value
    try:
        flight = read_bytes(tmp_path, bytes(damaged))
    except UserError:
        return
    assert flight.topics
    for table in flight.topics.values():
        assert len({len(values) for values in table.values()}) == 1


def test_shared_logs_with_damage_are_read(shared_logs: Path) -> None:
    flight = read_ulog(shared_logs / "Auterion__corrupt_unregistered_msg_id.ulg")
    assert "32812" in " ".join(flight.corruption)
    # the figure of the table that comes with the logs: 201 Hz over some 95 s
    assert len(flight.topics["sensor_combined", 0]["timestamp"]) == pytest.approx(201 * 95, rel=0.01)
    assert read_ulog(shared_logs / "Auterion__corrupt_format_not_utf8.ulg").corruption
