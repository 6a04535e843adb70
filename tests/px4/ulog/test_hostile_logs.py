"""Small files that ask for much: each is read, or refused, within what a log may ask for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.ulog_parts import HEADER_BYTES, data, definition, key_value, parameter, record, subscription

from fusetune.errors import UserError
from fusetune.px4.flight import Flight
from fusetune.px4.ulog.definitions import Definitions
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.ulog.reading_limits import ReadingLimits
from fusetune.px4.ulog.used_topics import is_used
from fusetune.save import save_log
from fusetune.time_limit import Deadline, TimeLimitError

HEADER = b"ULog\x01\x12\x35\x01" + (1_000_000).to_bytes(8, "little")
SOUND = definition("sound", "uint64_t timestamp;uint8_t a;")


def read(folder: Path, *records: bytes, limits: ReadingLimits | None = None) -> Flight:
    content = HEADER + b"".join(records)
    assert len(HEADER) == HEADER_BYTES
    (folder / "hostile.ulg").write_bytes(content)
    return read_ulog(folder / "hostile.ulg", limits)


def with_sound_topic(folder: Path, definitions: list[bytes], topic: str, rest: bytes = b"") -> Flight:
    records = [*definitions, SOUND, subscription(1, topic), subscription(2, "sound")]
    return read(folder, *records, data(1, 1_000_000, rest), data(2, 1_000_001, b"\7"))


EMPTY = [definition("empty", ""), *(definition(f"e{n}", f"e{n - 1}[99999] a;") for n in range(7, 0, -1))]


@pytest.mark.parametrize(
    "fields",
    ["e6[99999] a;", "e6 a;e6 b;", "empty[99999] a;empty[99999] b;", "e3[99999] a;uint8_t c;"],
)
def test_nested_definitions_without_fields_cost_nothing(tmp_path: Path, fields: str) -> None:
    definitions = [*EMPTY, definition("e0", "empty[99999] a;"), definition("deep", f"uint64_t timestamp;{fields}")]
    columns = {"timestamp", "c"} if "c;" in fields else {"timestamp"}
    flight = with_sound_topic(tmp_path, definitions, "deep", bytes(len(columns) - 1))
    assert set(flight.topics["deep", 0]) == columns
    assert ("sound", 0) in flight.topics


@pytest.mark.parametrize(
    "definitions",
    [
        [definition("deep", "uint64_t timestamp;deep a;")],
        [definition("deep", "uint64_t timestamp;other[9] a;"), definition("other", "deep[9] a;")],
        [
            definition("deep", "uint64_t timestamp;link0 a;"),
            *(definition(f"link{n}", f"link{n + 1} a;") for n in range(9999)),
        ],
        [definition("deep", "uint64_t timestamp;uint8_t[2000000000] a;")],
        [definition("deep", "uint64_t timestamp;uint8_t[99999] a;")],
        [definition("deep", "uint64_t timestamp;row[4096] a;"), definition("row", "uint8_t[63] a;")],
        [definition("deep", "uint64_t timestamp;float a;float a;")],
        [definition("deep", "uint64_t timestamp;nowhere a;")],
        [definition("deep", "float timestamp;")],
    ],
    ids=["itself", "ring", "chain", "two milliards", "too long", "too wide", "twice", "undefined", "no time stamp"],
)
def test_definitions_that_cannot_be_cost_their_topic_alone(tmp_path: Path, definitions: list[bytes]) -> None:
    flight = with_sound_topic(tmp_path, definitions, "deep")
    assert set(flight.topics) == {("sound", 0)}
    assert flight.undefined_topics == ("deep",)
    assert flight.topics["sound", 0]["a"].tolist() == [7]


def test_sizes_are_those_of_the_columns() -> None:
    """Nested arrays counted by hand: 8 + 2 * (3 * 4 + 2) + 1 bytes of data, 2 of padding."""
    definitions = Definitions()
    for text in (
        b"m:uint64_t timestamp;p[2] p;uint8_t c;uint8_t[2] _padding0;",
        b"p:float[3] x;q q;",
        b"q:uint16_t y;",
    ):
        definitions.add(text)
    size = definitions.size("m")
    assert (size.size, size.columns, size.depth) == (8 + 2 * 14 + 1 + 2, 1 + 2 * 4 + 1 + 2, 2)
    assert definitions.padding("m") == 2
    names = definitions.layout("m").dtype.names
    assert names is not None
    assert names[1:5] == ("p[0].x[0]", "p[0].x[1]", "p[0].x[2]", "p[0].q.y")
    assert definitions.layout("m").dtype.itemsize == size.size - 2


def test_nesting_may_be_as_deep_whatever_is_asked_for_first() -> None:
    for first in ("d0", "d4"):
        definitions = Definitions()
        for level in range(10):
            definitions.add(f"d{level}:{'uint64_t timestamp;' if level < 2 else ''}d{level + 1} a;".encode())
        definitions.add(b"d10:float b;")
        if first == "d4":
            assert definitions.size("d4").depth == 6
        with pytest.raises(ValueError, match="nested"):
            definitions.size("d0")
        assert definitions.size("d2").depth == 8


def test_thousands_of_topics_leave_those_that_are_used(tmp_path: Path) -> None:
    records = []
    for number in range(3000):
        records += [definition(f"t{number}", "uint64_t timestamp;uint8_t a;"), subscription(10 + number, f"t{number}")]
        records.append(data(10 + number, 1_000_000 + number, b"\1"))
    used = [definition("vehicle_air_data", "uint64_t timestamp;float baro_alt_meter;")]
    used += [subscription(5, "vehicle_air_data"), data(5, 1_000_000, bytes(4))]
    flight = read(tmp_path, *records, *used)
    assert set(flight.topics) == {("vehicle_air_data", 0)}
    assert len(flight.beyond_limits) == 3000
    verdict = save_log(tmp_path / "hostile.ulg", tmp_path / "saved")
    check = next(check for check in verdict.findings if check.id == "tables")
    assert (check.severity, check.figure) == ("warning", 3000.0)
    assert "3000 of them did not become tables" in check.found


def test_wide_instances_are_bounded_by_columns(tmp_path: Path) -> None:
    """Half a megabyte of used topics with 3,781 columns each: 8 fit into 30,000 columns less one."""
    records = [definition("part", "uint8_t[63] a;"), definition("estimator_wide", "uint64_t timestamp;part[60] p;")]
    for instance in range(120):
        records.append(subscription(instance, "estimator_wide", instance))
        records.append(data(instance, 1_000_000 + instance, bytes(60 * 63)))
    flight = read(tmp_path, *records)
    assert sorted(flight.topics) == [("estimator_wide", instance) for instance in range(30_000 // 3781)]
    assert flight.beyond_limits == ("estimator_wide",)
    save_log(tmp_path / "hostile.ulg", tmp_path / "saved")
    written = sum(file.stat().st_size for file in (tmp_path / "saved").iterdir())
    assert written < 10 * (tmp_path / "hostile.ulg").stat().st_size


def test_a_log_within_the_limits_keeps_all(tmp_path: Path) -> None:
    limits = ReadingLimits(max_tables=1, max_columns=2)
    records = (SOUND, subscription(2, "sound"), data(2, 1_000_001, b"\7"))
    assert read(tmp_path, *records, limits=limits).beyond_limits == ()
    more = definition("estimator_a", "uint64_t timestamp;"), subscription(3, "estimator_a"), data(3, 1_000_001)
    assert set(read(tmp_path, *records, *more, limits=limits).topics) == {("estimator_a", 0)}
    with pytest.raises(UserError, match="too many topics, and none that is used"):
        read(tmp_path, *records, SOUND, subscription(4, "sound", 1), data(4, 1_000_001, b"\7"), limits=limits)


def test_one_topic_under_thousands_of_message_ids(tmp_path: Path) -> None:
    records = [SOUND]
    for number in range(5000):
        records += [subscription(number, "sound"), data(number, 1_000_000 + number, bytes([number % 256]))]
    table = read(tmp_path, *records).topics["sound", 0]
    np.testing.assert_array_equal(table["timestamp"], 1_000_000 + np.arange(5000))


def test_tens_of_thousands_of_records_of_each_kind(tmp_path: Path) -> None:
    records = [SOUND, subscription(2, "sound")]
    for number in range(5000):
        records += [
            key_value("I", f"uint32_t key{number}", bytes(4)),
            key_value("M", "char[4] perf", b"line", b"\1"),
            parameter(f"P{number % 7}", number),
            record("O", b"\1\0"),
            record("L", b"6" + bytes(8) + b"text"),
            record("D", b"")[:3],
            data(2, 1_000_000 + number, b"\1"),
        ]
    flight = read(tmp_path, *records)
    assert len(flight.topics["sound", 0]["a"]) == len(flight.dropouts) == len(flight.messages) == 5000
    assert flight.multi_info["perf"] == ["line" * 5000]
    # the first parameter comes before the first datum, so it is none of the changes
    assert flight.parameters.changed[-1].timestamp == 1_000_000 + 4998


def test_work_that_takes_too_long_is_refused_and_leaves_no_tables(tmp_path: Path) -> None:
    records = [SOUND, subscription(2, "sound"), *(data(2, 1_000_000 + number, b"\1") for number in range(100))]
    (tmp_path / "slow.ulg").write_bytes(HEADER + b"".join(records))
    limits = ReadingLimits(time_limit_s=1e-9)
    with pytest.raises(UserError, match=r"slow\.ulg: takes longer than 1e-09 s.*reading\.time_limit_s"):
        read_ulog(tmp_path / "slow.ulg", limits)
    verdict = save_log(tmp_path / "slow.ulg", tmp_path / "slow", limits=limits)
    assert verdict.status == "refused"
    assert "takes longer than" in verdict.reasons[0]
    assert sorted(file.name for file in (tmp_path / "slow").iterdir()) == ["metadata.json", "verdict.json"]


def test_time_that_ends_while_tables_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    records = [SOUND, definition("other", "uint64_t timestamp;"), subscription(1, "other"), subscription(2, "sound")]
    (tmp_path / "slow.ulg").write_bytes(HEADER + b"".join([*records, data(1, 1_000_000), data(2, 1_000_000, b"\1")]))
    calls = iter(range(10**6))

    def check_tables_only(self: Deadline) -> None:
        if (tmp_path / ".slow.partial" / "other_0.parquet").exists() and next(calls) == 0:
            raise TimeLimitError("over")

    monkeypatch.setattr(Deadline, "check", check_tables_only)
    assert save_log(tmp_path / "slow.ulg", tmp_path / "slow").status == "refused"
    assert next(calls) > 0
    assert sorted(file.name for file in (tmp_path / "slow").iterdir()) == ["metadata.json", "verdict.json"]


def test_no_limit_is_no_limit() -> None:
    Deadline(0).check()
    Deadline().check()


def test_what_later_rooms_read_is_kept() -> None:
    from fusetune.analyze.analyze_flight import COMPARED_TOPICS, REFERENCE_TOPICS
    from fusetune.analyze.replaying.prepared_flight import REPLAY_TOPICS
    from fusetune.analyze.sensor_noise.sensor_noise import SENSOR_NOISE_TOPICS

    for topic in (*REPLAY_TOPICS, *COMPARED_TOPICS, *REFERENCE_TOPICS, *SENSOR_NOISE_TOPICS):
        assert is_used(topic), topic
    assert not is_used("cpuload")


def test_a_definition_that_comes_late_is_taken(tmp_path: Path) -> None:
    """The part of a topic is defined behind its first subscription, which is lost, and before its second."""
    whole, part = definition("whole", "uint64_t timestamp;part p;"), definition("part", "uint8_t a;")
    records = (SOUND, subscription(2, "sound"), whole, subscription(1, "whole"), data(2, 1_000_000, b"\1"))
    assert ("whole", 0) not in read(tmp_path, *records, part, data(1, 1_000_000, b"\5")).topics
    flight = read(tmp_path, *records, part, subscription(1, "whole"), data(1, 1_000_000, b"\5"))
    assert flight.topics["whole", 0]["p.a"].tolist() == [5]
    assert flight.undefined_topics == ()


def test_asking_for_a_faulty_definition_again_costs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Thousands of subscriptions of a topic that lacks the last of its 3,900 fields, each after another definition."""
    large = definition("large", "uint64_t timestamp;" + "".join(f"float f{n};" for n in range(3900)) + "nowhere x;")
    records = [large, SOUND, subscription(60_000, "sound"), data(60_000, 1_000_000, b"\1")]
    for number in range(5000):
        records += [definition(f"other{number}", "float a;"), subscription(number, "large")]
    summed: list[str] = []
    whole_sum = Definitions._sum
    monkeypatch.setattr(
        Definitions, "_sum", lambda self, name, depth: summed.append(name) or whole_sum(self, name, depth)
    )
    assert read(tmp_path, *records).undefined_topics == ("large",)
    assert summed.count("large") == 1
