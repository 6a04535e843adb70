"""What the autopilot says about itself: land detector, arming, selected sensors."""

from __future__ import annotations

import numpy as np

from fusetune.execute.world.flight_plan import FlightPlan
from fusetune.execute.world.truth import THRUST_RAMP_S, Truth
from fusetune.px4.flight import TopicTable

ACCELEROMETER_ID = 2490378
GYRO_ID = 2490378
STANDBY, ARMED = 1, 2
ROTARY_WING = 1
AUTO_LOITER, AUTO_MISSION, AUTO_LAND = 4, 3, 18
ARMED_BY_MISSION, DISARMED_BY_LAND_DETECTOR = 13, 6

LAND_DETECTOR_INTERVAL_US = 1_000_000
STATUS_INTERVAL_US = 500_000
TAKEOFF_NOTICED_S = 0.15
GROUND_CONTACT_AFTER_S, MAYBE_LANDED_AFTER_S, LANDED_AFTER_S = 0.35, 0.7, 1.0
AT_REST_AFTER_S = 1.0
"""After the rotors stopped."""
DESCENT_SPEED_M_S = 0.33
HORIZONTAL_MOVEMENT_M_S = 1.5
MOVEMENT_CHECK_US = 20_000


def vehicle_land_detected(plan: FlightPlan, truth: Truth) -> TopicTable:
    """Land detector as PX4's for multicopters decides, published at changes and every second.

    Landed ends as soon as the vehicle leaves the ground and begins a second after touch-down; at rest holds while the
    rotors do not turn; ground effect is assumed while thrust is built up for take-off and while the vehicle is meant to
    sink without moving sideways.
    """
    events = plan.events
    grid_us = np.arange(truth.timestamp_us[0], truth.timestamp_us[-1], MOVEMENT_CHECK_US, dtype=np.int64)
    time_s = grid_us * 1e-6
    meant = plan.path.evaluate(time_s, 1)
    on_ground_again = time_s - events.touchdown_s
    before_takeoff = time_s < events.takeoff_s + TAKEOFF_NOTICED_S
    landed = before_takeoff | (on_ground_again > LANDED_AFTER_S)
    descending = (meant[:, 2] >= DESCENT_SPEED_M_S) & (np.hypot(meant[:, 0], meant[:, 1]) < HORIZONTAL_MOVEMENT_M_S)
    ramping_up = (time_s >= events.takeoff_s - THRUST_RAMP_S) & before_takeoff
    at_rest = (time_s < events.armed_s) | (time_s > events.disarmed_s + AT_REST_AFTER_S)
    flags = {
        "freefall": np.zeros_like(landed),
        "ground_contact": before_takeoff | (on_ground_again > GROUND_CONTACT_AFTER_S),
        "maybe_landed": before_takeoff | (on_ground_again > MAYBE_LANDED_AFTER_S),
        "landed": landed,
        "in_ground_effect": descending | ramping_up,
        "in_descend": descending,
        "has_low_throttle": landed & ~ramping_up,
        "vertical_movement": np.abs(meant[:, 2]) > DESCENT_SPEED_M_S,
        "horizontal_movement": np.hypot(meant[:, 0], meant[:, 1]) > HORIZONTAL_MOVEMENT_M_S,
        "rotational_movement": np.zeros_like(landed),
        "close_to_ground_or_skipped_check": np.ones_like(landed),
        "at_rest": at_rest,
    }
    return _published(grid_us, flags, LAND_DETECTOR_INTERVAL_US)


def vehicle_status(plan: FlightPlan, truth: Truth) -> TopicTable:
    """Arming state and flight mode, published at changes and twice a second."""
    events = plan.events
    grid_us = np.arange(truth.timestamp_us[0], truth.timestamp_us[-1], MOVEMENT_CHECK_US, dtype=np.int64)
    time_s = grid_us * 1e-6
    armed = (time_s >= events.armed_s) & (time_s < events.disarmed_s)
    was_armed, was_disarmed = time_s >= events.armed_s, time_s >= events.disarmed_s
    taken_off = (time_s >= events.takeoff_s) & ~was_disarmed
    fields: TopicTable = {
        "armed_time": np.where(armed, round(events.armed_s * 1e6), 0).astype(np.uint64),
        "takeoff_time": np.where(taken_off, round(events.takeoff_s * 1e6), 0).astype(np.uint64),
        "nav_state_timestamp": np.where(was_armed, round(events.armed_s * 1e6), grid_us[0]).astype(np.uint64),
        "arming_state": np.where(armed, ARMED, STANDBY).astype(np.uint8),
        "latest_arming_reason": np.where(was_armed, ARMED_BY_MISSION, 0).astype(np.uint8),
        "latest_disarming_reason": np.where(was_disarmed, DISARMED_BY_LAND_DETECTOR, 0).astype(np.uint8),
        "nav_state": np.where(armed, AUTO_MISSION, AUTO_LOITER).astype(np.uint8),
        "nav_state_user_intention": np.where(armed, AUTO_MISSION, AUTO_LOITER).astype(np.uint8),
        "pre_flight_checks_pass": np.ones(len(grid_us), np.bool_),
        "vehicle_type": np.full(len(grid_us), ROTARY_WING, np.uint8),
        "failsafe": np.zeros(len(grid_us), np.bool_),
        "is_vtol": np.zeros(len(grid_us), np.bool_),
        "is_vtol_tailsitter": np.zeros(len(grid_us), np.bool_),
        "in_transition_mode": np.zeros(len(grid_us), np.bool_),
        "in_transition_to_fw": np.zeros(len(grid_us), np.bool_),
        "system_type": np.full(len(grid_us), 2, np.uint8),
        "system_id": np.ones(len(grid_us), np.uint8),
        "component_id": np.ones(len(grid_us), np.uint8),
    }
    return _published(grid_us, fields, STATUS_INTERVAL_US)


def sensor_selection(truth: Truth) -> TopicTable:
    """The one IMU that there is, told once."""
    return {
        "timestamp": truth.timestamp_us[:1].copy(),
        "accel_device_id": np.array([ACCELEROMETER_ID], np.uint32),
        "gyro_device_id": np.array([GYRO_ID], np.uint32),
    }


def _published(grid_us: np.ndarray, fields: TopicTable, interval_us: int) -> TopicTable:
    """Messages at every change of a field and at the latest after an interval."""
    changed = np.zeros(len(grid_us), np.bool_)
    changed[0] = True
    for values in fields.values():
        changed[1:] |= values[1:] != values[:-1]
    changed[:: max(interval_us // MOVEMENT_CHECK_US, 1)] = True
    return {"timestamp": grid_us[changed], **{name: values[changed] for name, values in fields.items()}}
