"""Ground truth as PX4's simulators log it (`*_groundtruth`)."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fusetune.execute.world.earth import map_projection
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicKey, TopicTable

INTERVAL_US = 20_000


def groundtruth_topics(truth: Truth, geoid_undulation_m: float) -> dict[TopicKey, TopicTable]:
    """Attitude, angular velocity, local and global position of the body at 50 Hz.

    Velocity and attitude refer to north, east and down where the vehicle is. Local x and y are PX4's map projection
    about home, so that they compare with `vehicle_local_position`; altitudes of the reference are above mean sea level.
    """
    step_us = truth.timestamp_us[1] - truth.timestamp_us[0]
    rows = slice(None, None, int(INTERVAL_US // step_us))
    timestamp = truth.timestamp_us[rows]
    lat, lon, height = truth.frame.to_geodetic(truth.position[rows])
    axes = truth.frame.local_axes(lat, lon)
    velocity = np.einsum("nij,ni->nj", axes, truth.velocity[rows])
    acceleration = np.einsum("nij,ni->nj", axes, truth.acceleration[rows])
    attitude = Rotation.from_matrix(axes).inv() * truth.attitude[rows]
    return {
        ("vehicle_attitude_groundtruth", 0): _attitude(timestamp, attitude),
        ("vehicle_angular_velocity_groundtruth", 0): _angular_velocity(truth, timestamp),
        ("vehicle_global_position_groundtruth", 0): _global_position(timestamp, lat, lon, height, geoid_undulation_m),
        ("vehicle_local_position_groundtruth", 0): _local_position(
            truth,
            timestamp,
            (lat, lon, height - geoid_undulation_m),
            velocity,
            acceleration,
            attitude,
            geoid_undulation_m,
        ),
    }


def _stamped(timestamp: np.ndarray) -> TopicTable:
    return {"timestamp": timestamp.copy(), "timestamp_sample": timestamp.copy()}


def _columns(name: str, values: np.ndarray) -> TopicTable:
    single = values.astype(np.float32)
    return {f"{name}[{index}]": single[:, index] for index in range(values.shape[1])}


def _attitude(timestamp: np.ndarray, attitude: Rotation) -> TopicTable:
    quaternion = attitude.as_quat(canonical=True, scalar_first=True)
    return {
        **_stamped(timestamp),
        **_columns("q", quaternion),
        **_columns("delta_q_reset", np.tile([1.0, 0.0, 0.0, 0.0], (len(timestamp), 1))),
        "quat_reset_counter": np.zeros(len(timestamp), np.uint8),
    }


def _angular_velocity(truth: Truth, timestamp: np.ndarray) -> TopicTable:
    rate = truth.body_rate_at(timestamp)
    derivative = np.gradient(rate, timestamp * 1e-6, axis=0)
    return {**_stamped(timestamp), **_columns("xyz", rate), **_columns("xyz_derivative", derivative)}


def _global_position(
    timestamp: np.ndarray, lat: np.ndarray, lon: np.ndarray, height: np.ndarray, geoid_undulation_m: float
) -> TopicTable:
    samples = len(timestamp)
    zeros, valid = np.zeros(samples, np.float32), np.ones(samples, np.bool_)
    return {
        **_stamped(timestamp),
        "lat": np.degrees(lat),
        "lon": np.degrees(lon),
        "alt": (height - geoid_undulation_m).astype(np.float32),
        "alt_ellipsoid": height.astype(np.float32),
        "eph": zeros,
        "epv": zeros.copy(),
        "lat_lon_valid": valid,
        "alt_valid": valid.copy(),
        "dead_reckoning": ~valid,
    }


def _local_position(
    truth: Truth,
    timestamp: np.ndarray,
    place: tuple[np.ndarray, np.ndarray, np.ndarray],
    velocity: np.ndarray,
    acceleration: np.ndarray,
    attitude: Rotation,
    geoid_undulation_m: float,
) -> TopicTable:
    frame, samples = truth.frame, len(timestamp)
    reference_alt = frame.height_m - geoid_undulation_m
    x, y = map_projection(place[0], place[1], frame.lat_rad, frame.lon_rad)
    forward = attitude.apply([1.0, 0.0, 0.0])
    valid, single = np.ones(samples, np.bool_), np.float32
    return {
        **_stamped(timestamp),
        "ref_timestamp": np.full(samples, timestamp[0], np.uint64),
        "ref_lat": np.full(samples, np.degrees(frame.lat_rad)),
        "ref_lon": np.full(samples, np.degrees(frame.lon_rad)),
        "x": x.astype(single),
        "y": y.astype(single),
        "z": (reference_alt - place[2]).astype(single),
        "vx": velocity[:, 0].astype(single),
        "vy": velocity[:, 1].astype(single),
        "vz": velocity[:, 2].astype(single),
        "z_deriv": velocity[:, 2].astype(single),
        "ax": acceleration[:, 0].astype(single),
        "ay": acceleration[:, 1].astype(single),
        "az": acceleration[:, 2].astype(single),
        "heading": np.arctan2(forward[:, 1], forward[:, 0]).astype(single),
        "ref_alt": np.full(samples, reference_alt, single),
        "xy_valid": valid,
        "z_valid": valid.copy(),
        "v_xy_valid": valid.copy(),
        "v_z_valid": valid.copy(),
        "xy_global": valid.copy(),
        "z_global": valid.copy(),
        "dead_reckoning": ~valid,
    }
