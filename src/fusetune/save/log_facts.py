"""Facts about a flight that people look for first: when it was recorded, how long, by which firmware on what."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from fusetune.px4.flight import Flight, TopicTable

_NAME_DATE = re.compile(r"(20\d\d)-(\d{1,2})-(\d{1,2})-(\d{1,2})-(\d{1,2})-(\d{1,2})")
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

    imu_s: float
    """From the first IMU sample to the last."""
    airborne_s: float | None
    """Time that the land detector calls airborne within that; `None` where the log has no land detector."""


def flight_times(flight: Flight) -> FlightTimes:
    """Times of a canonical or a raw flight."""
    imu = flight.topic("sensor_combined")
    if imu is None or not len(imu["timestamp"]):
        return FlightTimes(0.0, None)
    first, last = int(imu["timestamp"].min()), int(imu["timestamp"].max())
    return FlightTimes((last - first) * 1e-6, _airborne_s(flight.topic("vehicle_land_detected"), first, last))


def _airborne_s(land_detected: TopicTable | None, first: int, last: int) -> float | None:
    if land_detected is None or "landed" not in land_detected:
        return None
    order = np.argsort(land_detected["timestamp"], kind="stable")
    edges = np.clip(np.append(land_detected["timestamp"][order], last), first, last)
    in_air = ~land_detected["landed"][order].astype(np.bool_)
    return float(np.sum(np.diff(edges)[in_air])) * 1e-6


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


def log_facts(flight: Flight) -> dict[str, Any]:
    """Versions, hardware and times as entries of `metadata.json`."""
    times = flight_times(flight)
    return {
        "firmware": flight.release_name,
        "versions": {key: flight.info[key] for key in _VERSION_KEYS if key in flight.info},
        "hardware": {key: flight.info[key] for key in _HARDWARE_KEYS if key in flight.info},
        "recorded": recorded_at(flight),
        "duration_s": round(times.imu_s, 6),
        "airborne_s": None if times.airborne_s is None else round(times.airborne_s, 6),
    }
