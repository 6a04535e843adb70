"""Facts about a flight that people look for first: when it was recorded, how long, by which firmware on what."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from fusetune.px4.flight import Flight, TopicTable
from fusetune.px4.vehicle_identity import vehicle_identity

# as people write it, or as PX4 names folder and file of a log: 2024-01-31/10_20_30.ulg
_NAME_DATE = re.compile(r"(20\d\d)-(\d{1,2})-(\d{1,2})[-_](\d{1,2})[-_](\d{1,2})[-_](\d{1,2})")
_PLAUSIBLE_UTC_S = (datetime(2010, 1, 1, tzinfo=UTC).timestamp(), datetime(2100, 1, 1, tzinfo=UTC).timestamp())
_VERSION_KEYS = (
    "ver_sw",
    "ver_sw_release",
    "ver_sw_branch",
    "ver_vendor_sw_release",
    "sys_name",
    "sys_os_name",
    "sys_os_ver",
    "sys_toolchain",
    "sys_toolchain_ver",
    "ver_data_format",
)
_HARDWARE_KEYS = ("ver_hw", "ver_hw_subtype", "sys_mcu", "sys_uuid")


@dataclass(frozen=True)
class FlightTimes:
    """How long a flight was; seconds, by the clock of the autopilot."""

    duration_s: float
    """From the first IMU sample to the last; of a log without them, from its start to its last message."""
    airborne_s: float | None
    """Time that the land detector calls airborne within that; `None` where the log has no land detector."""


def airborne_intervals(flight: Flight) -> list[tuple[int, int]] | None:
    """Times in the air while there are IMU samples, (begin, end) in µs; `None` where the log has no land detector."""
    imu, land_detected = flight.topic("sensor_combined"), flight.topic("vehicle_land_detected")
    if imu is None or not len(imu["timestamp"]) or land_detected is None or "landed" not in land_detected:
        return None
    first, last = int(imu["timestamp"].min()), int(imu["timestamp"].max())
    order = np.argsort(land_detected["timestamp"], kind="stable")
    landed = land_detected["landed"][order].astype(np.bool_)
    changed = np.flatnonzero(np.diff(landed, prepend=not landed[0]))
    edges = np.clip(np.append(land_detected["timestamp"][order][changed], last), first, last).tolist()
    states = landed[changed].tolist()
    return [(begin, end) for begin, end, on_ground in zip(edges, edges[1:], states, strict=False) if not on_ground]


def is_airborne(flight: Flight, times: np.ndarray) -> np.ndarray:
    """Whether the vehicle was in the air at some times (N,) µs, (N,) bool; true where the log does not tell."""
    intervals = airborne_intervals(flight)
    if intervals is None:
        return np.ones(len(times), np.bool_)
    # behind the begin of an interval and before its end lies an odd number of edges
    edges = np.array(intervals, np.int64).reshape(-1)
    return np.searchsorted(edges, times, side="right") % 2 == 1


def rate_hz(table: TopicTable | None) -> float | None:
    """Mean rate of a topic; `None` where there are no samples."""
    if table is None or not len(table["timestamp"]):
        return None
    span = float(table["timestamp"].max() - table["timestamp"].min()) * 1e-6
    return (len(table["timestamp"]) - 1) / span if span > 0.0 else 0.0


def flight_times(flight: Flight) -> FlightTimes:
    """Times of a canonical or a raw flight."""
    imu = flight.topic("sensor_combined")
    if imu is None or not len(imu["timestamp"]):
        return FlightTimes(flight.duration_s, None)
    duration = int(imu["timestamp"].max()) - int(imu["timestamp"].min())
    intervals = airborne_intervals(flight)
    airborne = None if intervals is None else sum(end - begin for begin, end in intervals) * 1e-6
    return FlightTimes(duration * 1e-6, airborne)


def recorded_at(flight: Flight) -> str:
    """UTC of the start of the log, ISO 8601; from GNSS, else from the date in the file's name; empty where unknown."""
    gnss = flight.topic("vehicle_gps_position")
    if gnss is None:
        gnss = flight.topic("sensor_gps")
    if gnss is not None and "time_utc_usec" in gnss:
        offset_s = (gnss["time_utc_usec"].astype(np.float64) - gnss["timestamp"].astype(np.float64)) * 1e-6
        started_s = offset_s + flight.start_timestamp * 1e-6
        plausible = started_s[(started_s > _PLAUSIBLE_UTC_S[0]) & (started_s < _PLAUSIBLE_UTC_S[1])]
        if len(plausible):
            return datetime.fromtimestamp(int(np.median(plausible)), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    date = _NAME_DATE.search(flight.name)
    if date:
        year, month, day, hour, minute, second = (int(part) for part in date.groups())
        return f"{year:04d}-{month:02d}-{day:02d}T{hour:02d}:{minute:02d}:{second:02d}Z"
    return ""


def _readable_info(flight: Flight, keys: tuple[str, ...]) -> dict[str, str | int]:
    """Texts and whole numbers among the information of a log; damage can make anything of it."""
    found = {key: flight.info.get(key) for key in keys}
    return {key: value for key, value in found.items() if isinstance(value, str | int)}


def log_facts(flight: Flight) -> dict[str, Any]:
    """Versions, hardware, vehicle and times as entries of `metadata.json`."""
    times = flight_times(flight)
    return {
        "firmware": flight.release_name,
        "versions": _readable_info(flight, _VERSION_KEYS),
        "hardware": _readable_info(flight, _HARDWARE_KEYS),
        **vehicle_identity(flight).columns(),
        "recorded": recorded_at(flight),
        "duration_s": round(times.duration_s, 6),
        "airborne_s": None if times.airborne_s is None else round(times.airborne_s, 6),
    }
