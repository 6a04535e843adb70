"""A flight along a track whose sensors measure without any error, at the times and with the delays of a design.

EKF2 that is given it finds no innovations, so it never leaves the track, and what its own code does to P is the
covariance recursion alone: F, H and the timing are the track's and the design's, Q and R what the parameters say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from fusetune.design.covariance.ekf2_sensors import Ekf2Sensor
from fusetune.design.covariance.track import Track
from fusetune.ekf2.numerics.geodesy import metres_per_radian
from fusetune.ekf2.numerics.world_magnetic_model import (
    get_mag_declination_degrees,
    get_mag_inclination_degrees,
    get_mag_strength_gauss,
)
from fusetune.px4.flight import Flight, TopicKey, TopicTable
from fusetune.px4.layouts.sensor_layouts import STANDARD_AIR_DENSITY_KG_M3
from fusetune.px4.releases import BASELINE

Times = npt.NDArray[np.int64]

HALF_INTERVAL_US = 5_000
"""EKF2 takes half an update interval off every time of arrival, so an exact measurement arrives as much later."""
ARMED, STANDBY, ROTARY_WING = 2, 1, 1
FIX_3D, SATELLITES, ACCURATE = 3, 20, 0.01
"""A receiver that reports next to no error: the parameters, which are floors, count."""
STATUS_INTERVAL_US = 500_000
GROUND_DISTANCE_M = 0.1
"""Of range finder and flow sensor when the vehicle stands."""
LONGEST_RANGE_M = 100.0
FASTEST_FLOW_RAD_S = 20.0
DOWNWARD_FACING, LOCAL_NED = 25, 1
RELEASE = BASELINE[0] << 24 | BASELINE[1] << 16 | 255


def perfect_flight(track: Track, sensors: Mapping[str, Ekf2Sensor], parameters: Mapping[str, float]) -> Flight:
    """All that EKF2 is given along a track.

    Parameters
    ----------
    sensors : by names of `ekf2_sensors.DESIGNED`; those that are not used tell nothing
    parameters : a complete set

    Returns
    -------
    Flight
        In the layout of v1.16.
    """
    topics: dict[TopicKey, TopicTable] = {("sensor_combined", 0): _imu(track)}
    topics |= {("vehicle_land_detected", 0): _land_detector(track), ("vehicle_status", 0): _status(track)}
    for name, sensor in sensors.items():
        if sensor.used:
            times = sample_times(track, sensor)
            topic, measure = _MEASURED[name]
            arrival = times + round(1e3 * sensor.delay_ms) + HALF_INTERVAL_US
            topics[topic, 0] = {"timestamp": arrival, **measure(track, times, sensor)}
    flight = Flight(name=track.name, topics=topics, info={"ver_sw_release": RELEASE})
    flight.parameters.initial = dict(parameters)
    flight.start_timestamp, flight.last_timestamp = int(track.timestamp_us[0]), int(track.timestamp_us[-1])
    return flight


def sample_times(track: Track, sensor: Ekf2Sensor) -> Times:
    """When a sensor measures, (K,) µs."""
    first, last = track.timestamp_us[[0, -1]]
    count = math.floor((last - first) * 1e-6 * sensor.rate_hz)
    return np.asarray(first + np.rint(np.arange(1, count + 1) * 1e6 / sensor.rate_hz), dtype=np.int64)


def _columns(name: str, values: np.ndarray) -> TopicTable:
    return {f"{name}[{axis}]": values[:, axis] for axis in range(values.shape[1])}


def _imu(track: Track) -> TopicTable:
    interval_us = np.diff(track.timestamp_us).astype(np.uint32)
    rows = len(interval_us)
    ones = np.ones(rows, np.uint8)
    return {
        "timestamp": track.timestamp_us[1:],
        **_columns("gyro_rad", track.angular_rate[1:].astype(np.float32)),
        "gyro_integral_dt": interval_us,
        "accelerometer_timestamp_relative": np.zeros(rows, np.int32),
        **_columns("accelerometer_m_s2", track.specific_force[1:].astype(np.float32)),
        "accelerometer_integral_dt": interval_us.copy(),
        "accelerometer_clipping": np.zeros(rows, np.uint8),
        "gyro_clipping": np.zeros(rows, np.uint8),
        "accel_calibration_count": ones,
        "gyro_calibration_count": ones.copy(),
    }


def _told_rows(track: Track) -> npt.NDArray[np.int64]:
    """Rows at which the vehicle tells of itself: at changes and now and then."""
    changed = (np.diff(track.in_air.astype(int), prepend=-1) != 0) | (
        np.diff(track.at_rest.astype(int), prepend=-1) != 0
    )
    every = np.diff(track.timestamp_us // STATUS_INTERVAL_US, prepend=-1) > 0
    return np.flatnonzero(changed | every)


def _land_detector(track: Track) -> TopicTable:
    rows = _told_rows(track)
    return {
        "timestamp": track.timestamp_us[rows],
        "landed": ~track.in_air[rows],
        "at_rest": track.at_rest[rows],
        "in_ground_effect": np.zeros(len(rows), np.bool_),
    }


def _status(track: Track) -> TopicTable:
    rows = _told_rows(track)
    return {
        "timestamp": track.timestamp_us[rows],
        "arming_state": np.where(track.at_rest[rows], STANDBY, ARMED).astype(np.uint8),
        "vehicle_type": np.full(len(rows), ROTARY_WING, np.uint8),
    }


def _gnss(track: Track, times: Times, sensor: Ekf2Sensor) -> TopicTable:
    position, velocity = track.at(times, track.position), track.at(times, track.velocity)
    lat_rad = math.radians(track.origin.lat_deg)
    north_m, east_m = metres_per_radian(lat_rad, track.origin.alt_m)
    rows = len(times)
    return {
        "latitude_deg": track.origin.lat_deg + np.degrees(position[:, 0] / north_m),
        "longitude_deg": track.origin.lon_deg + np.degrees(position[:, 1] / east_m),
        "altitude_msl_m": track.origin.alt_m - position[:, 2],
        **{name: velocity[:, axis] for axis, name in enumerate(("vel_n_m_s", "vel_e_m_s", "vel_d_m_s"))},
        **{name: np.full(rows, ACCURATE) for name in ("eph", "epv", "s_variance_m_s", "hdop", "vdop")},
        "heading": np.full(rows, np.nan),
        "fix_type": np.full(rows, FIX_3D, np.uint8),
        "satellites_used": np.full(rows, SATELLITES, np.uint8),
        "vel_ned_valid": np.ones(rows, np.bool_),
    }


def _magnetometer(track: Track, times: Times, sensor: Ekf2Sensor) -> TopicTable:
    """The field that EKF2's own table of the world magnetic model has at the origin."""
    place = track.origin.lat_deg, track.origin.lon_deg
    declination, inclination = (
        math.radians(one(*place)) for one in (get_mag_declination_degrees, get_mag_inclination_degrees)
    )
    level = math.cos(inclination)
    field = get_mag_strength_gauss(*place) * np.array(
        [level * math.cos(declination), level * math.sin(declination), math.sin(inclination)]
    )
    return {
        **_columns("magnetometer_ga", track.body_from_ned_at(times) @ field),
        "device_id": np.ones(len(times), np.uint32),
    }


def _barometer(track: Track, times: Times, sensor: Ekf2Sensor) -> TopicTable:
    return {
        "baro_alt_meter": track.origin.alt_m - track.at(times, track.position)[:, 2],
        "baro_device_id": np.ones(len(times), np.uint32),
        "rho": np.full(len(times), STANDARD_AIR_DENSITY_KG_M3),
    }


def _distance(track: Track, times: Times) -> np.ndarray:
    """To flat ground as high as the origin along the body's down axis, (K,) m."""
    height = GROUND_DISTANCE_M - track.at(times, track.position)[:, 2]
    cos_tilt = track.body_from_ned_at(times)[:, 2, 2]
    return np.asarray(np.maximum(height, GROUND_DISTANCE_M) / np.maximum(cos_tilt, 0.1))


def _range_finder(track: Track, times: Times, sensor: Ekf2Sensor) -> TopicTable:
    rows = len(times)
    return {
        "current_distance": _distance(track, times),
        "min_distance": np.full(rows, 0.5 * GROUND_DISTANCE_M),
        "max_distance": np.full(rows, LONGEST_RANGE_M),
        "signal_quality": np.full(rows, 100, np.int8),
        "orientation": np.full(rows, DOWNWARD_FACING, np.uint8),
    }


def _optical_flow(track: Track, times: Times, sensor: Ekf2Sensor) -> TopicTable:
    """With u the velocity in the body frame and d the distance, ω_x - u_y / d and ω_y + u_x / d.

    EKF2 counts a sample for the middle of its integration, which here is the time of the measurement; so it is stamped
    half of the integration later.
    """
    span_us = round(1e6 / sensor.rate_hz)
    through = np.einsum("nij,nj->ni", track.body_from_ned_at(times), track.at(times, track.velocity))
    rate = track.at(times, track.angular_rate)
    flow = rate[:, :2] + np.column_stack([-through[:, 1], through[:, 0]]) / _distance(track, times)[:, None]
    rows = len(times)
    return {
        "timestamp": times + round(1e3 * sensor.delay_ms) + HALF_INTERVAL_US + span_us // 2,
        **_columns("pixel_flow", flow * span_us * 1e-6),
        **_columns("delta_angle", rate * span_us * 1e-6),
        "integration_timespan_us": np.full(rows, span_us, np.uint32),
        "quality": np.full(rows, 255, np.uint8),
        "max_flow_rate": np.full(rows, FASTEST_FLOW_RAD_S),
        "min_ground_distance": np.full(rows, 0.5 * GROUND_DISTANCE_M),
        "max_ground_distance": np.full(rows, LONGEST_RANGE_M),
    }


def _vision(track: Track, times: Times, sensor: Ekf2Sensor) -> TopicTable:
    rows = len(times)
    table = {
        **_columns("position", track.at(times, track.position)),
        **_columns("velocity", track.at(times, track.velocity)),
        **_columns("q", track.attitude_at(times)),
        "pose_frame": np.full(rows, LOCAL_NED, np.uint8),
        "velocity_frame": np.full(rows, LOCAL_NED, np.uint8),
        "reset_counter": np.zeros(rows, np.uint8),
        "quality": np.full(rows, 100, np.int8),
    }
    for name in ("position_variance", "velocity_variance", "orientation_variance"):
        table |= _columns(name, np.full((rows, 3), ACCURATE**2))
    return table


def _airspeed(track: Track, times: Times, sensor: Ekf2Sensor) -> TopicTable:
    """In still air."""
    speed = np.linalg.norm(track.at(times, track.velocity), axis=1)
    return {
        "true_airspeed_m_s": speed,
        "calibrated_airspeed_m_s": speed.copy(),
        "airspeed_source": np.ones(len(times), np.int8),
    }


_MEASURED: Mapping[str, tuple[str, Callable[[Track, Times, Ekf2Sensor], TopicTable]]] = {
    "gnss": ("vehicle_gps_position", _gnss),
    "mag": ("vehicle_magnetometer", _magnetometer),
    "baro": ("vehicle_air_data", _barometer),
    "range": ("distance_sensor", _range_finder),
    "flow": ("vehicle_optical_flow", _optical_flow),
    "ev": ("vehicle_visual_odometry", _vision),
    "airspeed": ("airspeed_validated", _airspeed),
}
