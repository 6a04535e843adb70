"""Logs of every release are replayable; those that are cut, appended to, strange or empty end as they should."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from fusetune.ekf2.releases.behaviours import MODELLED
from fusetune.finding import Finding
from fusetune.px4.flight import Flight, ParameterHistory, TopicKey, TopicTable
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.releases import READ, name_of
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save import load_flight, save_log
from fusetune.save.verdict import Verdict

FIRST_US, SECONDS, IMU_HZ, SLOW_HZ = 5_000_000, 12, 200, 20
TIME = FIRST_US + np.arange(SECONDS * IMU_HZ, dtype=np.int64) * 5_000
SLOW = TIME[:: IMU_HZ // SLOW_HZ] + 300
GNSS_IN_DEGREES, SAMPLE_TIMES, AT_REST, FLAGS_TOPIC = (1, 15), (1, 12), (1, 13), (1, 12)
"""Releases from which the messages have these."""


def constant(value: float, dtype: type = np.float32, rows: int = len(SLOW)) -> np.ndarray:
    return np.full(rows, value, dtype)


def living(value: float, dtype: type = np.float32, rows: int = len(SLOW), *, within: float = 0.01) -> np.ndarray:
    """What a sensor says of something that stands still: no two samples are the same."""
    return (value + within * np.random.default_rng(0).uniform(-1.0, 1.0, rows)).astype(dtype)


def imu() -> TopicTable:
    rows = len(TIME)
    values = {f"gyro_rad[{axis}]": living(0.01, rows=rows) for axis in range(3)}
    values |= {f"accelerometer_m_s2[{axis}]": living(-9.81 * (axis == 2), rows=rows) for axis in range(3)}
    step = constant(5_000, np.uint32, rows)
    return {"timestamp": TIME, **values, "gyro_integral_dt": step, "accelerometer_integral_dt": step}


def gnss(release: tuple[int, int]) -> TopicTable:
    """Position in 1e-7 degrees and mm before v1.15, in degrees and m since."""
    if release < GNSS_IN_DEGREES:
        place = {
            "lat": living(473977420, np.int32, within=5.0),
            "lon": living(85455940, np.int32, within=5.0),
            "alt": constant(488_000, np.int32),
        }
    else:
        place = {
            "latitude_deg": living(47.397742, np.float64, within=5e-7),
            "longitude_deg": living(8.545594, np.float64, within=5e-7),
            "altitude_msl_m": constant(488.0, np.float64),
        }
    accuracy = {"eph": constant(0.8), "epv": constant(1.2), "s_variance_m_s": constant(0.2)}
    velocity = {f"vel_{axis}_m_s": living(0.0) for axis in "ned"}
    fix = {"fix_type": constant(3, np.uint8), "satellites_used": constant(12, np.uint8)}
    return {"timestamp": SLOW, **fix, **place, **accuracy, **velocity}


def topics_of(release: tuple[int, int]) -> dict[TopicKey, TopicTable]:
    """What the default of a release logs of an aided flight, as far as the layouts differ."""
    sampled = {"timestamp_sample": SLOW - 150} if release >= SAMPLE_TIMES else {}
    land = {"timestamp": SLOW[[0, SLOW_HZ]], "landed": np.array([True, False])}
    if release >= AT_REST:
        land["at_rest"] = np.array([True, False])
    status: TopicTable = {"timestamp": SLOW[::10], "arming_state": constant(2, np.uint8, len(SLOW[::10]))}
    kind = ("is_rotary_wing", np.bool_) if release < (1, 9) else ("vehicle_type", np.uint8)
    status[kind[0]] = constant(1, kind[1], len(SLOW[::10]))
    flags = constant(1 << 2 | 1 << 11, np.uint32)  # GNSS aiding and GNSS height
    topics: dict[TopicKey, TopicTable] = {
        ("sensor_combined", 0): imu(),
        ("vehicle_gps_position", 0): gnss(release),
        ("vehicle_magnetometer", 0): {
            "timestamp": SLOW,
            **sampled,
            **{f"magnetometer_ga[{axis}]": living(0.2) for axis in range(3)},
        },
        ("vehicle_air_data", 0): {"timestamp": SLOW, **sampled, "baro_alt_meter": living(488.0)},
        ("vehicle_land_detected", 0): land,
        ("vehicle_status", 0): status,
        ("estimator_status", 0): {"timestamp": SLOW, "control_mode_flags": flags},
    }
    if release >= FLAGS_TOPIC:
        name = "cs_gps" if release < GNSS_IN_DEGREES else "cs_gnss_pos"
        topics["estimator_status_flags", 0] = {"timestamp": SLOW, name: constant(1, np.bool_)}
    return topics


def flight_of(release: tuple[int, int]) -> Flight:
    version = release[0] << 24 | release[1] << 16 | 255
    aiding = {"EKF2_AID_MASK": 1} if release < (1, 14) else {"EKF2_GPS_CTRL": 7}
    history = ParameterHistory({**aiding, "EKF2_GPS_V_NOISE": 0.3})
    return Flight("old", topics_of(release), history, info={"ver_sw_release": version}, start_timestamp=FIRST_US)


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A sound log of v1.16."""
    path = tmp_path_factory.mktemp("sound") / "sound.ulg"
    write_ulog(path, flight_of((1, 16)))
    return path.read_bytes()


def saved(tmp_path: Path, content: bytes) -> Verdict:
    (tmp_path / "log.ulg").write_bytes(content)
    return save_log(tmp_path / "log.ulg", tmp_path / "log")


def check_of(verdict: Verdict, name: str) -> Finding:
    return next(check for check in verdict.findings if check.id == name)


def data_begin(content: bytes) -> int:
    """Where the first data record begins."""
    position = 16
    while content[position + 2] != ord("D"):
        position += 3 + int.from_bytes(content[position : position + 2], "little")
    return position


def record(kind: bytes, payload: bytes) -> bytes:
    return struct.pack("<H", len(payload)) + kind + payload


@pytest.mark.parametrize("release", READ, ids=name_of)
def test_every_release_is_replayable_and_means_the_same(tmp_path: Path, release: tuple[int, int]) -> None:
    write_ulog(tmp_path / "old.ulg", flight_of(release))
    verdict = save_log(tmp_path / "old.ulg", tmp_path / "old")
    assert verdict.status == "replayable", verdict.reasons
    for name in ("magnetometer", "barometer", "gnss", "gnss_fix", "imu_coverage", "sensor_values", "definitions"):
        assert check_of(verdict, name).severity == "pass", (name, check_of(verdict, name).found)
    assert "aiding by GNSS" in check_of(verdict, "horizontal_aid").found
    assert check_of(verdict, "firmware").severity == ("pass" if name_of(release) in MODELLED else "warning")
    assert check_of(verdict, "airborne").figure == pytest.approx(SECONDS - 1.0, abs=0.01)
    flight = canonical(load_flight(tmp_path / "old"))
    gnss_table = flight.topics["vehicle_gps_position", 0]
    np.testing.assert_allclose(gnss_table["latitude_deg"], 47.397742, atol=6e-7)
    np.testing.assert_allclose(gnss_table["altitude_msl_m"], 488.0)
    assert flight.topics["vehicle_status", 0]["vehicle_type"].tolist()[0] == 1
    assert flight.topics["vehicle_land_detected", 0]["at_rest"].tolist() == [True, False]
    assert flight.topics["estimator_status_flags", 0]["cs_gnss_pos"].all()
    expected = SLOW - 150 if release >= SAMPLE_TIMES else SLOW
    np.testing.assert_array_equal(flight.topics["vehicle_air_data", 0]["timestamp_sample"], expected)


def test_file_that_is_cut_keeps_what_came_before_and_names_the_cut(tmp_path: Path, content: bytes) -> None:
    cut = len(content) - 20_003
    position = data_begin(content)
    while (end := position + 3 + int.from_bytes(content[position : position + 2], "little")) <= cut:
        position = end
    verdict = saved(tmp_path, content[:cut])
    check = check_of(verdict, "readable")
    assert check.severity == "warning"
    assert f"breaks off within a record, at byte {position} of {cut}" in check.found
    whole, kept = imu()["timestamp"], load_flight(tmp_path / "log").topics["sensor_combined", 0]["timestamp"]
    np.testing.assert_array_equal(kept, whole[: len(kept)])
    assert 0.8 * len(whole) < len(kept) < len(whole)


def test_file_that_is_cut_in_its_definitions_is_refused(tmp_path: Path, content: bytes) -> None:
    verdict = saved(tmp_path, content[: data_begin(content) // 2])
    assert verdict.reasons == ("the log holds no message that can be read",)


def test_every_cut_of_the_head_ends_in_a_verdict(tmp_path: Path, content: bytes) -> None:
    for cut in range(0, data_begin(content), 97):
        assert saved(tmp_path, content[:cut]).status == "refused"


def test_data_appended_after_a_crash_are_read(tmp_path: Path, content: bytes) -> None:
    """The recording ends within a record; behind it a text was appended, which the flag bits tell the place of."""
    text = record(b"L", b"3" + struct.pack("<Q", 17_000_000) + b"hard fault")
    flags = bytearray(record(b"B", bytes(40)))
    flags[3 + 8] = 1  # data appended
    flags[3 + 16 : 3 + 24] = len(content[:-7]).to_bytes(8, "little")
    appended = content[:16] + bytes(flags) + content[16 + len(flags) : -7] + text
    assert content[16 : 16 + 3] == bytes(flags[:3])
    verdict = saved(tmp_path, appended)
    assert verdict.status == "replayable"
    flight = load_flight(tmp_path / "log")
    assert ("ERROR", "hard fault") in [(message.level, message.text) for message in flight.messages]
    assert len(flight.topics["sensor_combined", 0]["timestamp"]) >= len(TIME) - 1
    assert "breaks off within a record" in check_of(verdict, "readable").found


def test_places_of_appended_data_that_cannot_be_are_no_harm(tmp_path: Path, content: bytes) -> None:
    flags = bytearray(content[16 : 16 + 43])
    flags[3 + 8] = 1
    flags[3 + 16 : 3 + 24] = (1 << 60).to_bytes(8, "little")
    verdict = saved(tmp_path, content[:16] + bytes(flags) + content[16 + 43 :])
    assert verdict.status == "replayable"
    assert "places of appended data" in check_of(verdict, "readable").found


def test_unknown_features_of_the_format_are_refused(tmp_path: Path, content: bytes) -> None:
    flags = bytearray(content[16 : 16 + 43])
    flags[3 + 8] = 4
    verdict = saved(tmp_path, content[:16] + bytes(flags) + content[16 + 43 :])
    assert "needs unknown features" in verdict.reasons[0]


def test_unknown_message_ids_and_kinds_of_records_are_passed_over(tmp_path: Path, content: bytes) -> None:
    begin = data_begin(content)
    strange = record(b"D", struct.pack("<HQ", 999, 6_000_000)) * 5 + record(b"Z", b"from the future")
    verdict = saved(tmp_path, content[:begin] + strange + content[begin:])
    assert verdict.status == "replayable"
    assert "message ids that the log does not define (999)" in check_of(verdict, "readable").found
    assert "1 record of unknown kind" in check_of(verdict, "readable").found
    assert len(load_flight(tmp_path / "log").topics["sensor_combined", 0]["timestamp"]) == len(TIME)


@pytest.mark.parametrize("name", [b"vehicle_air_data:", b"vehicle_gps_position:"])
def test_definition_whose_name_is_not_utf8_costs_its_topic_alone(tmp_path: Path, content: bytes, name: bytes) -> None:
    broken = content.replace(name, b"\xff\xfe" + name[2:], 1)
    assert len(broken) == len(content)
    verdict = saved(tmp_path, broken)
    assert name[:-1].decode() in check_of(verdict, "definitions").found
    topics = load_flight(tmp_path / "log").topics
    assert (name[:-1].decode(), 0) not in topics
    assert len(topics["sensor_combined", 0]["timestamp"]) == len(TIME)


def test_texts_and_values_that_are_not_utf8_are_kept_as_far_as_they_are(tmp_path: Path, content: bytes) -> None:
    key = b"char[4] sys_name"
    info = record(b"I", bytes([len(key)]) + key + b"PX\xff4")
    begin = data_begin(content)
    verdict = saved(tmp_path, content[:begin] + info + content[begin:])
    assert verdict.status == "replayable"
    assert load_flight(tmp_path / "log").info["sys_name"] == "PX4"


@pytest.mark.parametrize("topic", ["../../escape", "a/b", "", "x" * 300])
def test_topic_names_that_are_no_file_names_are_passed_over(tmp_path: Path, content: bytes, topic: str) -> None:
    begin = data_begin(content)
    strange = record(b"F", f"{topic}:uint64_t timestamp;".encode())
    strange += record(b"A", struct.pack("<BH", 0, 500) + topic.encode())
    strange += record(b"D", struct.pack("<HQ", 500, 6_000_000))
    assert saved(tmp_path, content[:begin] + strange + content[begin:]).status == "replayable"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log", "log.ulg"]
    assert len(load_flight(tmp_path / "log").topics) == len(topics_of((1, 16)))


@pytest.mark.parametrize(
    "definition",
    ["a:uint64_t timestamp;a[100] inner;", "a:uint64_t timestamp;float[65535] x;", "a:uint64_t timestamp;b x;"],
    ids=["nested in itself", "larger than any record", "undefined part"],
)
def test_absurd_definitions_cost_neither_time_nor_memory(tmp_path: Path, content: bytes, definition: str) -> None:
    begin = data_begin(content)
    strange = record(b"F", definition.encode()) + record(b"A", struct.pack("<BH", 0, 500) + b"a")
    strange += record(b"D", struct.pack("<HQ", 500, 6_000_000))
    verdict = saved(tmp_path, content[:begin] + strange + content[begin:])
    assert verdict.status == "replayable"
    assert "lacks the message definitions of a" in check_of(verdict, "definitions").found


def test_single_time_stamps_that_cannot_be_cost_their_messages_alone(tmp_path: Path, content: bytes) -> None:
    begin = data_begin(content)
    damaged = bytearray(content)
    places = []
    while begin < len(content):
        size = int.from_bytes(content[begin : begin + 2], "little")
        places.append(begin)
        begin += 3 + size
    for place, time in zip(places[500:2000:300], (0, 1 << 40, 1 << 63, (1 << 64) - 1, 7), strict=True):
        damaged[place + 5 : place + 13] = time.to_bytes(8, "little")
    verdict = saved(tmp_path, bytes(damaged))
    assert verdict.status == "replayable"
    assert check_of(verdict, "time_stamps").severity == "warning"
    flight = load_flight(tmp_path / "log")
    assert sum(entry.rows for entry in flight.left_out) == 5
    assert all(np.all(np.diff(table["timestamp"]) >= 0) for table in flight.topics.values())
    assert flight.last_timestamp == max(TIME[-1], SLOW[-1])


def test_log_with_ground_time_only_is_replayable_with_a_warning(tmp_path: Path) -> None:
    flight = flight_of((1, 16))
    flight.topics["vehicle_land_detected", 0] = {"timestamp": SLOW[:1], "landed": np.array([True])}
    write_ulog(tmp_path / "log.ulg", flight)
    verdict = save_log(tmp_path / "log.ulg", tmp_path / "log")
    assert verdict.status == "replayable"
    assert check_of(verdict, "airborne").found == "never airborne"
    assert check_of(verdict, "log_start").severity == "does-not-apply"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b"\x89PNG\r\n\x1a\n" + bytes(500), "is not a ULog file"),
        (b"<html>404 not found</html>", "is not a ULog file"),
        (b"ULog\x01\x12\x35\x01" + bytes(8), "ends after its header"),
        (b"ULog\x01\x12\x35\x01" + bytes(8) + bytes(5000), "holds no message"),
        (b"ULog\x01\x12\x35\x01" + bytes(8) + b"F" * 200_000, "holds no message"),
    ],
    ids=["empty", "picture", "web page", "header", "zeros", "one letter"],
)
def test_what_is_no_log_is_refused_with_its_reason(tmp_path: Path, content: bytes, reason: str) -> None:
    verdict = saved(tmp_path, content)
    assert verdict.status == "refused"
    assert reason in verdict.reasons[0]
    assert verdict.findings[0].remedy


def test_long_rubbish_in_a_log_is_passed_over(tmp_path: Path, content: bytes) -> None:
    """Two megabytes that are no records, in the middle."""
    rubbish = np.random.default_rng(1).integers(0, 256, 2_000_000, np.uint8).tobytes()
    middle = data_begin(content) + 43_210
    verdict = saved(tmp_path, content[:middle] + rubbish + content[middle:])
    assert verdict.status == "replayable"
    assert "are no records and were left out" in check_of(verdict, "readable").found
    kept = load_flight(tmp_path / "log").topics["sensor_combined", 0]["timestamp"]
    # the record in which the rubbish lies is lost, and with it at most the few behind it that rubbish looked like
    assert len(kept) > len(TIME) - 20


def test_log_of_an_hour_is_read_as_a_whole(tmp_path: Path) -> None:
    """720 000 IMU samples, 30 MB."""
    flight = flight_of((1, 16))
    rows = 3600 * IMU_HZ
    time = FIRST_US + np.arange(rows, dtype=np.int64) * 5_000
    flight.topics["sensor_combined", 0] = {
        name: time if name == "timestamp" else np.full(rows, values[0]) for name, values in imu().items()
    }
    flight.topics = {key: table for key, table in flight.topics.items() if key[0] != "estimator_status"}
    write_ulog(tmp_path / "log.ulg", flight)
    read = read_ulog(tmp_path / "log.ulg")
    np.testing.assert_array_equal(read.topics["sensor_combined", 0]["timestamp"], time)
    assert read.corruption == ()


@pytest.mark.parametrize(
    ("name", "status", "said"),
    [
        ("pypi__sample_appended", "replayable", "breaks off within a record"),
        ("Auterion__corrupt_unregistered_msg_id", "replayable", "32812"),
        ("Auterion__corrupt_format_not_utf8", "refused", "no records"),
    ],
)
def test_shared_logs_with_damage(tmp_path: Path, shared_logs: Path, name: str, status: str, said: str) -> None:
    verdict = save_log(shared_logs / f"{name}.ulg", tmp_path / name)
    assert verdict.status == status
    assert said in check_of(verdict, "readable").found


@pytest.mark.parametrize(
    "stamps",
    [np.zeros_like(TIME), TIME[::-1], TIME + 1_700_000_000_000_000, TIME - FIRST_US],
    ids=["none", "backward", "unix", "another clock"],
)
def test_a_topic_of_another_time_that_outnumbers_the_imu_costs_at_most_itself(
    tmp_path: Path, stamps: np.ndarray
) -> None:
    """As `sensor_preflight` of v1.5 and v1.6, which has more rows than the IMU and no time stamps."""
    flight = flight_of((1, 16))
    write_ulog(tmp_path / "sound.ulg", flight)
    more = np.append(stamps, stamps[-2:])
    flight.topics["sensor_preflight", 0] = {"timestamp": more, "accel": constant(0.0, rows=len(more))}
    content = with_messages_at(tmp_path, flight, "sensor_preflight", np.append(TIME, TIME[-2:]))
    verdict = saved(tmp_path, content)
    assert verdict.status == "replayable", verdict.reasons
    found, expected = load_flight(tmp_path / "log"), read_ulog(tmp_path / "sound.ulg")
    assert (found.start_timestamp, found.last_timestamp) == (expected.start_timestamp, expected.last_timestamp)
    assert {entry.topic for entry in found.left_out} <= {"sensor_preflight"}
    for key, table in expected.topics.items():
        for name, values in table.items():
            np.testing.assert_array_equal(found.topics[key][name], values)
    document = json.loads((tmp_path / "log" / "metadata.json").read_text(encoding="utf-8"))
    assert document["duration_s"] == pytest.approx(SECONDS, abs=0.01)


def with_messages_at(folder: Path, flight: Flight, topic: str, times: np.ndarray) -> bytes:
    """The bytes of a flight whose messages of a topic lie in the file where other times would put them."""
    table = flight.topics[topic, 0]
    stamps = table["timestamp"].copy()
    table["timestamp"] = np.sort(times)
    write_ulog(folder / "placed.ulg", flight)
    content = bytearray((folder / "placed.ulg").read_bytes())
    message_id = sorted(flight.topics).index((topic, 0))
    position, row = data_begin(bytes(content)), 0
    while position < len(content):
        if (
            content[position + 2] == ord("D")
            and int.from_bytes(content[position + 3 : position + 5], "little") == message_id
        ):
            content[position + 5 : position + 13] = int(stamps[row]).to_bytes(8, "little")
            row += 1
        position += 3 + int.from_bytes(content[position : position + 2], "little")
    assert row == len(stamps)
    return bytes(content)


def test_a_sensor_by_another_clock_is_left_out(tmp_path: Path) -> None:
    flight = flight_of((1, 16))
    table = flight.topics["vehicle_magnetometer", 0]
    table["timestamp"] = table["timestamp"] // 1000  # milliseconds
    verdict = saved(tmp_path, with_messages_at(tmp_path, flight, "vehicle_magnetometer", SLOW))
    assert "240 of vehicle_magnetometer: time stamps of another clock" in check_of(verdict, "time_stamps").found
    assert check_of(verdict, "magnetometer").severity == "warning"
    assert verdict.status == "replayable"


def test_a_log_without_imu_samples_has_its_own_duration(tmp_path: Path) -> None:
    flight = flight_of((1, 16))
    del flight.topics["sensor_combined", 0]
    write_ulog(tmp_path / "log.ulg", flight)
    assert save_log(tmp_path / "log.ulg", tmp_path / "log").status == "refused"
    document = json.loads((tmp_path / "log" / "metadata.json").read_text(encoding="utf-8"))
    assert document["duration_s"] == pytest.approx(SECONDS, abs=0.1)
