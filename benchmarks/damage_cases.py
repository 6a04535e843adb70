"""Cases of spoiled logs: a small sound log, and how to save a spoiled one and judge what came of it.

A case fails when saving it raises or warns of anything, takes longer than `MOST_SECONDS`, takes more memory than eight
times the file above what the process had or more disk than `MOST_DISK` times the file, or when a flight that is called
replayable holds sensor samples that cannot be or are out of order.
"""

from __future__ import annotations

import argparse
import signal
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fusetune.px4.flight import Flight, ParameterHistory, TopicTable
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.sensor_limits import impossible_samples
from fusetune.px4.ulog.writer import write_ulog
from fusetune.save import Verdict, load_flight, save_log, write_flights_table

MOST_SECONDS = 10.0
"""Of the processor's time."""
MOST_MEMORY = 8
MOST_DISK = 4
DISK_OF_A_FOLDER_BYTES = 8_000_000
"""For names and columns of as many tables as a log may have, however short."""
ALLOCATOR_STEP_BYTES = 2_000_000
"""What an allocator takes from the system at a time, however little is asked for."""
SOUND_BYTES = 300_000
"""The sound log: what a smaller one may take."""
FIRST_US, SECONDS, IMU_HZ, SLOW_HZ = 5_000_000, 12, 200, 20
SENSORS = ("sensor_combined", "vehicle_magnetometer", "vehicle_air_data", "vehicle_gps_position")


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
    return Sound(content, warned(verdict), tables)


def warned(verdict: Verdict) -> frozenset[str]:
    return frozenset(check.id for check in verdict.findings if check.severity in ("warning", "fail"))


def saved_case(content: bytes, folder: Path) -> tuple[Verdict, Flight | None]:
    """Save a spoiled log; its verdict, and the canonical flight of a replayable one.

    Raises
    ------
    CaseError
        It took too long or too much, or what was called replayable cannot be replayed, or a refusal gives no reason.
    """
    log = folder / "case.ulg"
    log.write_bytes(content)
    with _time_limit(MOST_SECONDS), warnings.catch_warnings():
        warnings.simplefilter("error")
        verdict = save_log(log, folder / "case")
        write_flights_table([folder / "case"], folder / "flights.parquet", folder / "flights.csv")
    written = sum(file.stat().st_size for file in (folder / "case").iterdir())
    if written > MOST_DISK * len(content) + DISK_OF_A_FOLDER_BYTES:
        raise CaseError(f"writes {written / 1e6:.1f} MB for {len(content) / 1e6:.2f} MB")
    if verdict.status == "refused":
        if not all(verdict.reasons):
            raise CaseError("refused without a reason")
        return verdict, None
    flight = canonical(load_flight(folder / "case"))
    _see_that_it_can_be_replayed(flight)
    return verdict, flight


def _see_that_it_can_be_replayed(flight: Flight) -> None:
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


def changed_rows(table: TopicTable, sound: TopicTable) -> int:
    """Rows that the sound table does not hold as they are."""
    rows = np.minimum(np.searchsorted(sound["timestamp"], table["timestamp"]), len(sound["timestamp"]) - 1)
    same = np.ones(len(table["timestamp"]), np.bool_)
    for name in table.keys() & sound.keys():
        expected = sound[name][rows]
        same &= (table[name] == expected) | ((table[name] != table[name]) & (expected != expected))
    return int(np.sum(~same))


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Of the processor's time, so that other work on the machine does not count; ten times as long for what waits."""

    def stop(*_: object) -> None:
        raise CaseError(f"takes longer than {seconds:g} s")

    timers = {signal.ITIMER_PROF: signal.SIGPROF, signal.ITIMER_REAL: signal.SIGALRM}
    for timer, sent in timers.items():
        signal.signal(sent, stop)
        signal.setitimer(timer, seconds if timer == signal.ITIMER_PROF else 10.0 * seconds)
    try:
        yield
    finally:
        for timer in timers:
            signal.setitimer(timer, 0.0)


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


@dataclass
class Outcome:
    """What came of many cases."""

    tally: Counter[str]
    """How many ended how."""
    failures: dict[int, str]
    """By seed."""
    slowest_s: float
    """Processor's time."""
    slowest: int
    """Seed of the slowest case."""


def run_all(seeds: range, mutated: Callable[[int], tuple[bytes, str]], run: Callable[[bytes, str], str]) -> Outcome:
    """Run cases.

    Parameters
    ----------
    mutated
        The bytes of a case, and what was done to them.
    run
        Saves bytes to which that was done and judges what came of it: the verdict's status.
    """
    outcome = Outcome(Counter(), {}, 0.0, seeds.start)
    for seed in seeds:
        content, ways = mutated(seed)
        begin = time.process_time()
        try:
            status, taken = _measured(content, ways, run)
            most = MOST_MEMORY * max(len(content), SOUND_BYTES) + ALLOCATOR_STEP_BYTES
            if taken > most:
                # an allocator grows now and then whatever the case is; one that needs the memory needs it again
                status, taken = _measured(content, ways, run)
            if taken > most:
                raise CaseError(f"takes {taken / 1e6:.1f} MB for {len(content) / 1e6:.2f} MB")
        except Exception as error:  # every way of failing is a finding
            status = "failed"
            place = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{Path(place.filename).name}:{place.lineno}"
            outcome.failures[seed] = f"{ways}: {type(error).__name__}: {error} ({where})"
        taken_s = time.process_time() - begin
        if taken_s > outcome.slowest_s:
            outcome.slowest_s, outcome.slowest = taken_s, seed
        outcome.tally[status] += 1
    return outcome


def _measured(content: bytes, ways: str, run: Callable[[bytes, str], str]) -> tuple[str, int]:
    """Status of a case, and the memory it took beyond what the process had."""
    forget_peak()
    before = peak_bytes()
    status = run(content, ways)
    return status, peak_bytes() - before


def report(description: str | None, cases: int, run: Callable[[range, Path], Outcome]) -> int:
    """Command line of a benchmark: run the cases asked for and print what came of them."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=cases)
    parser.add_argument("--seed", type=int, default=1, help="number of the first case")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        outcome = run(range(options.seed, options.seed + options.cases), Path(scratch))
    tally = ", ".join(f"{count} {status}" for status, count in sorted(outcome.tally.items()))
    print(f"{options.cases} cases: {tally}")
    print(f"slowest case: {outcome.slowest_s:.2f} s of CPU (seed {outcome.slowest})")
    for seed, reason in outcome.failures.items():
        print(f"seed {seed}: {reason}")
    return 1 if outcome.failures else 0
