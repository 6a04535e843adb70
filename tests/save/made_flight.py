"""A flight that passes every check, to be spoiled."""

from __future__ import annotations

import numpy as np

from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.release_layouts import canonical
from fusetune.save.verdict import Check, Verdict, VerdictThresholds, judge

SLOW_HZ = 20
TAKE_OFF_ROW, LANDING_ROW = 240, 840
"""Rows of the slow topics: 12 s and 42 s after the first IMU sample, so 30 s in the air."""


def made_flight(seconds: float = 60.0, rate_hz: int = 200) -> Flight:
    """All sensors at rest; flights of less than 45 s have no land detector."""
    time = 1_000_000 + np.arange(int(seconds * rate_hz), dtype=np.int64) * (1_000_000 // rate_hz)
    rows = len(time)
    vectors = {
        f"{name}[{axis}]": np.zeros(rows, np.float32)
        for name in ("gyro_rad", "accelerometer_m_s2")
        for axis in range(3)
    }
    steps = np.full(rows, 1_000_000 // rate_hz, np.uint32)
    imu = {"timestamp": time, "gyro_integral_dt": steps, "accelerometer_integral_dt": steps.copy(), **vectors}
    slow = np.arange(int(seconds * SLOW_HZ), dtype=np.int64) * (1_000_000 // SLOW_HZ) + 1_000_000
    place = {"latitude_deg": 47.0, "longitude_deg": 8.0, "altitude_msl_m": 500.0}
    fix = {name: np.full(len(slow), value) for name, value in place.items()}
    fix |= {name: np.full(len(slow), 0.4, np.float32) for name in ("eph", "epv", "s_variance_m_s")}
    fix |= {f"vel_{axis}_m_s": np.zeros(len(slow), np.float32) for axis in "ned"}
    fix |= {"fix_type": np.full(len(slow), 3, np.uint8), "satellites_used": np.full(len(slow), 12, np.uint8)}
    mag = {f"magnetometer_ga[{axis}]": np.zeros(len(slow), np.float32) for axis in range(3)}
    level = {f"q[{i}]": np.full(len(slow), float(i == 0), np.float32) for i in range(4)}
    topics = {
        ("sensor_combined", 0): imu,
        ("vehicle_gps_position", 0): {"timestamp": slow, **fix},
        ("vehicle_magnetometer", 0): {"timestamp": slow, **mag},
        ("vehicle_attitude", 0): {"timestamp": slow, **level},
        ("vehicle_air_data", 0): {"timestamp": slow, "baro_alt_meter": np.zeros(len(slow), np.float32)},
        ("estimator_status", 0): {"timestamp": slow, "control_mode_flags": np.zeros(len(slow), np.uint32)},
        ("sensor_selection", 0): {"timestamp": slow[[0, -1]], "accel_device_id": np.array([1, 1], np.uint32)},
        ("ekf2_timestamps", 0): {"timestamp": time},
    }
    if seconds > 45:
        landed = np.array([True, False, True])
        rows_of_land = [0, TAKE_OFF_ROW, LANDING_ROW]
        topics["vehicle_land_detected", 0] = {"timestamp": slow[rows_of_land], "landed": landed}
    history = ParameterHistory({"EKF2_GPS_CTRL": 7, "SDLOG_PROFILE": 3, "SDLOG_MODE": 2})
    return Flight("made", topics, history, info={"ver_sw_release": 0x011000FF}, last_timestamp=int(time[-1]))


def judged(flight: Flight, thresholds: VerdictThresholds | None = None) -> Verdict:
    """Verdict on a flight as it is read."""
    return judge(canonical(flight), thresholds)


def check_of(flight: Flight, name: str) -> Check:
    """One check of a flight."""
    return next(check for check in judged(flight).checks if check.name == name)
