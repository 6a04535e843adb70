"""Take a small log apart and put it together as no vehicle does, and see that each case ends in a verdict.

    python -m benchmarks.restructured_logs [--cases 1000] [--seed 1]

Where `benchmarks/mutated_logs.py` damages bytes, this one writes sound records that say absurd things: definitions
nested without end or of thousands of columns, thousands of topics, other clocks, whole sensors in other units or stuck,
parameters that are no numbers, records of another flight in between. A case is a number; the same number gives the
same bytes. Beyond what fails any case (`benchmarks/damage_cases.py`), it fails when only things were added that the
sensors have nothing to do with, and the flight is refused or its sensor samples are not those of the sound log; or when
a sensor was put into another unit, stopped or taken for another time, and the verdict does not say so.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from benchmarks.damage_cases import (
    FIRST_US,
    SENSORS,
    CaseError,
    Outcome,
    Sound,
    changed_rows,
    report,
    run_all,
    saved_case,
    sound_case,
    warned,
)
from benchmarks.ulog_parts import Parts, data, definition, key_value, parameter, record, subscription

Rng = np.random.Generator
UNIX_US = 1_700_000_000_000_000
FIRST_FREE_ID = 1000
_TYPES = (
    "int8_t",
    "uint8_t",
    "int16_t",
    "uint32_t",
    "int64_t",
    "uint64_t",
    "float",
    "double",
    "bool",
    "char",
    "nothing",
)
_ABSURD_NUMBERS = (np.nan, np.inf, -np.inf, 3e38, -3e38, 6e26, 1e-45, -1.0, 0.0)
_ABSURD_LENGTHS = ("0", "1", "2", "255", "65535", "99999", "2000000000", "-1", "4294967296", "")


def _pick(rng: Rng, choices: tuple | list) -> object:
    return choices[int(rng.integers(len(choices)))]


# definitions


def _changed_definition(
    parts: Parts, rng: Rng, change: Callable[[list[tuple[str, str]]], list[tuple[str, str]]]
) -> None:
    name = str(_pick(rng, list(parts.formats)))
    fields = change(list(parts.formats[name]))
    text = definition(name, "".join(f"{type_name} {field};" for type_name, field in fields))
    prefix = f"{name}:".encode()
    parts.definitions = [text if one[3:].startswith(prefix) else one for one in parts.definitions]


def field_types(parts: Parts, rng: Rng) -> None:
    def change(fields: list[tuple[str, str]]) -> list[tuple[str, str]]:
        at = int(rng.integers(len(fields)))
        fields[at] = (str(_pick(rng, _TYPES)), fields[at][1])
        return fields

    _changed_definition(parts, rng, change)


def field_lengths(parts: Parts, rng: Rng) -> None:
    def change(fields: list[tuple[str, str]]) -> list[tuple[str, str]]:
        at = int(rng.integers(len(fields)))
        base = fields[at][0].partition("[")[0]
        fields[at] = (f"{base}[{_pick(rng, _ABSURD_LENGTHS)}]", fields[at][1])
        return fields

    _changed_definition(parts, rng, change)


def field_names(parts: Parts, rng: Rng) -> None:
    def change(fields: list[tuple[str, str]]) -> list[tuple[str, str]]:
        at = int(rng.integers(len(fields)))
        names = (fields[0][1], fields[-1][1], "timestamp", "_padding0", "", "x" * 200, "ä", "a.b", "a[0]", "__proto__")
        fields[at] = (fields[at][0], str(_pick(rng, names)))
        return fields

    _changed_definition(parts, rng, change)


def field_order(parts: Parts, rng: Rng) -> None:
    _changed_definition(parts, rng, lambda fields: [fields[index] for index in rng.permutation(len(fields))])


def lost_definition(parts: Parts, rng: Rng) -> None:
    del parts.definitions[int(rng.integers(len(parts.definitions)))]


def late_definition(parts: Parts, rng: Rng) -> None:
    late = parts.definitions.pop(int(rng.integers(len(parts.definitions))))
    parts.data.insert(int(rng.integers(len(parts.data))), late)


def shuffled_definitions(parts: Parts, rng: Rng) -> None:
    parts.definitions = [parts.definitions[index] for index in rng.permutation(len(parts.definitions))]


def nested_sensor(parts: Parts, rng: Rng) -> None:
    def change(fields: list[tuple[str, str]]) -> list[tuple[str, str]]:
        at = int(rng.integers(1, len(fields)))
        fields[at] = (str(_pick(rng, ["empty[99999]", "ring", "inner", "chain9", "nowhere[3]"])), fields[at][1])
        return fields

    _changed_definition(parts, rng, change)
    _add_nested_definitions(parts)


def _add_nested_definitions(parts: Parts) -> None:
    texts = [definition("empty", ""), definition("ring", "ring a;"), definition("inner", "float x;float y;")]
    texts += [definition(f"chain{depth}", f"chain{depth - 1}[9] a;") for depth in range(9, 0, -1)]
    parts.definitions = [*texts, definition("chain0", "empty[99999] a;float b;"), *parts.definitions]


# additions that no sensor has to do with


def _add_topic(parts: Parts, rng: Rng, name: str, fields: str, instances: int, rows: int, rest: bytes) -> None:
    parts.definitions.append(definition(name, f"uint64_t timestamp;{fields}"))
    first = FIRST_FREE_ID + int(rng.integers(50_000))
    for instance in range(instances):
        parts.definitions.append(subscription(first + instance, name, instance))
        at = int(rng.integers(len(parts.data)))
        now = FIRST_US + 12_000_000 * at // len(parts.data)
        parts.data[at:at] = [data(first + instance, now + row, rest) for row in range(rows)]


def nested_topics(parts: Parts, rng: Rng) -> None:
    """Definitions without fields, in rings, in long chains and in wide arrays."""
    _add_nested_definitions(parts)
    lengths = int(_pick(rng, [1, 63, 99_999]))
    chain = "".join(f"chain{depth}[{lengths}] c{depth};" for depth in rng.permutation(9)[:3])
    fields = str(_pick(rng, [chain, "empty[99999] a;empty[99999] b;", "ring a;", "inner[500] a;", "chain9[99999] a;"]))
    _add_topic(parts, rng, "nested_topic", fields, 2, 3, bytes(8 * 500))


def long_chain(parts: Parts, rng: Rng) -> None:
    links = int(_pick(rng, [20, 500, 5000]))
    names = [definition(f"link{one}", f"link{one + 1}[{int(rng.integers(1, 99_999))}] a;") for one in range(links)]
    order = rng.permutation(links) if rng.random() < 0.5 else range(links)
    parts.definitions += [names[one] for one in order]
    _add_topic(parts, rng, "chained", "link0 a;", 1, 2, b"")


def wide_topics(parts: Parts, rng: Rng) -> None:
    """Few bytes of definition, many columns."""
    parts.definitions.append(definition("wide_part", "uint8_t[63] a;"))
    columns = int(_pick(rng, [10, 60]))
    instances = int(_pick(rng, [3, 20, 120]))
    _add_topic(parts, rng, "wide", f"wide_part[{columns}] p;", instances, 1, bytes(63 * columns))


def many_topics(parts: Parts, rng: Rng) -> None:
    for number in range(int(_pick(rng, [50, 500, 3000]))):
        name = f"topic_{number}" if rng.random() < 0.9 else f"t{'o' * int(rng.integers(300))}pic_{number}"
        parts.definitions.append(definition(name, "uint64_t timestamp;uint8_t a;"))
        parts.definitions.append(subscription(FIRST_FREE_ID + number, name))
        parts.data.append(data(FIRST_FREE_ID + number, FIRST_US + 1, b"\1"))


def many_instances(parts: Parts, rng: Rng) -> None:
    name = str(_pick(rng, ["estimator_status_flags", "some_topic"]))
    parts.definitions.append(definition(name, "uint64_t timestamp;uint32_t control_status_changes;"))
    for number in range(int(_pick(rng, [300, 3000]))):
        parts.data.append(subscription(FIRST_FREE_ID + number, name, 1 + number % 255))
        parts.data.append(data(FIRST_FREE_ID + number, FIRST_US + number, bytes(4)))


def strange_clock(parts: Parts, rng: Rng) -> None:
    """A topic that outnumbers the IMU and has no time stamps, those of another clock, or one that runs backward."""
    kind = int(rng.integers(6))
    parts.definitions.append(definition("custom_topic", "uint64_t timestamp;float a;"))
    parts.definitions.append(subscription(FIRST_FREE_ID, "custom_topic"))
    mixed = []
    for number, one in enumerate(parts.data):
        stamps = (
            0,
            FIRST_US,
            UNIX_US + 1000 * number,
            FIRST_US + 40_000_000 - 1000 * number,
            1000 * number,
            number % 7,
        )
        mixed += [one, data(FIRST_FREE_ID, stamps[kind], bytes(4))]
    parts.data = mixed


def many_information_records(parts: Parts, rng: Rng) -> None:
    count = int(_pick(rng, [10, 1000, 10_000]))
    for number in range(count):
        kind = int(rng.integers(4))
        if kind == 0:
            parts.definitions.append(key_value("I", f"char[4] key_{number}", b"abcd"))
        elif kind == 1:
            parts.definitions.append(key_value("M", "char[9] perf_counter_preflight", b"part\xff of t", b"\1"))
        elif kind == 2:
            parts.definitions.append(key_value("I", f"uint32_t[2000000000] odd_{number}", bytes(3)))
        else:
            parts.definitions.append(key_value("M", f"nothing m_{number % 5}", b"", bytes([int(rng.integers(256))])))


def many_texts_and_dropouts(parts: Parts, rng: Rng) -> None:
    for _ in range(int(_pick(rng, [10, 1000, 10_000]))):
        at = int(rng.integers(len(parts.data)))
        if rng.random() < 0.5:
            parts.data.insert(at, record("O", struct.pack("<H", int(rng.integers(1 << 16)))))
        else:
            stamp = int(_pick(rng, [0, FIRST_US, 1 << 40, (1 << 64) - 1]))
            parts.data.insert(at, record("L", struct.pack("<BQ", 0x36, stamp) + b'=HYPERLINK(1)\n"text"'))


def many_parameter_changes(parts: Parts, rng: Rng) -> None:
    for number in range(int(_pick(rng, [10, 1000, 10_000]))):
        parts.data.insert(int(rng.integers(len(parts.data))), parameter(f"CUSTOM_{number % 300}", number))


def unknown_records(parts: Parts, rng: Rng) -> None:
    for _ in range(int(_pick(rng, [1, 50]))):
        kind = str(_pick(rng, list("XYZabz")))
        parts.data.insert(int(rng.integers(len(parts.data))), record(kind, bytes(int(rng.integers(1, 500)))))


ADDITIONS = (
    nested_topics,
    long_chain,
    wide_topics,
    many_topics,
    many_instances,
    strange_clock,
    many_information_records,
    many_texts_and_dropouts,
    many_parameter_changes,
    unknown_records,
)

# what a sensor says


def _sensor_values(parts: Parts, topic: str, names: str, change: Callable[[np.ndarray], np.ndarray | float]) -> None:
    message_id = parts.message_id(topic)
    places, messages = parts.messages(message_id)
    for name in messages.dtype.names or ():
        if name.startswith(names):
            messages[name] = change(messages[name])
    parts.replace(message_id, places, messages)


def stuck_sensor(parts: Parts, rng: Rng) -> None:
    """A sensor that says the same, or zero, throughout."""
    topic, names = _pick(
        rng,
        [
            ("sensor_combined", "gyro_rad"),
            ("sensor_combined", "accelerometer_m_s2"),
            ("vehicle_magnetometer", "magnetometer_ga"),
            ("vehicle_air_data", "baro_alt_meter"),
            ("vehicle_gps_position", "vel_"),
        ],
    )  # type: ignore[misc]
    zero = rng.random() < 0.3
    _sensor_values(parts, topic, names, lambda values: 0.0 if zero else values[0])


def other_unit(parts: Parts, rng: Rng) -> None:
    topic, names, factor = _pick(
        rng,
        [
            ("sensor_combined", "accelerometer_m_s2", 1.0 / 9.80665),
            ("sensor_combined", "accelerometer_m_s2", 1000.0 / 9.80665),
            ("sensor_combined", "accelerometer_m_s2", 3.28),
            ("sensor_combined", "gyro_integral_dt", 1e-3),
            ("sensor_combined", "gyro_integral_dt", 2.0),
            ("sensor_combined", "accelerometer_integral_dt", 1e3),
            ("vehicle_magnetometer", "magnetometer_ga", 100.0),
            ("vehicle_magnetometer", "magnetometer_ga", 1e-4),
            ("vehicle_magnetometer", "magnetometer_ga", 1e3),
        ],
    )  # type: ignore[misc]
    _sensor_values(parts, topic, names, lambda values: (values * factor).astype(values.dtype))


def repeated_imu_samples(parts: Parts, rng: Rng) -> None:
    every = int(_pick(rng, [2, 3, 5]))
    message_id = parts.message_id("sensor_combined")
    places, messages = parts.messages(message_id)
    again = np.arange(len(messages)) // every * every
    for name in messages.dtype.names or ():
        if name.startswith(("gyro_rad", "accelerometer_m_s2")):
            messages[name] = messages[name][again]
    parts.replace(message_id, places, messages)


def impossible_sensor(parts: Parts, rng: Rng) -> None:
    topic = str(_pick(rng, SENSORS))
    value = float(_pick(rng, [np.nan, np.inf, 1e30]))  # type: ignore[arg-type]
    names = {"sensor_combined": "gyro_rad", "vehicle_magnetometer": "magnetometer_ga", "vehicle_air_data": "baro_alt"}
    _sensor_values(parts, topic, names.get(topic, "eph"), lambda _: value)


def sensor_by_another_clock(parts: Parts, rng: Rng) -> None:
    topic = str(_pick(rng, ["sensor_combined", "vehicle_magnetometer", "vehicle_air_data"]))
    kind = int(rng.integers(3))

    def stamps(values: np.ndarray) -> np.ndarray:
        return (values * 0, values + np.uint64(UNIX_US), values[::-1] + np.uint64(20_000_000))[kind]

    _sensor_values(parts, topic, "timestamp", stamps)


FAULTS = (stuck_sensor, other_unit, repeated_imu_samples, impossible_sensor, sensor_by_another_clock)

# all else


def time_base(parts: Parts, rng: Rng) -> None:
    """Time stamps of all topics, or of any, offset, scaled, reversed, constant or scattered."""
    chosen = list(parts.topics) if rng.random() < 0.4 else [int(rng.choice(list(parts.topics)))]
    kind = int(rng.integers(8))
    for message_id in chosen:
        places, messages = parts.messages(message_id)
        times = messages["timestamp"]
        scattered = rng.integers(1 << 40, size=len(times), dtype=np.uint64)
        messages["timestamp"] = (
            times + np.uint64(UNIX_US),
            times - np.uint64(FIRST_US + 1),
            times // np.uint64(1000),
            times * np.uint64(1000),
            times[::-1],
            times * 0 + times[:1],
            scattered,
            times % np.uint64(1_000_000),
        )[kind]
        parts.replace(message_id, places, messages)


def subscriptions(parts: Parts, rng: Rng) -> None:
    """Message ids exchanged, doubled, of another instance, of no topic, or lost."""
    at = [index for index, one in enumerate(parts.definitions) if one[2:3] == b"A"]
    first, second = (int(index) for index in rng.choice(at, 2))
    one, other = parts.definitions[first], parts.definitions[second]
    message_id, name = int.from_bytes(one[4:6], "little"), one[6:].decode()
    changed = (
        subscription(int.from_bytes(other[4:6], "little"), name),
        subscription(message_id, name, int(rng.integers(256))),
        subscription(message_id, "nowhere"),
        subscription(message_id, "x" * int(rng.integers(1, 60_000))),
        subscription(message_id, "../../escape"),
        b"",
    )
    parts.definitions[first] = changed[int(rng.integers(len(changed)))]
    if rng.random() < 0.3:
        parts.definitions += [one] * 2000


def message_lengths(parts: Parts, rng: Rng) -> None:
    """Sound records of a topic that are shorter or longer than its definition says."""
    message_id = int(rng.choice(list(parts.topics)))
    places = parts.rows(message_id)
    cut = int(rng.integers(-12, 80))
    for place in places[:: int(_pick(rng, [1, 3]))]:  # type: ignore[call-overload]
        payload = parts.data[place][3:]
        parts.data[place] = record("D", payload + bytes(cut) if cut >= 0 else payload[: max(len(payload) + cut, 0)])


def parameters(parts: Parts, rng: Rng) -> None:
    for _ in range(int(_pick(rng, [1, 5, 200]))):
        name = str(
            _pick(rng, ["EKF2_EV_DELAY", "EKF2_HGT_REF", "EKF2_GPS_CTRL", "SDLOG_PROFILE", "EKF2_MAG_TYPE", "X"])
        )
        value = float(_pick(rng, _ABSURD_NUMBERS))  # type: ignore[arg-type]
        text = parameter(name, value) if rng.random() < 0.7 else parameter(name, int(rng.integers(-(1 << 31), 1 << 31)))
        if rng.random() < 0.5:
            parts.definitions.append(text)
        else:
            parts.data.insert(int(rng.integers(len(parts.data))), text)


def many_changes(parts: Parts, rng: Rng) -> None:
    """What is told once in a flight changes thousands of times: landed, selected, primary, parameters of the filter."""
    count = int(_pick(rng, [100, 5000, 30_000]))
    topics = {
        "vehicle_land_detected": ("bool landed;", 1),
        "sensor_selection": ("uint32_t accel_device_id;", 4),
        "estimator_selector_status": ("uint8_t primary_instance;", 1),
        "vehicle_status": ("uint8_t arming_state;", 1),
    }
    name = str(_pick(rng, [*topics, "parameter"]))
    if name == "parameter":
        parts.data[1:1] = [parameter("EKF2_BARO_NOISE", 2.0 + number % 2) for number in range(count)]
        return
    fields, size = topics[name]
    parts.definitions.insert(1, definition(name, f"uint64_t timestamp;{fields}"))
    parts.definitions.append(subscription(FIRST_FREE_ID, name))
    each = -(-count // len(parts.data))
    mixed = []
    for number, one in enumerate(parts.data):
        now = FIRST_US + 12_000_000 * number // len(parts.data)
        rows = [data(FIRST_FREE_ID, now + turn, bytes([turn % 2]) + bytes(size - 1)) for turn in range(each)]
        mixed += [one, *rows]
    parts.data = mixed


def spliced(parts: Parts, rng: Rng) -> None:
    """Records of another flight, a second later or years, in between or behind."""
    offset = int(_pick(rng, [0, 1_000_000, 60_000_000, 1 << 45]))
    begin = int(rng.integers(len(parts.data)))
    other = []
    for one in parts.data[begin : begin + int(_pick(rng, [10, 1000, 100_000]))]:  # type: ignore[operator]
        if one[2:3] == b"D" and len(one) >= 13:
            stamp = int.from_bytes(one[5:13], "little") + offset
            one = one[:5] + (stamp & (1 << 64) - 1).to_bytes(8, "little") + one[13:]
        other.append(one)
    at = int(rng.integers(len(parts.data)))
    if rng.random() < 0.5:
        parts.data[at:at] = other
    else:
        mixed = parts.data[at : at + len(other)]
        parts.data[at : at + len(other)] = [one for pair in zip(mixed, other, strict=False) for one in pair]


def whole_log_behind(parts: Parts, rng: Rng) -> None:
    parts.tail = parts.content()[: int(rng.integers(1, 400_000))]


def cut_and_appended(parts: Parts, rng: Rng) -> None:
    """The file breaks off within a record and goes on where the flag bits say, or say wrongly."""
    content = parts.content()
    cut = int(rng.integers(len(content) // 2, len(content)))
    parts.tail, parts.data = content[int(rng.integers(cut - 300, len(content))) :], []
    broken = content[len(parts.content()) - len(parts.tail) : cut]
    parts.tail = broken + parts.tail
    offsets = [cut, 0, 0]
    if rng.random() < 0.5:
        offsets = [int(_pick(rng, [0, 1, cut, cut - 1, 16, len(content), 1 << 63, cut + 50])) for _ in range(3)]  # type: ignore[call-overload]
    _set_flags(parts, bytes(8), bytes([1]) + bytes(7), offsets)


def flag_bits(parts: Parts, rng: Rng) -> None:
    compatible, incompatible = (
        bytes(rng.integers(0, 256, 8, np.uint8)) if rng.random() < 0.5 else bytes(8) for _ in "12"
    )
    _set_flags(parts, compatible, incompatible, [0, 0, 0])


def _set_flags(parts: Parts, compatible: bytes, incompatible: bytes, offsets: list[int]) -> None:
    payload = compatible + incompatible + struct.pack("<3Q", *(offset & (1 << 64) - 1 for offset in offsets))
    parts.definitions[0] = record("B", payload)


def empty_records(parts: Parts, rng: Rng) -> None:
    for _ in range(int(_pick(rng, [1, 20, 2000]))):
        kind = str(_pick(rng, list("DFAIMPQOLCRSB")))
        parts.data.insert(int(rng.integers(len(parts.data))), record(kind, bytes(int(rng.integers(3)))))


def header(parts: Parts, rng: Rng) -> None:
    start = int(_pick(rng, [0, 1, FIRST_US - 1, UNIX_US, 1 << 62, (1 << 64) - 1]))
    parts.header = parts.header[:7] + bytes([int(_pick(rng, [0, 1, 2, 255]))]) + struct.pack("<Q", start)


OTHERS = (
    field_types,
    field_lengths,
    field_names,
    field_order,
    lost_definition,
    late_definition,
    shuffled_definitions,
    nested_sensor,
    time_base,
    subscriptions,
    message_lengths,
    parameters,
    many_changes,
    spliced,
    whole_log_behind,
    cut_and_appended,
    flag_bits,
    empty_records,
    header,
)
LAST = (whole_log_behind, cut_and_appended)
WAYS = (*ADDITIONS, *FAULTS, *OTHERS)


class Restructurer:
    """Makes the cases of one log."""

    def __init__(self, sound: bytes) -> None:
        self._sound = Parts.of(sound)

    def mutated(self, seed: int) -> tuple[bytes, str]:
        """The bytes of a case, with the names of what was done."""
        rng = np.random.default_rng(seed)
        parts = self._sound.copy()
        # every way comes first in turn; a second one is of any kind
        chosen = [WAYS[seed % len(WAYS)]]
        if rng.random() < 0.4:
            chosen.append(WAYS[int(rng.integers(len(WAYS)))])
        # what changes messages reads them as they are defined, so it goes first; what breaks the file goes last
        for way in sorted(chosen, key=lambda one: (one in LAST, one not in FAULTS, one is not time_base)):
            way(parts, rng)
        return parts.content(), " + ".join(way.__name__ for way in chosen)


def run_case(content: bytes, ways: str, folder: Path, sound: Sound) -> str:
    """Save a restructured log and judge what came of it: the verdict's status.

    Raises
    ------
    CaseError
        As `saved_case`; or a mere addition changed the flight, or a fault was not told.
    """
    verdict, flight = saved_case(content, folder)
    names = ways.split(" + ")
    if all(name in {way.__name__ for way in ADDITIONS} for name in names):
        if flight is None:
            raise CaseError(f"refused for what the sensors have nothing to do with: {'; '.join(verdict.reasons)}")
        for topic in SENSORS:
            table = flight.topic(topic)
            if table is None or len(table["timestamp"]) != len(sound.tables[topic]["timestamp"]):
                raise CaseError(f"samples of {topic} are missing")
            if changed_rows(table, sound.tables[topic]):
                raise CaseError(f"samples of {topic} are not those of the sound log")
    if len(names) == 1 and names[0] in {way.__name__ for way in FAULTS} and warned(verdict) <= sound.warnings:
        raise CaseError("no warning tells of it")
    return verdict.status


def run_cases(seeds: range, folder: Path) -> Outcome:
    """Run cases."""
    sound = sound_case(folder)
    return run_all(
        seeds, Restructurer(sound.content).mutated, lambda content, ways: run_case(content, ways, folder, sound)
    )


if __name__ == "__main__":
    sys.exit(report(__doc__, 1000, run_cases))
