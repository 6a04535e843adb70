"""What is written as ULog comes back the same through pyulog, an independent reader."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn
from pyulog import ULog
from tests.px4.same_topics import assert_same_topics

from fusetune.px4.flight import Dropout, Flight, LoggedMessage, ParameterChange, ParameterHistory
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog

DTYPES = [np.bool_, np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.uint64, np.float32, np.float64]
NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,10}[a-z]", fullmatch=True).filter(
    lambda name: not name.startswith("timestamp")
)


@st.composite
def topic_tables(draw: st.DrawFn) -> dict[str, np.ndarray]:
    rows = draw(st.integers(1, 20))
    steps = draw(stn.arrays(np.int64, rows, elements=st.integers(0, 10**6)))
    table: dict[str, np.ndarray] = {"timestamp": 10**6 + np.cumsum(steps)}
    for name in draw(st.lists(NAMES, max_size=4, unique=True)):
        dtype = draw(st.sampled_from(DTYPES))
        columns = draw(st.sampled_from([[name], [f"{name}[{axis}]" for axis in range(3)]]))
        for column in columns:
            table[column] = draw(stn.arrays(dtype, rows))
    return table


@st.composite
def flights(draw: st.DrawFn) -> Flight:
    names = draw(st.lists(NAMES, min_size=1, max_size=4, unique=True))
    topics = {(name, draw(st.integers(0, 3))): draw(topic_tables()) for name in names}
    values = st.one_of(st.integers(-(2**31), 2**31 - 1), st.floats(width=32, allow_nan=False))
    parameters = st.dictionaries(st.from_regex(r"[A-Z][A-Z0-9_]{0,15}", fullmatch=True), values, max_size=4)
    history = ParameterHistory(draw(parameters), [], draw(parameters), draw(parameters))
    return Flight(
        "made", topics, history, info={"sys_name": "PX4", "ver_sw_release": 0x011000FF}, start_timestamp=10**6
    )


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flight=flights())
def test_topics_and_parameters_come_back(tmp_path: Path, flight: Flight) -> None:
    write_ulog(tmp_path / "made.ulg", flight)
    read = read_ulog(tmp_path / "made.ulg")
    assert_same_topics(read, flight)
    assert read.parameters.initial == flight.parameters.initial
    assert read.parameters.default_system == flight.parameters.default_system
    assert read.parameters.default_current_setup == flight.parameters.default_current_setup
    assert read.info == flight.info
    assert read.start_timestamp == flight.start_timestamp
    assert read.corruption == ()


@pytest.fixture
def small_flight() -> Flight:
    time = np.arange(5, dtype=np.int64) * 100_000 + 1_000_000
    topics = {
        ("vehicle_attitude", 0): {
            "timestamp": time,
            "timestamp_sample": time - 500,
            **{f"q[{part}]": np.full(5, part, np.float32) for part in range(4)},
        },
        ("vehicle_status", 0): {"timestamp": time[::2] + 10, "arming_state": np.array([1, 2, 2], np.uint8)},
    }
    parameters = ParameterHistory(
        {"EKF2_EN": 1, "EKF2_GPS_V_NOISE": 0.5},
        [ParameterChange(1_200_010, "EKF2_GPS_V_NOISE", 0.25), ParameterChange(1_300_000, "EKF2_HGT_REF", 2)],
        {"EKF2_GPS_V_NOISE": 0.25},
        {},
    )
    return Flight(
        "small",
        topics,
        parameters,
        info={"sys_name": "PX4", "ver_hw": "PX4_SITL", "ver_sw_release": 0x011000FF},
        multi_info={"boot_console": ["one line", "another"]},
        dropouts=[Dropout(1_200_010, 15)],
        messages=[LoggedMessage(1_150_000, "WARNING", "low battery"), LoggedMessage(1_350_000, "INFO", "Landed – ok")],
        start_timestamp=900_000,
    )


def test_events_come_back_at_their_times(tmp_path: Path, small_flight: Flight) -> None:
    write_ulog(tmp_path / "small.ulg", small_flight)
    read = read_ulog(tmp_path / "small.ulg")
    assert_same_topics(read, small_flight)
    assert read.parameters == small_flight.parameters
    assert read.dropouts == small_flight.dropouts
    assert read.messages == small_flight.messages
    assert read.multi_info == small_flight.multi_info
    assert read.last_timestamp == 1_400_010
    assert read.release == (1, 16, 0)
    assert read.release_name == "v1.16.0"


def test_data_records_are_in_time_order_and_fields_from_large_to_small(tmp_path: Path, small_flight: Flight) -> None:
    small_flight.topics["mixed", 0] = {
        "timestamp": np.array([1_050_000]),
        "flag": np.array([True]),
        "small": np.array([1], np.uint16),
        "large": np.array([1.0]),
        "middle": np.array([1.0], np.float32),
    }
    write_ulog(tmp_path / "small.ulg", small_flight)
    fields = ULog(str(tmp_path / "small.ulg")).message_formats["mixed"].fields
    assert [name for _, _, name in fields] == ["timestamp", "large", "middle", "small", "flag"]
    content = (tmp_path / "small.ulg").read_bytes()
    # record: size, 'D', message id, timestamp; ids follow the alphabet: mixed 0, vehicle_attitude 1, vehicle_status 2
    sizes = {0: 8 + 8 + 4 + 2 + 1, 1: 8 + 8 + 16, 2: 8 + 1}
    position = content.index(b"vehicle_status", content.index(b"A\x00\x02\x00")) + len("vehicle_status")
    times = []
    while position < len(content):
        size, kind = int.from_bytes(content[position : position + 2], "little"), content[position + 2]
        body = content[position + 3 : position + 3 + size]
        if kind == ord("D"):
            assert size == 2 + sizes[int.from_bytes(body[:2], "little")]
            times.append(int.from_bytes(body[2:10], "little"))
        position += 3 + size
    assert len(times) == 1 + 5 + 3
    assert times == sorted(times)


def test_equal_flights_give_equal_bytes(tmp_path: Path, small_flight: Flight) -> None:
    write_ulog(tmp_path / "a.ulg", small_flight)
    small_flight.topics = dict(reversed(small_flight.topics.items()))
    small_flight.parameters.initial = dict(reversed(small_flight.parameters.initial.items()))
    write_ulog(tmp_path / "b.ulg", small_flight)
    assert (tmp_path / "a.ulg").read_bytes() == (tmp_path / "b.ulg").read_bytes()


@pytest.mark.parametrize(
    ("module", "expected"),
    [("info", "vehicle_attitude"), ("params", "EKF2_GPS_V_NOISE,0.5"), ("ulog2csv", "")],
)
def test_the_tools_of_pyulog_read_it(tmp_path: Path, small_flight: Flight, module: str, expected: str) -> None:
    write_ulog(tmp_path / "small.ulg", small_flight)
    command = [sys.executable, "-m", f"pyulog.{module}", "small.ulg"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    if done.returncode == 0 and not done.stdout and not done.stderr:
        # the module has no main guard: call what its console script calls
        code = f"import sys; sys.argv = ['tool', 'small.ulg']; from pyulog.{module} import main; main()"
        done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "corrupt" not in done.stdout.lower()
    assert expected in done.stdout
    if module == "ulog2csv":
        header = (tmp_path / "small_vehicle_attitude_0.csv").read_text().splitlines()[0]
        assert header == "timestamp,timestamp_sample,q[0],q[1],q[2],q[3]"


def test_real_logs_survive_being_written_again(tmp_path: Path, shared_logs: Path) -> None:
    for name in ("JAParedes__TestFlight1", "pypi__sample_appended", "erdemarslan380__sitl_windy"):
        flight = read_ulog(shared_logs / f"{name}.ulg")
        plain = {
            key: {column: values for column, values in table.items() if "." not in column}
            for key, table in flight.topics.items()
        }
        order = {key: np.argsort(table["timestamp"], kind="stable") for key, table in plain.items()}
        sorted_topics = {key: {c: v[order[key]] for c, v in table.items()} for key, table in plain.items()}
        flight = flight.with_topics(sorted_topics)
        write_ulog(tmp_path / "again.ulg", flight)
        again = read_ulog(tmp_path / "again.ulg")
        assert_same_topics(again, flight)
        assert again.parameters == flight.parameters
        assert again.messages == flight.messages


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"value": np.zeros(2)}, "no timestamp"),
        ({"timestamp": np.arange(2), "value": np.zeros(3)}, "expected \\(2,\\)"),
        ({"timestamp": np.arange(2), "value": np.zeros(2, np.complex64)}, "no type"),
        ({"timestamp": np.arange(2), "q[0]": np.zeros(2), "q[2]": np.zeros(2)}, "do not form one array"),
        ({"timestamp": np.arange(2), "esc[0].rpm": np.zeros(2)}, "nested"),
    ],
)
def test_tables_that_ulog_cannot_hold_are_refused(tmp_path: Path, table: dict[str, np.ndarray], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        write_ulog(tmp_path / "bad.ulg", Flight("bad", {("topic", 0): table}))
    assert list(tmp_path.iterdir()) == []
