"""Damage a small log in every way a card, a crash or a bad copy does, and see that each case ends in a verdict.

    python benchmarks/mutated_logs.py [--cases 2000] [--seed 1]

A case is a number; the same number gives the same bytes. It fails when saving it raises anything, takes longer than
`MOST_SECONDS`, takes more memory than eight times the file above what the process had, or when a flight that is
called replayable holds sensor samples that cannot be or are out of order, or more samples that the sound log does not
hold than single bits were flipped, without a warning that the sound log does not have. (A bit that changes a value
into another possible one cannot be noticed: ULog has no checksums.)
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fusetune.px4.flight import Flight, ParameterHistory, TopicTable
from fusetune.px4.release_layouts import canonical
from fusetune.px4.sensor_limits import impossible_samples
from fusetune.px4.ulog_writer import write_ulog
from fusetune.save import Verdict, load_flight, save_log, write_flights_table

MOST_SECONDS = 10.0
MOST_MEMORY = 8
ALLOCATOR_STEP_BYTES = 2_000_000
"""What an allocator takes from the system at a time, however little is asked for."""
FIRST_US, SECONDS, IMU_HZ, SLOW_HZ = 5_000_000, 12, 200, 20
SENSORS = ("sensor_combined", "vehicle_magnetometer", "vehicle_air_data", "vehicle_gps_position")
MOST_SILENT = 160
"""Samples that single flipped bits and values can change in one case: 50 and 30 in each of up to three ways."""
ABSURD_TIMES = (0, 1, 1 << 31, 1 << 40, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)
ABSURD_VALUES = (np.nan, np.inf, -np.inf, 1e30, -1e30, 1e-40)


def sound_log(path: Path) -> bytes:
    """A quadrotor that stands for a second and then hovers; some 300 kB, all sensors, a replayable flight."""
    rng = np.random.default_rng(0)
    time_us = FIRST_US + np.arange(SECONDS * IMU_HZ, dtype=np.int64) * (1_000_000 // IMU_HZ)
    slow = time_us[:: IMU_HZ // SLOW_HZ] + 300
    topics = {
        ("sensor_combined", 0): _imu(time_us, rng),
        ("vehicle_magnetometer", 0): _vector(slow, "magnetometer_ga", (0.21, 0.01, 0.43), 0.002, rng),
        ("vehicle_air_data", 0): _vector(slow, "baro_alt_meter", (488.0,), 0.1, rng),
        ("vehicle_gps_position", 0): _gnss(slow[::4], rng),
        ("vehicle_attitude", 0): _vector(slow, "q", (1.0, 0.0, 0.0, 0.0), 0.001, rng),
        ("vehicle_status", 0): {"timestamp": slow[::10], "arming_state": np.full(len(slow[::10]), 2, np.uint8)},
        ("vehicle_land_detected", 0): {"timestamp": slow[[0, SLOW_HZ]], "landed": np.array([True, False])},
        ("estimator_status", 0): {"timestamp": slow, "control_mode_flags": np.full(len(slow), 7, np.uint32)},
    }
    flight = Flight(
        "sound",
        topics,
        ParameterHistory({"EKF2_GPS_CTRL": 7, "EKF2_GPS_V_NOISE": 0.3, "EKF2_BARO_NOISE": 3.5, "SDLOG_PROFILE": 3}),
        info={"sys_name": "PX4", "ver_hw": "PX4_SITL", "ver_sw_release": 0x011000FF},
        start_timestamp=FIRST_US,
    )
    write_ulog(path, flight)
    return path.read_bytes()


def _vector(
    time_us: np.ndarray, name: str, mean: tuple[float, ...], noise: float, rng: np.random.Generator
) -> TopicTable:
    columns = [name] if len(mean) == 1 else [f"{name}[{axis}]" for axis in range(len(mean))]
    rows = len(time_us)
    return {"timestamp": time_us} | {
        column: (value + noise * rng.standard_normal(rows)).astype(np.float32)
        for column, value in zip(columns, mean, strict=True)
    }


def _imu(time_us: np.ndarray, rng: np.random.Generator) -> TopicTable:
    interval = np.full(len(time_us), 1_000_000 // IMU_HZ, np.uint32)
    return {
        **_vector(time_us, "gyro_rad", (0.0, 0.0, 0.0), 0.01, rng),
        **_vector(time_us, "accelerometer_m_s2", (0.0, 0.0, -9.81), 0.1, rng),
        "gyro_integral_dt": interval,
        "accelerometer_integral_dt": interval,
    }


def _gnss(time_us: np.ndarray, rng: np.random.Generator) -> TopicTable:
    rows = len(time_us)
    return {
        "timestamp": time_us,
        "latitude_deg": 47.397742 + 1e-7 * rng.standard_normal(rows),
        "longitude_deg": 8.545594 + 1e-7 * rng.standard_normal(rows),
        "altitude_msl_m": 488.0 + 0.1 * rng.standard_normal(rows),
        "fix_type": np.full(rows, 3, np.uint8),
        "satellites_used": np.full(rows, 12, np.uint8),
        "eph": np.full(rows, 0.8, np.float32),
        "epv": np.full(rows, 1.2, np.float32),
        "s_variance_m_s": np.full(rows, 0.2, np.float32),
        "vel_ned_valid": np.ones(rows, np.bool_),
        **{f"vel_{axis}_m_s": (0.05 * rng.standard_normal(rows)).astype(np.float32) for axis in "ned"},
    }


def records_of(content: bytes) -> list[tuple[int, int]]:
    """Begin and end of every record of a sound file."""
    found, position = [], 16
    while position < len(content):
        end = position + 3 + int.from_bytes(content[position : position + 2], "little")
        found.append((position, end))
        position = end
    return found


@dataclass
class Mutator:
    """Damages one log; each method is one way of damage and returns the bytes."""

    sound: bytes

    def __post_init__(self) -> None:
        self.records = records_of(self.sound)
        self.data = [(begin, end) for begin, end in self.records if self.sound[begin + 2] == ord("D")]
        self.definitions_end = self.data[0][0]
        self.ways: tuple[Callable[[bytearray, np.random.Generator], bytearray], ...] = (
            self.bit_flips,
            self.bit_flips_in_definitions,
            self.truncation,
            self.removal,
            self.repetition,
            self.exchange,
            self.shuffled_records,
            self.sizes,
            self.time_stamps,
            self.values,
            self.rubbish,
        )

    def mutated(self, seed: int) -> tuple[bytes, str]:
        """The bytes of a case, with the names of what was done."""
        rng = np.random.default_rng(seed)
        content, names = bytearray(self.sound), []
        for _ in range(int(rng.choice([1, 1, 2, 3]))):
            way = self.ways[int(rng.integers(len(self.ways)))]
            content = way(content, rng)
            names.append(way.__name__)
        return bytes(content), " + ".join(names)

    def bit_flips(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        return _flipped(content, rng, 0, len(content))

    def bit_flips_in_definitions(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        return _flipped(content, rng, 0, min(self.definitions_end, len(content)))

    def truncation(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        return content[: int(rng.integers(0, len(content) + 1))]

    def removal(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        return content[:begin] + content[end:]

    def repetition(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        place = int(rng.integers(0, len(content) + 1))
        return content[:place] + content[begin:end] + content[place:]

    def exchange(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        place = int(rng.integers(0, max(len(content) - (end - begin), 0) + 1))
        moved = bytearray(content)
        moved[begin:end], moved[place : place + end - begin] = content[place : place + end - begin], content[begin:end]
        return moved

    def shuffled_records(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        first = int(rng.integers(0, len(self.records)))
        last = min(first + int(rng.choice([2, 10, 200, 2000])), len(self.records) - 1)
        order = rng.permutation(np.arange(first, last + 1))
        middle = b"".join(self.sound[slice(*self.records[index])] for index in order)
        return content[: self.records[first][0]] + middle + content[self.records[last][1] :]

    def sizes(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        for begin, _ in self._some(self.records, rng):
            size = int(rng.choice([0, 1, 2, 0xFFFF, int(rng.integers(0x10000))]))
            content[begin : begin + 2] = size.to_bytes(2, "little")
        return content

    def time_stamps(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        for begin, _ in self._some(self.data, rng):
            absurd = int(rng.integers(1 << 64, dtype=np.uint64)) if rng.random() < 0.3 else int(rng.choice(7))
            value = absurd if absurd > 6 else ABSURD_TIMES[absurd]
            content[begin + 5 : begin + 13] = value.to_bytes(8, "little")
        return content

    def values(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        for begin, end in self._some(self.data, rng):
            place = begin + 13 + 4 * int(rng.integers(max((end - begin - 13) // 4, 1)))
            content[place : place + 4] = np.float32(rng.choice(ABSURD_VALUES)).tobytes()
        return content

    def rubbish(self, content: bytearray, rng: np.random.Generator) -> bytearray:
        begin, end = _slice(content, rng)
        content[begin:end] = rng.integers(0, 256, end - begin, np.uint8).tobytes()
        return content

    def _some(self, places: list[tuple[int, int]], rng: np.random.Generator) -> Iterator[tuple[int, int]]:
        for _ in range(int(rng.choice([1, 3, 30]))):
            yield places[int(rng.integers(len(places)))]


def _flipped(content: bytearray, rng: np.random.Generator, begin: int, end: int) -> bytearray:
    if end > begin:
        for _ in range(int(rng.choice([1, 5, 50]))):
            content[int(rng.integers(begin, end))] ^= 1 << int(rng.integers(8))
    return content


def _slice(content: bytearray, rng: np.random.Generator) -> tuple[int, int]:
    begin = int(rng.integers(0, len(content) + 1))
    return begin, min(begin + int(rng.choice([1, 7, 100, 4096, 60_000])), len(content))


class CaseError(Exception):
    """A case that did not end as it should."""


@dataclass(frozen=True)
class Sound:
    """What the sound log gives."""

    content: bytes
    warnings: frozenset[str]
    """Names of the checks that do not pass."""
    tables: dict[str, TopicTable]


def sound_case(folder: Path) -> Sound:
    """Save the sound log."""
    content = sound_log(folder / "sound.ulg")
    verdict = save_log(folder / "sound.ulg", folder / "sound")
    if verdict.status != "replayable":
        raise CaseError("the sound log is refused")
    flight = canonical(load_flight(folder / "sound"))
    tables = {topic: flight.topics[topic, 0] for topic in SENSORS}
    return Sound(content, _warned(verdict), tables)


def _warned(verdict: Verdict) -> frozenset[str]:
    return frozenset(check.name for check in verdict.checks if check.status in ("warning", "fail"))


def run_case(content: bytes, folder: Path, sound: Sound) -> str:
    """Save damaged bytes and judge what came of it: the verdict's status.

    Raises
    ------
    CaseError
        What was called replayable cannot be replayed, or the verdict gives no reason.
    """
    log = folder / "case.ulg"
    log.write_bytes(content)
    with _time_limit(MOST_SECONDS):
        verdict = save_log(log, folder / "case")
    write_flights_table([folder / "case"], folder / "flights.parquet", folder / "flights.csv")
    if verdict.status == "refused":
        if not all(verdict.reasons):
            raise CaseError("refused without a reason")
        return verdict.status
    flight = canonical(load_flight(folder / "case"))
    for topic in SENSORS:
        table = flight.topic(topic)
        if table is None:
            continue
        if impossible_samples(topic, table).any():
            raise CaseError(f"impossible values in {topic}")
        times = table["timestamp"]
        if topic == "sensor_combined" and np.any(np.diff(times) <= 0):
            raise CaseError("IMU samples that do not advance")
        if np.any(np.diff(times) < 0):
            raise CaseError(f"{topic} is out of order")
        changed = _changed_rows(table, sound.tables[topic])
        if changed > MOST_SILENT and _warned(verdict) <= sound.warnings:
            raise CaseError(f"{changed} samples of {topic} are not those of the sound log, and no warning says so")
    return verdict.status


def _changed_rows(table: TopicTable, sound: TopicTable) -> int:
    """Rows that the sound table does not hold as they are."""
    rows = np.minimum(np.searchsorted(sound["timestamp"], table["timestamp"]), len(sound["timestamp"]) - 1)
    same = np.ones(len(table["timestamp"]), np.bool_)
    for name in table.keys() & sound.keys():
        expected = sound[name][rows]
        same &= (table[name] == expected) | ((table[name] != table[name]) & (expected != expected))
    return int(np.sum(~same))


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    def stop(*_: object) -> None:
        raise CaseError(f"takes longer than {seconds:g} s")

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def peak_bytes() -> int:
    """Peak memory of this process since `forget_peak`; 0 where the system does not tell."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0
    lines = status.read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM"))


def forget_peak() -> None:
    """Let the peak begin anew at the memory in use."""
    target = Path("/proc/self/clear_refs")
    if target.exists():
        target.write_text("5", encoding="ascii")


def run_cases(seeds: range, folder: Path) -> tuple[Counter[str], dict[int, str], float]:
    """Run cases; how many ended how, the failures by seed, and the slowest in seconds."""
    sound = sound_case(folder)
    mutator = Mutator(sound.content)
    run_case(sound.content, folder, sound)
    tally: Counter[str] = Counter()
    failures: dict[int, str] = {}
    slowest = 0.0
    for seed in seeds:
        content, ways = mutator.mutated(seed)
        begin = time.perf_counter()
        try:
            outcome, taken = _measured_case(content, folder, sound)
            most = MOST_MEMORY * max(len(content), len(sound.content)) + ALLOCATOR_STEP_BYTES
            if taken > most:
                # an allocator grows now and then whatever the case is; one that needs the memory needs it again
                outcome, taken = _measured_case(content, folder, sound)
            if taken > most:
                raise CaseError(f"takes {taken / 1e6:.1f} MB for {len(content) / 1e6:.2f} MB")
        except Exception as error:  # every way of failing is a finding
            outcome = "failed"
            place = traceback.extract_tb(error.__traceback__)[-1]
            failures[seed] = f"{ways}: {type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        slowest = max(slowest, time.perf_counter() - begin)
        tally[outcome] += 1
    return tally, failures, slowest


def _measured_case(content: bytes, folder: Path, sound: Sound) -> tuple[str, int]:
    """Outcome of a case, and the memory it took beyond what the process had."""
    forget_peak()
    before = peak_bytes()
    outcome = run_case(content, folder, sound)
    return outcome, peak_bytes() - before


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1, help="number of the first case")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        tally, failures, slowest = run_cases(range(options.seed, options.seed + options.cases), Path(scratch))
    print(f"{options.cases} cases: " + ", ".join(f"{count} {outcome}" for outcome, count in sorted(tally.items())))
    print(f"slowest case: {slowest:.2f} s")
    for seed, reason in failures.items():
        print(f"seed {seed}: {reason}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
