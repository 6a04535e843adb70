"""Drift of GNSS while the vehicle stands, against the formula of PX4's checks and against what PX4 logged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from fusetune.analyze.health.gnss_drift import drift_at_rest
from fusetune.px4.flight import TopicTable
from fusetune.px4.ulog.reader import read_ulog

LIMITS = {"EKF2_REQ_HDRIFT": 0.1, "EKF2_REQ_VDRIFT": 0.2}
METRES_PER_DEGREE = 6_371_000.0 * np.pi / 180.0


def standing(seconds: float, north_m_s: float, up_m_s: float, reported_m_s: float = 0.0) -> TopicTable:
    """A receiver at 5 Hz that wanders evenly."""
    time = np.arange(0, round(seconds * 5) + 1) * 200_000 + 10_000_000
    elapsed = (time - time[0]) * 1e-6
    return {
        "timestamp": time,
        "latitude_deg": 47.0 + north_m_s * elapsed / METRES_PER_DEGREE,
        "longitude_deg": np.full(len(time), 8.0),
        "altitude_msl_m": 500.0 + up_m_s * elapsed,
        "vel_n_m_s": np.full(len(time), reported_m_s),
        "vel_e_m_s": np.zeros(len(time)),
        "fix_type": np.full(len(time), 3),
    }


def test_an_even_drift_is_approached_as_by_a_first_order_filter_of_ten_seconds():
    table = standing(30.0, north_m_s=0.05, up_m_s=0.1, reported_m_s=0.02)
    drift = drift_at_rest(table, np.ones(len(table["timestamp"]), bool), LIMITS)
    # x after n steps of 0.2 s: v (1 - (1 - 0.02)^n); the first sample has no other to drift from
    steps = np.arange(len(table["timestamp"]))
    np.testing.assert_allclose(drift.drift_horizontal, 0.05 * (1 - 0.98**steps), rtol=1e-4)
    np.testing.assert_allclose(drift.drift_vertical, 0.1 * (1 - 0.98**steps), rtol=1e-4)
    np.testing.assert_allclose(drift.speed_at_rest[1:], 0.02 * (1 - 0.98 ** steps[1:]), rtol=2e-2)
    assert drift.settled.sum() == np.sum((table["timestamp"] - table["timestamp"][0]) >= 10_000_000)


def test_a_jump_counts_no_more_than_ten_times_the_limit():
    table = standing(20.0, 0.0, 0.0)
    table["latitude_deg"][50:] += 100.0 / METRES_PER_DEGREE
    drift = drift_at_rest(table, np.ones(len(table["timestamp"]), bool), LIMITS)
    assert drift.drift_horizontal.max() == pytest.approx(10 * 0.1 * 0.02)


def test_it_begins_anew_when_the_vehicle_moved():
    table = standing(40.0, 0.05, 0.0)
    rest = np.ones(len(table["timestamp"]), bool)
    rest[100:110] = False
    drift = drift_at_rest(table, rest, LIMITS)
    assert drift.drift_horizontal[100] == pytest.approx(0.05 * 0.02, rel=1e-3)
    assert not drift.settled[100]
    assert drift_at_rest(table, np.zeros(len(rest), bool), LIMITS) is None


def test_px4_logged_the_same(shared_logs: Path):
    """`estimator_gps_status` of a simulated flight, some seconds after its log began: the vehicle had stood before."""
    (path,) = shared_logs.glob("erdemarslan380__sitl_max_80*")
    logged = ULog(str(path)).get_dataset("estimator_gps_status").data
    flight = read_ulog(path)
    table, flags = (flight.topic(name) for name in ("vehicle_gps_position", "estimator_status_flags"))
    moved = flags["timestamp"][np.argmax(flags["cs_in_air"])]
    drift = drift_at_rest(table, table["timestamp"] < moved, LIMITS)
    late = drift.time > drift.time[0] + 3_500_000
    theirs = np.interp(drift.time[late], logged["timestamp"], logged["position_drift_rate_horizontal_m_s"])
    speeds = np.interp(drift.time[late], logged["timestamp"], logged["filtered_horizontal_speed_m_s"])
    assert np.median(drift.drift_horizontal[late]) == pytest.approx(np.median(theirs), abs=5e-4)
    assert np.median(drift.speed_at_rest[late]) == pytest.approx(np.median(speeds), abs=8e-4)
