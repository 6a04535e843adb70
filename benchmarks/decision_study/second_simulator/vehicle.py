"""What the autopilot tells of itself, and the ground truth as PX4's simulators log it."""

from __future__ import annotations

import numpy as np

from fusetune.px4.flight import TopicKey, TopicTable

from .imu import DEVICE_ID
from .truth import ALT_M, GROUNDTRUTH_EVERY, LAT_DEG, LON_DEG, Truth, on_the_map

ARMED_BEFORE_S, DISARMED_AFTER_S = 3.0, 2.0
NOTICED_S, LANDED_AFTER_S = 0.2, 1.0
STANDBY, ARMED, POSITION_MODE, ROTARY_WING = 1, 2, 2, 1
EVERY_US = 250_000


def vehicle_topics(truth: Truth) -> dict[TopicKey, TopicTable]:
    """Land detector, status and selected IMU, four times a second."""
    path = truth.path
    time_us = np.arange(round(truth.time_s[0] * 1e6) + 100_000, round(truth.time_s[-1] * 1e6), EVERY_US, dtype=np.int64)
    # The changes themselves are published when they come.
    changes = [path.takeoff_s + NOTICED_S, path.touchdown_s + LANDED_AFTER_S, *_armed(truth)]
    time_us = np.unique(np.r_[time_us, np.rint(np.array(changes) * 1e6).astype(np.int64)])
    time = time_us * 1e-6
    armed_s, disarmed_s = _armed(truth)
    landed = (time < path.takeoff_s + NOTICED_S - 1e-7) | (time >= path.touchdown_s + LANDED_AFTER_S - 1e-7)
    armed = (time >= armed_s - 1e-7) & (time < disarmed_s - 1e-7)
    no = np.zeros(time.size, np.bool_)
    velocity = truth.at(time, truth.velocity)
    low = truth.at(time, -truth.position[:, 2]) < 1.0
    return {
        ("vehicle_land_detected", 0): {
            "timestamp": time_us,
            "freefall": no,
            "ground_contact": landed,
            "maybe_landed": landed.copy(),
            "landed": landed.copy(),
            "in_ground_effect": ~landed & low,
            "in_descend": velocity[:, 2] > 0.4,
            "has_low_throttle": landed.copy(),
            "vertical_movement": np.abs(velocity[:, 2]) > 0.4,
            "horizontal_movement": np.hypot(velocity[:, 0], velocity[:, 1]) > 1.5,
            "rotational_movement": no.copy(),
            "close_to_ground_or_skipped_check": ~no,
            "at_rest": ~armed & landed,
        },
        ("vehicle_status", 0): {
            "timestamp": time_us.copy(),
            "armed_time": np.where(armed, round(armed_s * 1e6), 0).astype(np.uint64),
            "takeoff_time": np.where(armed & (time >= path.takeoff_s), round(path.takeoff_s * 1e6), 0).astype(
                np.uint64
            ),
            "arming_state": np.where(armed, ARMED, STANDBY).astype(np.uint8),
            "nav_state": np.full(time.size, POSITION_MODE, np.uint8),
            "vehicle_type": np.full(time.size, ROTARY_WING, np.uint8),
            "failsafe": no.copy(),
            "is_vtol": no.copy(),
            "in_transition_mode": no.copy(),
            "system_type": np.full(time.size, 2, np.uint8),
        },
        ("sensor_selection", 0): {
            "timestamp": time_us[:1].copy(),
            "accel_device_id": np.array([DEVICE_ID], np.uint32),
            "gyro_device_id": np.array([DEVICE_ID], np.uint32),
        },
    }


def _armed(truth: Truth) -> tuple[float, float]:
    return truth.path.takeoff_s - ARMED_BEFORE_S, truth.path.touchdown_s + DISARMED_AFTER_S


def armed_us(truth: Truth) -> int:
    """When the vehicle was armed, µs."""
    return round(_armed(truth)[0] * 1e6)


def groundtruth_topics(truth: Truth) -> dict[TopicKey, TopicTable]:
    """True attitude and local position at 50 Hz."""
    rows = slice(None, None, GROUNDTRUTH_EVERY)
    time_us = np.rint(truth.time_s[rows] * 1e6).astype(np.int64)
    x, y = on_the_map(truth.position[rows])
    quaternion = truth.attitude[rows].as_quat(canonical=True, scalar_first=True).astype(np.float32)
    local = np.column_stack([x, y, truth.position[rows, 2], truth.velocity[rows], truth.acceleration[rows]])
    names = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")
    stamps = {"timestamp": time_us, "timestamp_sample": time_us.copy()}
    return {
        ("vehicle_attitude_groundtruth", 0): {
            **stamps,
            **{f"q[{index}]": quaternion[:, index] for index in range(4)},
        },
        ("vehicle_local_position_groundtruth", 0): {
            **stamps,
            "ref_lat": np.full(time_us.size, LAT_DEG),
            "ref_lon": np.full(time_us.size, LON_DEG),
            "ref_alt": np.full(time_us.size, ALT_M, np.float32),
            **{name: local[:, index].astype(np.float32) for index, name in enumerate(names)},
        },
    }
