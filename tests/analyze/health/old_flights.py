"""One made flight as the estimator of each release logs it: the same truth in every layout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.save.test_old_and_new_logs import FIRST_US, SECONDS, SLOW, flight_of

from fusetune.px4.flight import Flight, TopicKey, TopicTable

GYRO_BIAS, ACCEL_BIAS = (0.006, -0.002, 0.003), (0.12, 0.05, -0.09)
ACCEL_VIBRATION, GYRO_VIBRATION = 6.0, 0.2
VELOCITY_ERROR, STATUS_RATIO = 0.02, 0.1
IMU_INTERVAL_S, UPDATE_INTERVAL_S = 0.005, 0.01

_AID_SOURCES, _RATES, _TERRAIN = (1, 14), (1, 15), (1, 16)
_IMU_STATUS, _RATES_OF_VIBRATION, _STATES_APART, _SPLIT_VELOCITY = (1, 11), (1, 13), (1, 12), (1, 11)
Release = tuple[int, int]


def old_flight(release: Release) -> Flight:
    """The flight with what the estimator of a release logs."""
    flight = flight_of(release)
    flight.parameters.initial |= {"EKF2_GPS_V_GATE": 5.0}
    topics = flight.topics | _status(release) | _vibration(release) | _innovations(release)
    return replace(flight, topics=topics, last_timestamp=FIRST_US + SECONDS * 1_000_000)


def _columns(**values: float) -> TopicTable:
    rows = {name: np.full(len(SLOW), value, np.float32) for name, value in values.items()}
    return {"timestamp": SLOW, "timestamp_sample": SLOW - 150} | rows


def _vector(name: str, values: tuple[float, ...]) -> dict[str, float]:
    return {f"{name}[{place}]": value for place, value in enumerate(values)}


def _states(release: Release) -> dict[str, float]:
    """Increments per update up to v1.14, with four variances of a quaternion; then rates, with three of a rotation."""
    by = 1.0 if release >= _RATES else UPDATE_INTERVAL_S
    biases = (*(by * one for one in GYRO_BIAS), *(by * one for one in ACCEL_BIAS))
    count = 25 if release >= _TERRAIN else 24
    states = (1.0, *(0.0,) * 6, 1.0, 1.0, -1.0, *biases, *(0.2,) * 6, *(0.0,) * (count - 22))
    variances = 23 + (release < _RATES) + (release >= _TERRAIN)
    return _vector("states", states) | _vector("covariances", (1e-8,) * variances)


def _status(release: Release) -> dict[TopicKey, TopicTable]:
    # horizontal position is bit 2 of what is rejected from v1.11 on, bit 1 before
    rejected = 1 << (2 if release >= _SPLIT_VELOCITY else 1)
    table = _columns(
        vel_test_ratio=STATUS_RATIO,
        pos_test_ratio=STATUS_RATIO,
        hgt_test_ratio=STATUS_RATIO,
        mag_test_ratio=STATUS_RATIO,
        time_slip=0.0,
    )
    table["control_mode_flags"] = np.full(len(SLOW), 0b1 | 0b10 | 1 << 2 | 1 << 9, np.uint32)
    table["filter_fault_flags"] = np.zeros(len(SLOW), np.uint16)
    table["gps_check_fail_flags"] = np.zeros(len(SLOW), np.uint16)
    table["innovation_check_flags"] = np.full(len(SLOW), rejected, np.uint16)
    topics: dict[TopicKey, TopicTable] = {("estimator_status", 0): table}
    if release >= _SPLIT_VELOCITY:
        table |= _columns(pre_flt_fail_innov_heading=0.0)
    if release >= (1, 11):
        table |= _columns(**_vector("output_tracking_error", (1e-3, VELOCITY_ERROR, 0.05)))
    if release < _IMU_STATUS:
        vibe = (1e-7, IMU_INTERVAL_S * GYRO_VIBRATION, IMU_INTERVAL_S * ACCEL_VIBRATION)
        table |= _columns(**_vector("vibe", vibe))
    if release < _STATES_APART:
        table |= _columns(**_states(release))
    else:
        topics["estimator_states", 0] = _columns(**_states(release))
        gnss = "cs_gps" if release < _RATES else "cs_gnss_pos"
        flags = {"cs_tilt_align": 1, "cs_yaw_align": 1, gnss: 1, "cs_baro_hgt": 1, "fs_bad_hdg": 0}
        flags |= {"reject_hor_vel": 0, "reject_hor_pos": 1, "reject_ver_pos": 0, "reject_yaw": 0}
        rows = {name: np.full(len(SLOW), value, np.bool_) for name, value in flags.items()}
        topics["estimator_status_flags", 0] = {"timestamp": SLOW, "timestamp_sample": SLOW - 150} | rows
    return topics


def _vibration(release: Release) -> dict[TopicKey, TopicTable]:
    """Per IMU interval up to v1.12, within the status up to v1.10."""
    by = 1.0 if release >= _RATES_OF_VIBRATION else IMU_INTERVAL_S
    if release < _IMU_STATUS:
        return {}
    coning = "delta_angle_coning_metric" if release >= _RATES_OF_VIBRATION else "gyro_coning_vibration"
    metrics = {"accel_vibration_metric": by * ACCEL_VIBRATION, "gyro_vibration_metric": by * GYRO_VIBRATION}
    return {("vehicle_imu_status", 0): _columns(**metrics, **{coning: 1e-7})}


def _innovations(release: Release) -> dict[TopicKey, TopicTable]:
    """Innovations of half a metre per second with a variance of 0.04 m²/s², different enough to tell samples."""
    unlike = 1.0 + 1e-6 * np.arange(len(SLOW), dtype=np.float64)
    ratio = 0.5**2 / (25 * 0.04)
    if release >= _AID_SOURCES:
        table = _columns(
            **_vector("innovation", (0.5, 0.5, 0.1)),
            **_vector("innovation_variance", (0.04,) * 3),
            **_vector("test_ratio", (ratio, ratio, 0.01)),
        )
        flags = {"innovation_rejected": np.zeros(len(SLOW), np.bool_), "fused": np.ones(len(SLOW), np.bool_)}
        return {("estimator_aid_src_gnss_vel", 0): table | flags}
    if release >= (1, 11):
        names = ("gps_hvel[0]", "gps_hvel[1]", "gps_vvel")
        innovations = _columns(**dict(zip(names, (0.5, 0.5, 0.1), strict=True)))
        for name in names:
            innovations[name] = (innovations[name] * unlike).astype(np.float32)
        return {
            ("estimator_innovations", 0): innovations,
            ("estimator_innovation_variances", 0): _columns(**dict.fromkeys(names, 0.04)),
            ("estimator_innovation_test_ratios", 0): _columns(**dict(zip(names, (ratio, ratio, 0.01), strict=True))),
        }
    table = _columns(
        **_vector("vel_pos_innov", (0.5, 0.5, 0.1, 0.0, 0.0, 0.0)),
        **_vector("vel_pos_innov_var", (0.04,) * 6),
        **_vector("output_tracking_error", (1e-3, VELOCITY_ERROR, 0.05)),
    )
    for axis in range(3):
        name = f"vel_pos_innov[{axis}]"
        table[name] = (table[name] * unlike).astype(np.float32)
    return {("ekf2_innovations", 0): table}
