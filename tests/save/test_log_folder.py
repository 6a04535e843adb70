"""Logs become folders; bad ones become refusals and never errors."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.px4.same_topics import assert_same_topics

from fusetune.errors import UserError
from fusetune.px4.flight import Dropout, Flight, LoggedMessage, ParameterChange, ParameterHistory
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save import VerdictThresholds, load_flight, save_log, write_flights_table
from fusetune.save.discovery import RefusedEntry
from fusetune.save.flights_sheet import FLIGHTS_SHEET
from fusetune.save.log_facts import recorded_at


@pytest.fixture(scope="module")
def log_bytes(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    time = np.arange(2600, dtype=np.int64) * 5000 + 1_000_000
    rows = len(time)
    imu = {"timestamp": time, "gyro_integral_dt": np.full(rows, 5000, np.uint32)}
    imu["accelerometer_integral_dt"] = imu["gyro_integral_dt"]
    for axis in range(3):
        noise = np.random.default_rng(axis).standard_normal(rows)
        imu |= {f"gyro_rad[{axis}]": (0.01 * noise).astype(np.float32)}
        imu |= {f"accelerometer_m_s2[{axis}]": (0.1 * noise - 9.81 * (axis == 2)).astype(np.float32)}
    slow = time[::40]
    gnss = {
        "timestamp": slow,
        "time_utc_usec": (slow + 1_600_000_000_000_000).astype(np.uint64),
        "fix_type": np.full(len(slow), 3, np.uint8),
        "lat": np.full(len(slow), 473977418, np.int32),
        "vel_ned_valid": np.ones(len(slow), bool),
    }
    topics = {
        ("sensor_combined", 0): imu,
        ("vehicle_gps_position", 0): gnss,
        ("vehicle_air_data", 0): {"timestamp": slow, "baro_alt_meter": np.arange(len(slow), dtype=np.float32)},
        ("vehicle_land_detected", 0): {"timestamp": slow[:2], "landed": np.array([True, False])},
    }
    parameters = ParameterHistory(
        {"EKF2_AID_MASK": 1, "EKF2_GPS_V_NOISE": 0.5, "NAN_PARAMETER": float("nan")},
        [ParameterChange(int(slow[3]), "EKF2_GPS_V_NOISE", 0.25)],
        {"EKF2_GPS_V_NOISE": 0.25},
        {"EKF2_AID_MASK": 1},
    )
    flight = Flight(
        "made",
        topics,
        parameters,
        info={"sys_name": "PX4", "ver_hw": "PX4_SITL", "ver_sw_release": 0x010D01FF},
        dropouts=[Dropout(int(slow[2]), 30)],
        messages=[LoggedMessage(int(slow[1]), "INFO", "Takeoff detected")],
        start_timestamp=1_000_000,
    )
    path = tmp_path_factory.mktemp("log") / "made.ulg"
    write_ulog(path, flight)
    return path.read_bytes()


@pytest.fixture
def log(tmp_path: Path, log_bytes: bytes) -> Path:
    (tmp_path / "made.ulg").write_bytes(log_bytes)
    return tmp_path / "made.ulg"


def test_a_log_that_is_not_the_one_that_was_asked_for_is_refused(log: Path, tmp_path: Path) -> None:
    checksum = hashlib.sha256(log.read_bytes()).hexdigest()
    assert save_log(log, tmp_path / "same", shown="card/made.ulg", checksum=checksum).status == "replayable"
    metadata = json.loads((tmp_path / "same" / "metadata.json").read_text(encoding="utf-8"))
    assert (metadata["name"], metadata["file"]) == ("same", "card/made.ulg")
    log.write_bytes(log.read_bytes()[:-1])
    verdict = save_log(log, tmp_path / "other", checksum=checksum)
    assert verdict.reasons == ("the log changed between the start of the run and its reading",)
    assert not list((tmp_path / "other").glob("*.parquet"))


def test_entries_that_could_not_be_saved_are_rows_of_the_table(log: Path, tmp_path: Path) -> None:
    save_log(log, tmp_path / "made")
    entry = RefusedEntry("gone", "card/gone.ulg", "is a link to nothing (x)", "Mend the link or remove it")
    write_flights_table([tmp_path / "made"], tmp_path / "flights.parquet", tmp_path / "flights.csv", [entry])
    rows = pa_csv.read_csv(tmp_path / "flights.csv").to_pylist()
    assert [(row["flight"], row["file"], row["status"]) for row in rows] == [
        ("made", "made.ulg", "replayable"),
        ("gone", "card/gone.ulg", "refused"),
    ]
    assert (rows[1]["reason"], rows[1]["remedy"]) == (entry.reason, entry.remedy)


@pytest.mark.parametrize("name", ["flight_2024-1-31-10-20-30", "2024-01-31_10_20_30", "card_2024-01-31_10_20_30"])
def test_without_gnss_the_date_is_that_of_the_name(name: str) -> None:
    assert recorded_at(Flight(name, {}, ParameterHistory({}, [], {}, {}))) == "2024-01-31T10:20:30Z"


def test_a_disk_that_takes_only_a_part_of_a_table_is_told_of(log: Path, tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    save_log(log, tmp_path / "whole")
    largest = max(file.stat().st_size for file in (tmp_path / "whole").glob("*.parquet"))
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest - 1, usual[1]))
        with pytest.raises(UserError, match="cannot be written: File too large"):
            save_log(log, tmp_path / "saved" / "made")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert list((tmp_path / "saved").iterdir()) == []


def test_flight_comes_back_as_it_was_read(tmp_path: Path, log: Path) -> None:
    assert save_log(log, tmp_path / "saved" / "made").status == "replayable"
    saved, read = load_flight(tmp_path / "saved" / "made"), read_ulog(log)
    assert_same_topics(saved, read)
    assert np.isnan(saved.parameters.initial.pop("NAN_PARAMETER"))
    assert np.isnan(read.parameters.initial.pop("NAN_PARAMETER"))
    assert saved.parameters == read.parameters
    for name in ("info", "multi_info", "dropouts", "messages", "start_timestamp", "checksum", "size_bytes", "release"):
        assert getattr(saved, name) == getattr(read, name), name


def test_only_the_wanted_topics_are_read(tmp_path: Path, log: Path) -> None:
    save_log(log, tmp_path / "made")
    flight = load_flight(tmp_path / "made", topics=("sensor_combined", "vehicle_visual_odometry"))
    assert list(flight.topics) == [("sensor_combined", 0)]


def test_metadata_says_who_when_and_how_long(tmp_path: Path, log: Path) -> None:
    save_log(log, tmp_path / "made")
    metadata = json.loads((tmp_path / "made" / "metadata.json").read_text())
    assert metadata["firmware"] == "v1.13.1"
    assert metadata["hardware"] == {"ver_hw": "PX4_SITL"}
    assert (metadata["vehicle"], metadata["vehicle_kind"], metadata["vehicle_uuid"]) == ("PX4_SITL", "SITL", "")
    assert metadata["recorded"] == "2020-09-13T12:26:41Z"  # 1.6e9 s of Unix time and one second
    assert metadata["duration_s"] == pytest.approx(2599 * 0.005)
    assert metadata["airborne_s"] == pytest.approx(2599 * 0.005 - 0.2)
    assert metadata["ekf2_parameters"]["EKF2_GPS_CTRL"] == 7.0
    assert metadata["ekf2_parameters"]["EKF2_GPS_V_NOISE"] == 0.25
    assert metadata["parameters"]["changed"] == [{"timestamp": 1600000, "name": "EKF2_GPS_V_NOISE", "value": 0.25}]


def test_saving_again_replaces_all_and_gives_equal_bytes(tmp_path: Path, log: Path) -> None:
    save_log(log, tmp_path / "made")
    first = {file.name: file.read_bytes() for file in (tmp_path / "made").iterdir()}
    (tmp_path / "made" / "stray.parquet").write_bytes(b"left by another version")
    save_log(log, tmp_path / "made")
    assert {file.name: file.read_bytes() for file in (tmp_path / "made").iterdir()} == first
    assert sorted(path.name for path in tmp_path.iterdir()) == ["made", "made.ulg"]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b"GIF89a", "is not a ULog file"),
        (b"ULog\x01\x12\x35\x01" + bytes(8), "ends after its header"),
    ],
)
def test_bad_log_becomes_a_refusal(tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "bad.ulg").write_bytes(content)
    verdict = save_log(tmp_path / "bad.ulg", tmp_path / "bad")
    assert verdict.status == "refused"
    assert reason in verdict.reasons[0]
    assert verdict.findings[0].remedy
    with pytest.raises(UserError, match="readable flight"):
        load_flight(tmp_path / "bad")


def test_absent_log_becomes_a_refusal(tmp_path: Path) -> None:
    assert "cannot be opened" in save_log(tmp_path / "absent.ulg", tmp_path / "absent").reasons[0]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(0, 3000), st.integers(0, 255)), max_size=10), cut=st.integers(1, 100_000))
def test_no_damage_raises(tmp_path: Path, log_bytes: bytes, changes: list[tuple[int, int]], cut: int) -> None:
    """Damage of definitions and first data records, and a cut anywhere."""
    damaged = bytearray(log_bytes)
    for position, value in changes:
        damaged[position] = value
    (tmp_path / "damaged.ulg").write_bytes(bytes(damaged[: 16 + cut]))
    verdict = save_log(tmp_path / "damaged.ulg", tmp_path / "damaged")
    assert verdict.status == "replayable" or verdict.reasons
    write_flights_table([tmp_path / "damaged"], tmp_path / "flights.parquet", tmp_path / "flights.csv")


def test_flights_table_keeps_the_given_order(tmp_path: Path, log: Path) -> None:
    (tmp_path / "bad.ulg").write_bytes(b"")
    for name in ("made", "bad"):
        save_log(tmp_path / f"{name}.ulg", tmp_path / name)
    write_flights_table([tmp_path / "made", tmp_path / "bad"], tmp_path / "flights.parquet", tmp_path / "flights.csv")
    rows = pq.read_table(tmp_path / "flights.parquet").to_pylist()
    assert [(row["flight"], row["status"]) for row in rows] == [("made", "replayable"), ("bad", "refused")]
    assert rows[0]["reason"] == ""
    assert rows[1]["reason"] == "the log is empty"
    assert rows[0]["checksum"] == read_ulog(log).checksum
    assert rows[1]["airborne_s"] is None
    csv = pa_csv.read_csv(tmp_path / "flights.csv")
    assert csv.column_names == [column.name for column in FLIGHTS_SHEET]
    assert csv.column("status").to_pylist() == ["replayable", "refused"]


def test_flights_table_names_a_folder_without_verdict(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"verdict\.json"):
        write_flights_table([tmp_path], tmp_path / "flights.parquet", tmp_path / "flights.csv")
    assert not (tmp_path / "flights.parquet").exists()


def test_copies_of_a_log_are_refused_whatever_the_order(tmp_path: Path, log: Path) -> None:
    (tmp_path / "other.ulg").write_bytes(log.read_bytes() + b"\0")
    (tmp_path / "copy.ulg").write_bytes(log.read_bytes())
    names = ("made", "copy", "other")
    for name in names:
        save_log(tmp_path / f"{name}.ulg", tmp_path / name)
    for order in (names, names[::-1]):
        folders = [tmp_path / name for name in order]
        write_flights_table(folders, tmp_path / "flights.parquet", tmp_path / "flights.csv")
        rows = {row["flight"]: row for row in pq.read_table(tmp_path / "flights.parquet").to_pylist()}
        assert list(rows) == list(order)
        assert [rows[name]["status"] for name in names] == ["refused", "replayable", "replayable"]
        assert "is the same log as copy" in rows["made"]["reason"]
        assert rows["made"]["checks"].endswith("duplicate fail")
        assert rows["copy"]["checks"].endswith("duplicate pass")


def test_all_checks_are_in_metadata_and_table(tmp_path: Path, log: Path) -> None:
    verdict = save_log(log, tmp_path / "made")
    metadata = json.loads((tmp_path / "made" / "metadata.json").read_text())
    assert metadata["verdict"] == verdict.document()
    write_flights_table([tmp_path / "made"], tmp_path / "flights.parquet", tmp_path / "flights.csv")
    (row,) = pq.read_table(tmp_path / "flights.parquet").to_pylist()
    for check in verdict.findings:
        assert f"{check.id} {check.severity}" in row["checks"]


def test_remedies_of_what_did_not_pass_are_in_the_table(tmp_path: Path, log: Path) -> None:
    verdict = save_log(log, tmp_path / "made")
    (tmp_path / "bad.ulg").write_bytes(b"")
    refused = save_log(tmp_path / "bad.ulg", tmp_path / "bad")
    write_flights_table([tmp_path / "made", tmp_path / "bad"], tmp_path / "flights.parquet", tmp_path / "flights.csv")
    rows = pq.read_table(tmp_path / "flights.parquet").to_pylist()
    for row, told in zip(rows, (verdict, refused), strict=True):
        expected = {check.id: check.remedy for check in told.findings if check.severity in ("warning", "fail")}
        assert {one["id"]: one["remedy"] for one in row["advice"]} == expected
    assert rows[0]["advice"]


def test_thresholds_decide(tmp_path: Path, log: Path) -> None:
    strict = VerdictThresholds(min_imu_duration_s=60.0)
    assert "at least 60 s" in save_log(log, tmp_path / "made", strict).reasons[0]


@pytest.mark.parametrize("name", ["metadata.json", "sensor_combined_0.parquet"])
def test_a_file_of_a_saved_flight_that_is_damaged_or_gone_asks_for_a_new_folder(
    tmp_path: Path, log: Path, name: str
) -> None:
    """The pipeline sees the folder only, so taking away one file in it would not make it anew."""
    folder = tmp_path / "made"
    save_log(log, folder)
    content = bytearray((folder / name).read_bytes())
    content[40] ^= 1
    (folder / name).write_bytes(content)
    for _ in range(2):
        with pytest.raises(UserError) as raised:
            load_flight(folder)
        assert Path(raised.value.file) == folder / name
        assert f"Delete the whole folder {folder} and" in str(raised.value)
        (folder / name).unlink(missing_ok=True)


def test_names_and_hardware_are_no_formulas_in_the_table_of_flights(tmp_path: Path, log_bytes: bytes) -> None:
    name, hardware = "=1+1", b"@SUM(A1)"
    (tmp_path / f"{name}.ulg").write_bytes(log_bytes.replace(b"PX4_SITL", hardware))
    save_log(tmp_path / f"{name}.ulg", tmp_path / name)
    write_flights_table([tmp_path / name], tmp_path / "flights.parquet", tmp_path / "flights.csv")
    row = pa_csv.read_csv(tmp_path / "flights.csv").to_pylist()[0]
    assert (row["flight"], row["vehicle_hardware"]) == (f"'{name}", f"'{hardware.decode()}")
    assert row["duration_s"] == pytest.approx(12.995)
    kept = pq.read_table(tmp_path / "flights.parquet").to_pylist()[0]
    assert (kept["flight"], kept["hardware"]) == (name, hardware.decode())
