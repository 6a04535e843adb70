"""What a flight can be compared with: ground truth of a simulation, an RTK receiver, motion capture or vision.

A reference must not be what the filter was fed with. Motion capture (`vehicle_mocap_odometry`) never is; vision counts
while no parameter set fuses it; an RTK receiver counts as `rtk` where it is another device than the one that the
estimator used. The RTK receiver that is fused itself is kept under its own name, `rtk_fed`: EKF2's floors make its
noise decimetres in the filter while it errs by centimetres, so the error against it does tell lag and smoothing – but
not accuracy, as the filter is drawn to it.
"""

from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.ground_truth import Truth, read_truth, sample_times
from fusetune.ekf2.numerics.constants import RADIUS_OF_EARTH
from fusetune.px4.flight import Flight, TopicTable, stacked
from fusetune.px4.layouts import sensor_layouts
from fusetune.quaternions import rotation_matrix

Array = npt.NDArray[np.float64]

GROUND_TRUTH_TOPICS = ("vehicle_local_position_groundtruth", "vehicle_attitude_groundtruth")

TRUTH_TOPICS = (
    *GROUND_TRUTH_TOPICS,
    "vehicle_mocap_odometry",
    "vehicle_visual_odometry",
    "vehicle_gps_position",
    "sensor_gps",
)
EARTH_RADIUS_M = RADIUS_OF_EARTH
"""Radius of PX4's map projection."""

RTK_FIXED = 6
_RTK_SHARE = 0.9
"""A receiver serves as truth where this share of its samples has carrier-phase ambiguities fixed."""
_POSE_NED, _POSE_FRD, _VELOCITY_BODY = 1, 2, 3


def read_references(flight: Flight, fused: Collection[str], parameters: Mapping[str, float]) -> list[Truth]:
    """Everything that the flight can be compared with.

    Parameters
    ----------
    flight : canonical, with `TRUTH_TOPICS`
    fused : aid sources that any parameter set fused
    parameters : of the present set: delay and place of the GNSS antenna
    """
    found = [read_truth(flight), rtk_reference(flight, parameters)]
    mocap = flight.topic("vehicle_mocap_odometry")
    if mocap is not None:
        found.append(odometry_reference(sensor_layouts.vehicle_visual_odometry(mocap), "mocap"))
    vision = flight.topic("vehicle_visual_odometry")
    if vision is not None and not any(source.startswith("ev_") for source in fused):
        found.append(odometry_reference(vision, "vision"))
    return [one for one in found if one is not None]


def rtk_reference(flight: Flight, parameters: Mapping[str, float]) -> Truth | None:
    """Position and velocity of a receiver with fixed ambiguities (fix_type 6), else None.

    Its time is that of receipt less EKF2_GPS_DELAY. A receiver that the estimator was not fed with goes first.
    """
    used = flight.topic("vehicle_gps_position")
    device = None if used is None or "device_id" not in used else set(np.unique(used["device_id"]).tolist())
    candidates = []
    for instance in flight.instances("sensor_gps"):
        table = sensor_layouts.vehicle_gps_position(flight.topics["sensor_gps", instance])
        independent = device is not None and "device_id" in table and not device & set(table["device_id"].tolist())
        if independent:
            candidates.append(("rtk", table))
    if used is not None:
        candidates.append(("rtk_fed", used))
    for kind, table in candidates:
        truth = _rtk(kind, table, parameters)
        if truth is not None:
            return truth
    return None


def _rtk(kind: str, table: TopicTable, parameters: Mapping[str, float]) -> Truth | None:
    if "fix_type" not in table or "latitude_deg" not in table or table["timestamp"].size < 2:
        return None
    fixed = table["fix_type"] == RTK_FIXED
    if np.mean(fixed) < _RTK_SHARE:
        return None
    latitude, longitude, altitude = (
        table[name][fixed].astype(np.float64) for name in ("latitude_deg", "longitude_deg", "altitude_msl_m")
    )
    origin = float(latitude[0]), float(longitude[0]), float(altitude[0])
    north = np.radians(latitude - origin[0]) * EARTH_RADIUS_M
    east = np.radians(longitude - origin[1]) * EARTH_RADIUS_M * np.cos(np.radians(origin[0]))
    velocity = np.column_stack([table[f"vel_{axis}_m_s"][fixed] for axis in "ned"]).astype(np.float64)
    x, y, z = (parameters.get(f"EKF2_GPS_POS_{axis}", 0.0) for axis in "XYZ")
    delay = round(parameters.get("EKF2_GPS_DELAY", 0.0) * 1e3)
    return Truth(
        time=table["timestamp"][fixed].astype(np.int64) - delay,
        position=np.column_stack([north, east, origin[2] - altitude]),
        velocity=velocity,
        attitude_time=np.zeros(0, dtype=np.int64),
        quaternion=np.zeros((0, 4)),
        reference=origin,
        kind=kind,
        lever_arm=(x, y, z),
    )


def odometry_reference(table: TopicTable, kind: str) -> Truth | None:
    """Pose and velocity of an odometry topic in the layout of v1.14, or None where it has no position.

    Its north and origin are its own, also where it says NED: nobody aligns a camera to within a degree of north.
    """
    time = sample_times(table)
    position, velocity, q = (stacked(table, name) for name in ("position", "velocity", "q"))
    usable = np.isfinite(position).all(axis=1) & np.isin(table["pose_frame"], (_POSE_NED, _POSE_FRD))
    usable &= np.r_[True, np.diff(time) > 0]
    if np.count_nonzero(usable) < 2:
        return None
    time, position, velocity, q = time[usable], position[usable], velocity[usable], q[usable]
    frame = table["velocity_frame"][usable]
    has_attitude = bool(np.isfinite(q).all() and np.all(np.abs(np.linalg.norm(q, axis=1) - 1.0) < 0.1))
    in_body = frame == _VELOCITY_BODY
    if not np.isfinite(velocity).all() or (in_body.any() and not has_attitude):
        velocity = np.zeros((0, 3))
    elif in_body.any():
        velocity = np.where(in_body[:, None], np.einsum("nij,nj->ni", rotation_matrix(q), velocity), velocity)
    return Truth(
        time=time,
        position=position,
        velocity=velocity,
        attitude_time=time if has_attitude else np.zeros(0, dtype=np.int64),
        quaternion=q / np.linalg.norm(q, axis=1, keepdims=True) if has_attitude else np.zeros((0, 4)),
        reference=None,
        kind=kind,
        own_north=True,
    )
