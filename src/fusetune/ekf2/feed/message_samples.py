"""Turn PX4 messages into estimator samples, as the EKF2 module does before it calls the estimator.

Every `…_samples` takes a canonical topic table (see `px4/layouts`) and returns one sample per message,
in the order of the log. `time_us` is the measurement time without the sensor's delay, which acts on arrival. Not every
message is given to the estimator: `…_refusals` says which are not, and why. Where the module of the release that flew
took what that of v1.16 does not, the vehicle's estimator had it, and so has the replay.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fusetune.ekf2.feed.sensor_samples import (
    AIRSPEED_SAMPLE,
    AUXVEL_SAMPLE,
    BARO_SAMPLE,
    EV_FRAME_BODY_FRD,
    EV_FRAME_FRD,
    EV_FRAME_NED,
    EV_FRAME_UNKNOWN,
    EV_SAMPLE,
    FLOW_SAMPLE,
    GNSS_SAMPLE,
    IMU_SAMPLE,
    MAG_SAMPLE,
    RANGE_SAMPLE,
)
from fusetune.px4.flight import TopicTable, row_count, stacked
from fusetune.px4.layouts.sensor_layouts import STANDARD_AIR_DENSITY_KG_M3
from fusetune.px4.releases import AIRSPEED_SELECTED, GNSS_VELOCITY_VALID, VALIDATED_AIRSPEED, VISION_FRAMES, Release
from fusetune.px4.sample_times import measurement_time

MICROSECOND_S = np.float32(1e-6)
SPOOFING_STATE_MULTIPLE = 3
QUATERNION_NORM_TOLERANCE = 1e-5
DOWNWARD_FACING = 25
MAX_FLOW_TIMESPAN_US = 1e6
FLOW_QUALITY_MAX = 255.0
MOST_GNSS_DELAY_US = 1_000_000

NO_NUMBER, NOT_DOWN, NOT_STATIC = "no number", "not facing down", "target not static"


class Refusal(NamedTuple):
    """Messages that the estimator is not given, (rows,) bool, and why."""

    reason: str
    rows: np.ndarray


def taken(table: TopicTable, refusals: Sequence[Refusal]) -> np.ndarray:
    """Which messages the estimator is given, (rows,) bool."""
    refused = np.zeros(row_count(table), np.bool_)
    for refusal in refusals:
        refused |= refusal.rows
    return ~refused


def column(table: TopicTable, name: str, default: float = np.nan) -> np.ndarray:
    """Column as float64, or a constant where the log's release does not have the field."""
    if name in table:
        return np.asarray(table[name], dtype=np.float64)
    return np.full(row_count(table), default)


def changed_since_previous(values: np.ndarray, initial: float) -> np.ndarray:
    """Whether each value differs from the one before it (the first: from `initial`)."""
    return values != np.concatenate([[initial], values[:-1]])


def imu_samples(table: TopicTable) -> np.ndarray:
    """`sensor_combined` → IMU_SAMPLE; integration times keep the single precision that PX4 gives them."""
    samples = np.zeros(row_count(table), IMU_SAMPLE)
    gyro_dt = table["gyro_integral_dt"].astype(np.float32) * MICROSECOND_S
    accel_dt = table["accelerometer_integral_dt"].astype(np.float32) * MICROSECOND_S
    samples["time_us"] = table["timestamp"]
    samples["delta_ang_dt"] = gyro_dt
    samples["delta_vel_dt"] = accel_dt
    samples["delta_ang"] = (stacked(table, "gyro_rad").astype(np.float32) * gyro_dt[:, None]).astype(np.float64)
    samples["delta_vel"] = (stacked(table, "accelerometer_m_s2").astype(np.float32) * accel_dt[:, None]).astype(
        np.float64
    )
    clipping = column(table, "accelerometer_clipping", 0.0).astype(np.int64)
    for axis in range(3):
        samples["delta_vel_clipping"][:, axis] = (clipping >> axis) & 1
    return samples


def mag_samples(table: TopicTable) -> np.ndarray:
    """`vehicle_magnetometer` → MAG_SAMPLE; another device or calibration resets the bias."""
    samples = np.zeros(row_count(table), MAG_SAMPLE)
    samples["time_us"] = measurement_time("vehicle_magnetometer", table)
    samples["mag"] = stacked(table, "magnetometer_ga")
    samples["reset"] = changed_since_previous(column(table, "device_id", 0.0), 0.0) | changed_since_previous(
        column(table, "calibration_count", 0.0), 0.0
    )
    return samples


def baro_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`vehicle_air_data` → BARO_SAMPLE and air density (kg/m³)."""
    samples = np.zeros(row_count(table), BARO_SAMPLE)
    samples["time_us"] = measurement_time("vehicle_air_data", table)
    samples["hgt"] = column(table, "baro_alt_meter")
    samples["reset"] = changed_since_previous(column(table, "baro_device_id", 0.0), 0.0) | changed_since_previous(
        column(table, "calibration_count", 0.0), 0.0
    )
    return samples, column(table, "rho", STANDARD_AIR_DENSITY_KG_M3)


def gnss_refusals(table: TopicTable, release: Release | None = None) -> list[Refusal]:
    """Messages of `vehicle_gps_position` whose velocity is not valid, for releases that ask for it.

    Of a log that does not tell its release, the fields do, nearly: latitude was whole numbers until mid-2023.
    """
    is_older = "lat" in table if release is None else release < GNSS_VELOCITY_VALID
    if is_older:
        return []
    return [Refusal("velocity not valid (vel_ned_valid)", ~(column(table, "vel_ned_valid", 1.0) > 0))]


def gnss_measurement_times(table: TopicTable | None) -> np.ndarray | None:
    """Times (µs) at which GNSS measured, where its messages tell them, else None.

    A time that is that of the message, or further from it than `MOST_GNSS_DELAY_US`, is none that was measured.
    """
    if table is None or "timestamp_sample" not in table:
        return None
    sampled = table["timestamp_sample"].astype(np.int64)
    delay = table["timestamp"].astype(np.int64) - sampled
    told = (delay > 0) & (delay <= MOST_GNSS_DELAY_US)
    return sampled if len(told) and told.all() else None


def gnss_samples(table: TopicTable) -> np.ndarray:
    """`vehicle_gps_position` → GNSS_SAMPLE."""
    samples = np.zeros(row_count(table), GNSS_SAMPLE)
    samples["time_us"] = measurement_time("vehicle_gps_position", table)
    samples["lat_deg"] = column(table, "latitude_deg")
    samples["lon_deg"] = column(table, "longitude_deg")
    samples["alt"] = column(table, "altitude_msl_m").astype(np.float32)
    for axis, name in enumerate(("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")):
        samples["vel"][:, axis] = column(table, name)
    samples["hacc"] = column(table, "eph")
    samples["vacc"] = column(table, "epv")
    samples["sacc"] = column(table, "s_variance_m_s")
    samples["fix_type"] = column(table, "fix_type", 0.0)
    samples["nsats"] = column(table, "satellites_used", 0.0)
    samples["pdop"] = np.hypot(column(table, "hdop"), column(table, "vdop")).astype(np.float32)
    samples["yaw"] = column(table, "heading")
    samples["yaw_acc"] = column(table, "heading_accuracy")
    samples["yaw_offset"] = column(table, "heading_offset")
    samples["spoofed"] = column(table, "spoofing_state", 0.0) == SPOOFING_STATE_MULTIPLE
    return samples


def airspeed_refusals(table: TopicTable) -> list[Refusal]:
    """Messages of `airspeed` that hold no airspeed, or none forward."""
    indicated = column(table, "indicated_airspeed_m_s")
    is_number = np.isfinite(column(table, "true_airspeed_m_s")) & np.isfinite(indicated)
    return [Refusal(NO_NUMBER, ~is_number), Refusal("not above zero", is_number & ~(indicated > 0.0))]


def airspeed_samples(table: TopicTable, scale: float) -> np.ndarray:
    """`airspeed` → AIRSPEED_SAMPLE; `scale` is ASPD_SCALE_1."""
    true_airspeed = column(table, "true_airspeed_m_s")
    samples = np.zeros(row_count(table), AIRSPEED_SAMPLE)
    samples["time_us"] = measurement_time("airspeed", table)
    samples["true_airspeed"] = true_airspeed * scale
    with np.errstate(divide="ignore", invalid="ignore"):
        samples["eas2tas"] = true_airspeed / column(table, "indicated_airspeed_m_s")
    return samples


def validated_airspeed_refusals(table: TopicTable, release: Release | None = None) -> list[Refusal]:
    """Messages of `airspeed_validated` without airspeed, or without a sensor that it comes from."""
    refusals = [Refusal(NO_NUMBER, ~np.isfinite(column(table, "true_airspeed_m_s")))]
    if release is None or not VALIDATED_AIRSPEED <= release < AIRSPEED_SELECTED:
        source = column(table, "airspeed_source" if "airspeed_source" in table else "selected_airspeed_index", 0.0)
        refusals.append(Refusal("no airspeed sensor selected", ~(source > 0)))
    return refusals


def validated_airspeed_samples(table: TopicTable) -> np.ndarray:
    """`airspeed_validated` → AIRSPEED_SAMPLE."""
    true_airspeed = column(table, "true_airspeed_m_s")
    calibrated = column(table, "calibrated_airspeed_m_s")
    samples = np.zeros(row_count(table), AIRSPEED_SAMPLE)
    samples["time_us"] = measurement_time("airspeed_validated", table)
    samples["true_airspeed"] = true_airspeed
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = true_airspeed / calibrated
    samples["eas2tas"] = np.where(np.isfinite(calibrated) & (calibrated > np.finfo(np.float32).eps), ratio, 1.0)
    return samples


def flow_refusals(table: TopicTable) -> list[Refusal]:
    """Messages of `vehicle_optical_flow` that hold no flow, or one over too long a time."""
    timespan = column(table, "integration_timespan_us", 0.0)
    return [
        Refusal(NO_NUMBER, ~np.isfinite(stacked(table, "pixel_flow")).all(axis=1)),
        Refusal("integrated over a second or longer", ~(timespan < MAX_FLOW_TIMESPAN_US)),
    ]


def flow_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`vehicle_optical_flow` → FLOW_SAMPLE, and the sensor's limits and its interval.

    The former are the largest rate (rad/s), the least and the largest distance (m), the latter is µs.

    The estimator counts a line-of-sight rate positive for a right-handed turn of the image about the sensor axis,
    the sensor the other way round. Rates are means over the integration time, so the sample is stamped at its middle.
    """
    timespan = column(table, "integration_timespan_us", 0.0)
    dt = (timespan * 1e-6)[:, None]
    samples = np.zeros(row_count(table), FLOW_SAMPLE)
    samples["time_us"] = measurement_time("vehicle_optical_flow", table) - (timespan.astype(np.int64) // 2)
    integrated = dt > np.finfo(np.float32).eps
    flow, gyro = stacked(table, "pixel_flow"), stacked(table, "delta_angle")
    with np.errstate(divide="ignore", invalid="ignore"):
        samples["flow_rate"] = np.where(integrated, -flow / dt, 0.0)
        samples["gyro_rate"] = np.where(integrated, -gyro / dt, 0.0)
    samples["quality"] = column(table, "quality", 0.0)
    limits = [column(table, name) for name in ("max_flow_rate", "min_ground_distance", "max_ground_distance")]
    return samples, np.column_stack([*limits, timespan])


def range_refusals(table: TopicTable) -> list[Refusal]:
    """Messages of `distance_sensor` that measure no height above ground."""
    return [Refusal(NOT_DOWN, column(table, "orientation", DOWNWARD_FACING) != DOWNWARD_FACING)]


def range_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`distance_sensor` → RANGE_SAMPLE, and the smallest and largest distance that the sensor reports (m)."""
    samples = np.zeros(row_count(table), RANGE_SAMPLE)
    samples["time_us"] = measurement_time("distance_sensor", table)
    samples["range"] = column(table, "current_distance")
    samples["quality"] = column(table, "signal_quality", -1.0)
    return samples, np.column_stack([column(table, "min_distance"), column(table, "max_distance")])


def flow_range_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`vehicle_optical_flow` → RANGE_SAMPLE by the distance it tells beside the flow, and that sensor's limits (m)."""
    samples = np.zeros(row_count(table), RANGE_SAMPLE)
    samples["time_us"] = measurement_time("vehicle_optical_flow", table)
    samples["range"] = column(table, "distance_m")
    samples["quality"] = column(table, "quality", 0.0) / FLOW_QUALITY_MAX * 100.0
    return samples, np.column_stack([column(table, "min_ground_distance"), column(table, "max_ground_distance")])


class VisionRefusals(NamedTuple):
    """Why parts of `vehicle_visual_odometry` are not given to the estimator."""

    position: list[Refusal]
    velocity: list[Refusal]
    orientation: list[Refusal]


def vision_refusals(table: TopicTable, release: Release | None = None) -> VisionRefusals:
    """Parts of `vehicle_visual_odometry` that are no numbers, or of which the frame is unknown.

    Of a log that does not tell its release, the fields do: one frame for all is older than the demand.
    """
    velocity_frame, pose_frame = _vision_frames(table, release)
    velocity, position, q = stacked(table, "velocity"), stacked(table, "position"), stacked(table, "q")
    frames_of_velocity = (EV_FRAME_NED, EV_FRAME_FRD, EV_FRAME_BODY_FRD)
    norm = np.linalg.norm(q, axis=1)
    if _takes_any_frame(table, release):
        is_rotation = norm > 0.0
    else:
        is_rotation = (np.abs(q) <= 1.0 + QUATERNION_NORM_TOLERANCE).all(axis=1) & (
            np.abs(1.0 - norm.astype(np.float32)) <= QUATERNION_NORM_TOLERANCE
        )
    lacks = {"position": position, "velocity": velocity, "orientation": q}
    missing = {name: ~np.isfinite(values).all(axis=1) for name, values in lacks.items()}
    no_frame = "of an unknown frame"
    return VisionRefusals(
        position=[
            Refusal(NO_NUMBER, missing["position"]),
            Refusal(no_frame, ~missing["position"] & ~np.isin(pose_frame, (EV_FRAME_NED, EV_FRAME_FRD))),
        ],
        velocity=[
            Refusal(NO_NUMBER, missing["velocity"]),
            Refusal(no_frame, ~missing["velocity"] & ~np.isin(velocity_frame, frames_of_velocity)),
        ],
        orientation=[
            Refusal(NO_NUMBER, missing["orientation"]),
            Refusal("no unit quaternion", ~missing["orientation"] & ~is_rotation),
        ],
    )


def _takes_any_frame(table: TopicTable, release: Release | None) -> bool:
    return "local_frame" in table if release is None else release < VISION_FRAMES


def _vision_frames(table: TopicTable, release: Release | None) -> tuple[np.ndarray, np.ndarray]:
    """Frames of velocity and pose; a release that did not ask took unknown ones for local, of any heading."""
    frames = [column(table, name, EV_FRAME_UNKNOWN).astype(np.int64) for name in ("velocity_frame", "pose_frame")]
    if _takes_any_frame(table, release):
        frames = [np.where(frame == EV_FRAME_UNKNOWN, EV_FRAME_FRD, frame) for frame in frames]
    return frames[0], frames[1]


def vision_samples(table: TopicTable, release: Release | None = None) -> tuple[np.ndarray, np.ndarray]:
    """`vehicle_visual_odometry` → EV_SAMPLE with the reported variances, and whether each has anything valid."""
    samples = np.zeros(row_count(table), EV_SAMPLE)
    samples["time_us"] = measurement_time("vehicle_visual_odometry", table)
    velocity_frame, pose_frame = _vision_frames(table, release)
    position_valid, velocity_valid, orientation_valid = (
        taken(table, refusals) for refusals in vision_refusals(table, release)
    )
    q = stacked(table, "q")
    samples["vel"] = np.where(velocity_valid[:, None], stacked(table, "velocity"), np.nan)
    samples["pos"] = np.where(position_valid[:, None], stacked(table, "position"), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        samples["quat"] = np.where(orientation_valid[:, None], q / np.linalg.norm(q, axis=1)[:, None], np.nan)
    samples["vel_frame"] = np.where(velocity_valid, velocity_frame, EV_FRAME_UNKNOWN)
    samples["pos_frame"] = np.where(position_valid, pose_frame, EV_FRAME_UNKNOWN)
    for field in ("position_var", "velocity_var", "orientation_var"):
        samples[field] = stacked(table, field.replace("_var", "_variance"))
    samples["reset_counter"] = column(table, "reset_counter", 0.0)
    samples["quality"] = column(table, "quality", 0.0)
    return samples, velocity_valid | position_valid | orientation_valid


def auxvel_refusals(table: TopicTable) -> list[Refusal]:
    """Messages of `landing_target_pose` that tell no velocity of the vehicle."""
    is_number = np.ones(row_count(table), np.bool_)
    for axis in ("x", "y"):
        is_number &= np.isfinite(column(table, f"v{axis}_rel")) & np.isfinite(column(table, f"cov_v{axis}_rel"))
    return [
        Refusal(NOT_STATIC, ~(column(table, "is_static", 0.0) > 0)),
        Refusal("velocity not valid", ~(column(table, "rel_vel_valid", 0.0) > 0)),
        Refusal(NO_NUMBER, ~is_number),
    ]


def auxvel_samples(table: TopicTable) -> np.ndarray:
    """`landing_target_pose` → AUXVEL_SAMPLE."""
    samples = np.zeros(row_count(table), AUXVEL_SAMPLE)
    samples["time_us"] = measurement_time("landing_target_pose", table)
    for axis, name in enumerate(("x", "y")):
        samples["vel"][:, axis] = -column(table, f"v{name}_rel")
        samples["vel_var"][:, axis] = column(table, f"cov_v{name}_rel")
    return samples
