"""A flight that passes every check, to be spoiled."""

from __future__ import annotations

import numpy as np

from fusetune.finding import Finding
from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.save.thresholds import VerdictThresholds
from fusetune.save.verdict import Verdict, judge

SLOW_HZ = 20
TAKE_OFF_ROW, LANDING_ROW = 240, 840
"""Rows of the slow topics: 12 s and 42 s after the first IMU sample, so 30 s in the air."""


def made_flight(seconds: float = 60.0, rate_hz: int = 200) -> Flight:
    """All sensors at rest, with their noise; flights of less than 45 s have no land detector."""
    rng = np.random.default_rng(0)

    def noisy(mean: float, deviation: float, count: int) -> np.ndarray:
        return (mean + deviation * rng.standard_normal(count)).astype(np.float32)

    time = 1_000_000 + np.arange(int(seconds * rate_hz), dtype=np.int64) * (1_000_000 // rate_hz)
    rows = len(time)
    vectors = {
        f"{name}[{axis}]": noisy(mean * (axis == 2), deviation, rows)
        for name, mean, deviation in (("gyro_rad", 0.0, 0.01), ("accelerometer_m_s2", -9.81, 0.05))
        for axis in range(3)
    }
    steps = np.full(rows, 1_000_000 // rate_hz, np.uint32)
    imu = {"timestamp": time, "gyro_integral_dt": steps, "accelerometer_integral_dt": steps.copy(), **vectors}
    slow = np.arange(int(seconds * SLOW_HZ), dtype=np.int64) * (1_000_000 // SLOW_HZ) + 1_000_000
    fix = {name: np.full(len(slow), 0.4, np.float32) for name in ("eph", "epv", "s_variance_m_s")}
    fix |= {"fix_type": np.full(len(slow), 3, np.uint8), "satellites_used": np.full(len(slow), 12, np.uint8)}
    fix |= {f"vel_{axis}_m_s": noisy(0.0, 0.05, len(slow)) for axis in "ned"}
    fix |= {
        "latitude_deg": 47.397742 + 1e-6 * rng.standard_normal(len(slow)),
        "longitude_deg": 8.545594 + 1e-6 * rng.standard_normal(len(slow)),
        "altitude_msl_m": 488.0 + 0.1 * rng.standard_normal(len(slow)),
    }
    field = (0.21, 0.01, 0.43)
    mag = {f"magnetometer_ga[{axis}]": noisy(field[axis], 0.003, len(slow)) for axis in range(3)}
    level = {f"q[{i}]": np.full(len(slow), float(i == 0), np.float32) for i in range(4)}
    topics = {
        ("sensor_combined", 0): imu,
        ("vehicle_gps_position", 0): {"timestamp": slow, **fix},
        ("vehicle_magnetometer", 0): {"timestamp": slow, **mag},
        ("vehicle_attitude", 0): {"timestamp": slow, **level},
        ("vehicle_air_data", 0): {"timestamp": slow, "baro_alt_meter": noisy(0.0, 0.1, len(slow))},
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


def check_of(flight: Flight, name: str) -> Finding:
    """One check of a flight."""
    return next(check for check in judged(flight).findings if check.id == name)
