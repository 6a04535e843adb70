"""Turn PX4 messages into estimator samples, as the EKF2 module does before it calls the estimator.

Every function takes one canonical topic table (see `fusetune.px4.release_layouts`) and returns one sample per message,
in the order of the log. `time_us` is the measurement time without the sensor's delay, which acts on arrival.
"""

from __future__ import annotations

import numpy as np

from fusetune.ekf2.sensor_samples import (
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
)
from fusetune.px4.flight import TopicTable, row_count, stacked

MICROSECOND_S = np.float32(1e-6)
SPOOFING_STATE_MULTIPLE = 3
QUATERNION_NORM_TOLERANCE = 1e-5
MAX_FLOW_TIMESPAN_US = 1e6


def column(table: TopicTable, name: str, default: float = np.nan) -> np.ndarray:
    """Column as float64, or a constant where the log's release does not have the field."""
    if name in table:
        return np.asarray(table[name], dtype=np.float64)
    return np.full(row_count(table), default)


def sample_time(table: TopicTable) -> np.ndarray:
    """`timestamp_sample` where the topic has it, else `timestamp` (int64 µs)."""
    timestamp = table["timestamp"].astype(np.int64)
    if "timestamp_sample" not in table:
        return timestamp
    sampled = table["timestamp_sample"].astype(np.int64)
    return np.where(sampled > 0, sampled, timestamp)


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
    samples["time_us"] = sample_time(table)
    samples["mag"] = stacked(table, "magnetometer_ga")
    samples["reset"] = changed_since_previous(column(table, "device_id", 0.0), 0.0) | changed_since_previous(
        column(table, "calibration_count", 0.0), 0.0
    )
    return samples


def baro_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`vehicle_air_data` → BARO_SAMPLE and air density (kg/m³)."""
    samples = np.zeros(row_count(table), BARO_SAMPLE)
    samples["time_us"] = sample_time(table)
    samples["hgt"] = column(table, "baro_alt_meter")
    samples["reset"] = changed_since_previous(column(table, "baro_device_id", 0.0), 0.0) | changed_since_previous(
        column(table, "calibration_count", 0.0), 0.0
    )
    return samples, column(table, "rho", 1.225)


def gnss_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`vehicle_gps_position` → GNSS_SAMPLE, and whether each is used (its velocity is valid)."""
    samples = np.zeros(row_count(table), GNSS_SAMPLE)
    samples["time_us"] = table["timestamp"].astype(np.int64)
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
    return samples, column(table, "vel_ned_valid", 1.0) > 0


def airspeed_samples(table: TopicTable, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """`airspeed` → AIRSPEED_SAMPLE, and whether each is used; `scale` is ASPD_SCALE_1."""
    true_airspeed = column(table, "true_airspeed_m_s")
    indicated = column(table, "indicated_airspeed_m_s")
    samples = np.zeros(row_count(table), AIRSPEED_SAMPLE)
    samples["time_us"] = sample_time(table)
    samples["true_airspeed"] = true_airspeed * scale
    with np.errstate(divide="ignore", invalid="ignore"):
        samples["eas2tas"] = true_airspeed / indicated
    return samples, np.isfinite(true_airspeed) & np.isfinite(indicated) & (indicated > 0.0)


def validated_airspeed_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`airspeed_validated` → AIRSPEED_SAMPLE, and whether each is used (a sensor is selected)."""
    true_airspeed = column(table, "true_airspeed_m_s")
    calibrated = column(table, "calibrated_airspeed_m_s")
    source = column(table, "airspeed_source" if "airspeed_source" in table else "selected_airspeed_index", 0.0)
    samples = np.zeros(row_count(table), AIRSPEED_SAMPLE)
    samples["time_us"] = table["timestamp"].astype(np.int64)
    samples["true_airspeed"] = true_airspeed
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = true_airspeed / calibrated
    samples["eas2tas"] = np.where(np.isfinite(calibrated) & (calibrated > np.finfo(np.float32).eps), ratio, 1.0)
    return samples, np.isfinite(true_airspeed) & (source > 0)


def flow_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`vehicle_optical_flow` → FLOW_SAMPLE, sensor limits (max rate rad/s, min and max distance m), and use.

    The estimator counts a line-of-sight rate positive for a right-handed turn of the image about the sensor axis,
    the sensor the other way round. Rates are means over the integration time, so the sample is stamped at its middle.
    """
    timespan = column(table, "integration_timespan_us", 0.0)
    dt = (timespan * 1e-6)[:, None]
    samples = np.zeros(row_count(table), FLOW_SAMPLE)
    samples["time_us"] = sample_time(table) - (timespan.astype(np.int64) // 2)
    integrated = dt > np.finfo(np.float32).eps
    flow, gyro = stacked(table, "pixel_flow"), stacked(table, "delta_angle")
    with np.errstate(divide="ignore", invalid="ignore"):
        samples["flow_rate"] = np.where(integrated, -flow / dt, 0.0)
        samples["gyro_rate"] = np.where(integrated, -gyro / dt, 0.0)
    samples["quality"] = column(table, "quality", 0.0)
    limits = np.column_stack(
        [column(table, name) for name in ("max_flow_rate", "min_ground_distance", "max_ground_distance")]
    )
    return samples, limits, np.isfinite(flow).all(axis=1) & (timespan < MAX_FLOW_TIMESPAN_US)


def vision_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`vehicle_visual_odometry` → EV_SAMPLE with the reported variances, and whether each has anything valid."""
    samples = np.zeros(row_count(table), EV_SAMPLE)
    samples["time_us"] = sample_time(table)
    velocity_frame = column(table, "velocity_frame", EV_FRAME_UNKNOWN).astype(np.int64)
    pose_frame = column(table, "pose_frame", EV_FRAME_UNKNOWN).astype(np.int64)
    velocity, position, q = stacked(table, "velocity"), stacked(table, "position"), stacked(table, "q")
    velocity_valid = np.isfinite(velocity).all(axis=1) & np.isin(
        velocity_frame, (EV_FRAME_NED, EV_FRAME_FRD, EV_FRAME_BODY_FRD)
    )
    position_valid = np.isfinite(position).all(axis=1) & np.isin(pose_frame, (EV_FRAME_NED, EV_FRAME_FRD))
    norm = np.linalg.norm(q, axis=1)
    orientation_valid = (
        np.isfinite(q).all(axis=1)
        & (np.abs(q) <= 1.0 + QUATERNION_NORM_TOLERANCE).all(axis=1)
        & (np.abs(1.0 - norm.astype(np.float32)) <= QUATERNION_NORM_TOLERANCE)
    )
    samples["vel"] = np.where(velocity_valid[:, None], velocity, np.nan)
    samples["pos"] = np.where(position_valid[:, None], position, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        samples["quat"] = np.where(orientation_valid[:, None], q / norm[:, None], np.nan)
    samples["vel_frame"] = np.where(velocity_valid, velocity_frame, EV_FRAME_UNKNOWN)
    samples["pos_frame"] = np.where(position_valid, pose_frame, EV_FRAME_UNKNOWN)
    for field in ("position_var", "velocity_var", "orientation_var"):
        samples[field] = stacked(table, field.replace("_var", "_variance"))
    samples["reset_counter"] = column(table, "reset_counter", 0.0)
    samples["quality"] = column(table, "quality", 0.0)
    return samples, velocity_valid | position_valid | orientation_valid


def auxvel_samples(table: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """`landing_target_pose` → AUXVEL_SAMPLE, and whether each is used (a static target with valid velocity)."""
    samples = np.zeros(row_count(table), AUXVEL_SAMPLE)
    samples["time_us"] = table["timestamp"].astype(np.int64)
    for axis, name in enumerate(("x", "y")):
        samples["vel"][:, axis] = -column(table, f"v{name}_rel")
        samples["vel_var"][:, axis] = column(table, f"cov_v{name}_rel")
    return samples, (column(table, "is_static", 0.0) > 0) & (column(table, "rel_vel_valid", 0.0) > 0)
