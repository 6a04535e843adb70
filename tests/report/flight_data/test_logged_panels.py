"""What the vehicle logged, in the views: sensors, vibration, resets, frames, flags; figures by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fusetune.ekf2.replay.recording import FLAG_COLUMNS
from fusetune.px4.flight import Flight, LoggedMessage, ParameterChange, ParameterHistory, TopicKey, TopicTable
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.report.flight_data.bands import bands
from fusetune.report.flight_data.content import Panel
from fusetune.report.flight_data.events import events
from fusetune.report.flight_data.flag_words import FLAG_WORDS
from fusetune.report.flight_data.logged import Logged
from fusetune.report.flight_data.position_frame import PositionFrame, position_frame
from fusetune.report.flight_data.sensor_panels import (
    output_tracking_panels,
    reset_panel,
    sensor_panels,
    status_ratio_panel,
    vibration_panels,
)
from fusetune.report.flight_data.state_panels import Teller, motion_panels

START = 1_000_000
TIME = START + np.arange(5, dtype=np.int64) * 1_000_000
NORMAL_AND_UNTOLD = {
    *("cs_in_air", "cs_mag_dec", "cs_fixed_wing", "cs_mag_aligned_in_flight", "cs_synthetic_mag_z"),
    *("cs_rng_kin_consistent", "cs_mag_heading_consistent"),
}
"""What follows from other flags or says nothing of a flight."""


def single(*values: float) -> np.ndarray:
    return np.array(values, np.float32)


@pytest.fixture(scope="module")
def logged() -> Logged:
    """Five seconds of v1.16."""
    still = single(0.0, 0.0, 0.0, 0.0, 0.0)
    axes = {f"magnetometer_ga[{axis}]": single(*(one,) * 5) for axis, one in enumerate((0.2, 0.0, 0.4))}
    topics: dict[TopicKey, TopicTable] = {
        ("vehicle_magnetometer", 0): {"timestamp": TIME, "timestamp_sample": TIME, **axes},
        ("vehicle_imu_status", 0): {
            "timestamp": TIME,
            "accel_vibration_metric": single(1.0, 2.0, 9.0, 2.0, 1.0),
            "gyro_vibration_metric": still,
            "delta_angle_coning_metric": still,
            "accel_clipping[0]": np.array([250, 250, 253, 253, 253], np.uint32),
            "accel_clipping[1]": np.array([0, 0, 0, 1, 1], np.uint32),
        },
        ("vehicle_local_position", 0): {
            "timestamp": TIME,
            **dict.fromkeys(("x", "y", "z", "vx", "vy", "vz"), still),
            "xy_reset_counter": np.array([255, 255, 0, 0, 2], np.uint8),
            "z_reset_counter": np.array([3, 3, 4, 4, 4], np.uint8),
        },
        ("estimator_status", 0): {
            "timestamp": TIME,
            "vel_test_ratio": single(0.1, 0.2, 1.5, 0.2, 0.1),
            "tas_test_ratio": still,
            **{f"output_tracking_error[{axis}]": single(*(0.1 * axis,) * 5) for axis in range(3)},
            "gps_check_fail_flags": np.array([0, 1 << 3, 1 << 3, 1 << 9, 0], np.uint16),
        },
        ("estimator_status_flags", 0): {
            "timestamp": TIME,
            "cs_gnss_pos": np.array([0, 1, 1, 1, 1], np.uint8),
            "reject_hor_vel": np.array([0, 0, 1, 1, 0], np.uint8),
        },
        ("vehicle_status", 0): {
            "timestamp": TIME,
            "nav_state": np.array([4, 4, 3, 3, 18], np.uint8),
            "arming_state": np.array([1, 2, 2, 2, 1], np.uint8),
            "failsafe": np.array([0, 0, 0, 1, 1], np.uint8),
        },
        ("vehicle_gps_position", 0): {
            "timestamp": TIME,
            "latitude_deg": 47.0 + np.arange(5) * 1e-5,
            "longitude_deg": np.full(5, 8.0),
            "altitude_msl_m": np.full(5, 512.0),
            **dict.fromkeys(("vel_n_m_s", "vel_e_m_s", "vel_d_m_s"), still),
            **{name: single(*(one,) * 5) for name, one in (("eph", 0.7), ("epv", 1.1), ("s_variance_m_s", 0.2))},
            "fix_type": np.array([2, 3, 3, 3, 3], np.uint8),
            "satellites_used": np.array([9, 9, 9, 12, 12], np.uint8),
        },
    }
    flight = Flight(
        "made",
        topics=topics,
        info={"ver_sw_release": 0x011000FF},
        # all checks but that of vertical speed, whose bit is one lower than that of its flag
        parameters=ParameterHistory(
            initial={"EKF2_GPS_CHECK": 1023 & ~(1 << 8)},
            changed=[ParameterChange(int(TIME[3]), "EKF2_BARO_GATE", 3.0), ParameterChange(int(TIME[3]), "MPC_X", 1.0)],
        ),
        messages=[
            LoggedMessage(int(TIME[1]), "INFO", "logging"),
            LoggedMessage(int(TIME[2]), "INFO", "[ekf2] reset position to last known"),
            LoggedMessage(int(TIME[4]), "WARNING", "low battery"),
        ],
        start_timestamp=START,
        last_timestamp=int(TIME[-1]) + 1_000_000,
    )
    return Logged(flight, canonical(flight))


def by_id(*panels: Panel) -> dict[str, Panel]:
    return {one.id: one for one in panels}


def test_sensors_are_told_as_logged(logged: Logged) -> None:
    health: list[dict[str, Any]] = [
        {"id": "gnss.eph", "threshold": 3.0},
        {"id": "gnss.speed_accuracy", "threshold": None},
    ]
    panels = by_id(*sensor_panels(logged, health, None))
    assert set(panels) == {
        "mag.0", "mag.1", "mag.2", "mag_norm", "gnss_accuracy", "gnss_speed_accuracy", "gnss_satellites"
    }  # fmt: skip
    # √(0.2² + 0.4²)
    np.testing.assert_allclose(panels["mag_norm"].series[0].values, np.sqrt(0.2), rtol=1e-6)
    assert panels["gnss_accuracy"].limit == 3.0
    assert panels["gnss_speed_accuracy"].limit is None
    satellites, fix = panels["gnss_satellites"].series
    assert (satellites.draw, satellites.values.tolist()) == ("step", [9.0, 12.0, 12.0])
    assert satellites.time.tolist() == [TIME[0], TIME[3], TIME[4]]
    assert fix.values.tolist() == [2.0, 3.0, 3.0]


def test_vibration_has_its_limit_and_clipping_is_counted(logged: Logged) -> None:
    panels = by_id(*vibration_panels(logged, [{"id": "vibration.accel_peak", "threshold": 90.0}]))
    assert set(panels) == {"accel_vibration", "clipping"}, "what is zero throughout tells nothing"
    assert panels["accel_vibration"].limit == 90.0
    (clipped,) = panels["clipping"].series
    # three of the first axis, then one of the second
    assert clipped.values.tolist() == [0.0, 3.0, 4.0, 4.0]


def test_resets_are_counted_over_the_end_of_their_byte(logged: Logged) -> None:
    (panel,) = reset_panel(logged)
    found = {one.label: (one.time.tolist(), one.values.tolist()) for one in panel.series}
    assert found == {
        "horizontal position": ([TIME[0], TIME[2], TIME[4]], [0.0, 1.0, 3.0]),
        "height": ([TIME[0], TIME[2], TIME[4]], [0.0, 1.0, 1.0]),
    }


def test_the_filters_own_sums(logged: Logged) -> None:
    (ratios,) = status_ratio_panel(logged)
    assert [one.label for one in ratios.series] == ["velocity"]
    assert (ratios.kind, ratios.limit) == ("ratio", 1.0)
    tracking = by_id(*output_tracking_panels(logged))
    assert [(one.unit, one.series[0].values[0]) for one in tracking.values()] == [
        ("rad", 0.0), ("m/s", pytest.approx(0.1)), ("m", pytest.approx(0.2))
    ]  # fmt: skip


def test_modes_and_flags_are_bands(logged: Logged) -> None:
    found = {one.id: [(span.start, span.stop, span.words) for span in one.spans] for one in bands(logged, None, None)}
    last = int(TIME[-1]) + 1_000_000
    assert found == {
        "nav_state": [
            (TIME[0], TIME[2], "Hold"), (TIME[2], TIME[4], "Mission"), (TIME[4], last, "Land")
        ],
        "armed": [(TIME[1], TIME[4], "")],
        "failsafe": [(TIME[3], last, "")],
        "cs_gnss_pos": [(TIME[1], last, "")],
        "reject_hor_vel": [(TIME[2], TIME[4], "")],
        # bit 3 is horizontal accuracy; bit 9, vertical speed, is not asked for
        "gnss_check.3": [(TIME[1], TIME[3], "")],
    }  # fmt: skip


def test_events_in_the_order_of_time(logged: Logged) -> None:
    found = [(one.time, one.kind, one.title) for one in events(logged, None, None)]
    assert found == [
        (TIME[2], "message", "[ekf2] reset position to last known"),
        (TIME[2], "rejected", "horizontal velocity rejected; as flown"),
        (TIME[2], "reset", "reset of horizontal position, height; as flown"),
        (TIME[3], "failsafe", "failsafe"),
        (TIME[3], "parameter", "EKF2_BARO_GATE set to 3"),
        (TIME[4], "message", "low battery"),
        (TIME[4], "reset", "reset of horizontal position; as flown"),
    ]


def test_every_flag_of_the_replay_has_words_or_says_nothing() -> None:
    assert set(FLAG_COLUMNS) - set(FLAG_WORDS) == NORMAL_AND_UNTOLD


def test_fixes_stand_in_the_frame_of_the_replay_at_the_time_that_they_hold_for(logged: Logged) -> None:
    """1e-5 degrees of latitude are 6371000 m · 1e-5 · π / 180 = 1.112 m."""
    frame = position_frame({"origin": {"latitude_deg": 47.0, "longitude_deg": 8.0, "altitude_m": 500.0}}, None)
    gnss = logged.topic("vehicle_gps_position")
    assert gnss is not None
    found = frame.measured(gnss, 110_000)
    assert found is not None
    assert found.position is not None
    assert found.time.tolist() == (TIME[1:] - 110_000).tolist(), "the first has no three-dimensional fix"
    np.testing.assert_allclose(found.position[:, 0], 1.11195 * np.arange(1, 5), rtol=1e-4)
    np.testing.assert_allclose(found.position[:, 2], -12.0)


def test_positions_about_another_origin_are_moved() -> None:
    frame = PositionFrame((47.0, 8.0, 500.0))
    moved = frame.of_reference(np.zeros((2, 3)), (47.001, 8.0, 480.0))
    # a thousandth of a degree to the north, 20 m lower: down is positive
    np.testing.assert_allclose(moved, [[111.195, 0.0, 20.0]] * 2, atol=1e-3)
    local = {name: np.zeros(2) for name in ("x", "y", "z")}
    local |= {"ref_lat": np.array([np.nan, 47.001]), "ref_lon": np.array([np.nan, 8.0])}
    local |= {"ref_alt": np.array([np.nan, 480.0])}
    np.testing.assert_allclose(frame.of_vehicle(local), [[0.0, 0.0, 0.0], [111.195, 0.0, 20.0]], atol=1e-3)


def test_angles_are_those_of_the_quaternion_and_parted_where_they_turn_over() -> None:
    """A turn about one axis by an angle a is (cos a/2, sin a/2 along the axis); from 170° on by 20° is −170°."""
    half = np.radians([30.0, 20.0, 170.0, 190.0]) / 2.0
    axes = (1, 2, 3, 3)
    q = np.zeros((4, 4))
    q[:, 0] = np.cos(half)
    q[np.arange(4), axes] = np.sin(half)
    nowhere = np.full((4, 3), np.nan)
    one = Teller("one", "one", TIME[:4], nowhere, nowhere, TIME[:4], q)
    np.testing.assert_allclose(one.euler_deg, [[30, 0, 0], [0, 20, 0], [0, 0, 170], [0, 0, -170]], atol=1e-9)
    panels = by_id(*motion_panels([one], None, 0, PositionFrame(None)))
    assert set(panels) == {"attitude.0", "attitude.1", "attitude.2"}
    (heading,) = panels["attitude.2"].series
    np.testing.assert_allclose(heading.values, [0.0, 0.0, 170.0, np.nan, -170.0], atol=1e-9)
    assert heading.time.tolist() == [*TIME[:3], TIME[2] + 100, TIME[3]]
