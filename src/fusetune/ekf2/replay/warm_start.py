"""Start the filter from the state that the vehicle's own estimator had, instead of from nothing.

The estimator's memory is one record. The compiled loop runs until the fusion time horizon has reached the logged state,
so that its buffers are filled; then everything that the filter has found by itself is replaced by what the vehicle
knew: state, variances, origin, flags, the checks it had passed. Correlations are not logged; they build up within the
first seconds.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from fusetune.ekf2.feed.inputs import BIAS_RESETS, EstimatorInputs, imu_samples, without_arrivals
from fusetune.ekf2.filter.common.control_status import CONTROL_STATUS_NAMES
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_BARO, HEIGHT_REF_GNSS, HEIGHT_REF_UNKNOWN
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, ERROR_STATE_BLOCKS, MAG_BODY, MAG_EARTH, TERRAIN, WIND
from fusetune.ekf2.filter.world_field import earth_field_vector
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.numerics.geodesy import reproject
from fusetune.ekf2.numerics.world_magnetic_model import field_at
from fusetune.ekf2.releases.by_release import release_of_fields
from fusetune.ekf2.replay.older_start import (
    bias_unit,
    is_local,
    place_of,
    position_of_output,
    put_local_position,
    settle_core,
    settle_field,
    settle_samples,
)
from fusetune.px4.layouts.logged_state import LoggedState
from fusetune.quaternions import conjugate, rotation_matrix

CARRIED = (
    "time_delayed_us", "time_latest_us", "imu_delayed", "dt_ekf_avg", "air_density", "sensors", "buffers", "output",
    "drag", "range", "flow",
)  # fmt: skip
"""What belongs to the arrival of samples and not to the filter."""

OF_THE_FILTER = ("sample", "data_ready")
"""What, of a sensor, belongs to the filter: the sample that it had in hand."""

TAKEN_FLAGS = (
    "tilt_align", "yaw_align", "gnss_pos", "gnss_vel", "in_air", "wind", "baro_hgt", "gps_hgt", "fixed_wing",
    "gnd_effect", "mag_aligned_in_flight", "vehicle_at_rest",
)  # fmt: skip
"""Flags that are taken over; the filter finds the others by itself at the next sample of their source."""

MAG_FUSED = frozenset({"mag", "mag_hdg", "mag_3d"})
MAG_VARIANCE_MIN = 1e-6
MIN_VARIANCES = {"attitude": 1e-8, "velocity": 1e-4, "position": 1e-4, "gyro_bias": 1e-10, "accel_bias": 1e-8}
WIND_VARIANCE = 1.0
BARO_BIAS_VARIANCE = 0.1
FIRST_NEWS_US = 1_500_000
MAG_SAMPLES_SEEN = 10
CHECKS_PASSED_US = 60_000_000
MAG_HEALTHY_US = 2_000_000


def without_first_resets(inputs: EstimatorInputs, since_us: int) -> EstimatorInputs:
    """The same inputs, but for the first sample of a sensor being taken for that of a new one.

    The estimator resets what it knows of a sensor whose device or calibration changes, and the first that it hears of
    is such a change. Of the IMU that is told by slow topics, so it is no change either shortly after the start.
    """
    arrays = inputs.arrays
    mag, baro = arrays.mag.copy(), arrays.baro.copy()
    for samples in (mag, baro):
        samples["reset"][:1] = False
    last = int(np.searchsorted(arrays.imu["time_us"], since_us + FIRST_NEWS_US))
    arrivals = without_arrivals(arrays.arrivals, BIAS_RESETS, np.arange(len(arrays.imu)) < last)
    return replace(inputs, arrays=arrays._replace(mag=mag, baro=baro, arrivals=arrivals))


def take_over(ekf: np.ndarray, fresh: np.ndarray, params: np.void, inputs: EstimatorInputs, state: LoggedState) -> None:
    """Replace the filter in a record by the logged one.

    Parameters
    ----------
    ekf : (1,) EKF record whose horizon has reached `state.time_us`; changed in place
    fresh : (1,) EKF record as it is after the first IMU sample
    params : EKF2_PARAMETERS record that is replayed
    state : of the vehicle; it is carried on to the horizon with the IMU samples in between
    """
    np.copyto(ekf.view(np.uint8), fresh.view(np.uint8), where=_bytes_of_the_filter(ekf.dtype))
    e = ekf[0]
    e["filter_initialised"] = True
    _set_state(e, params, inputs, state)
    _set_variances(e, params, state)
    _set_flags(e, params, state)
    _set_timers(e)
    _set_gnss(e)
    _set_baro(e, inputs)
    _set_mag(e, inputs, state)
    settle_field(e, release_of_fields(e.dtype.names or ()), state, is_known=knows_field(state))
    settle_samples(e, inputs)
    settle_core(e, params)
    _align_output(e)


@cache
def _bytes_of_the_filter(record: np.dtype) -> np.ndarray:
    """True for the bytes of an EKF record that are the filter's own."""
    own = np.ones(record.itemsize, np.bool_)
    for name in CARRIED:
        own[_bytes_of(record, name)] = False
    sensors = record["sensors"]
    for name in sensors.names or ():
        for part in OF_THE_FILTER:
            own[_bytes_of(record, "sensors", name, part)] = True
    return own


def _bytes_of(record: np.dtype, *names: str) -> slice:
    """Where a field of a field … of a record lies."""
    start = 0
    for name in names:
        assert record.fields is not None, "only the last one is a plain value"
        record, offset = record.fields[name][:2]
        start += offset
    return slice(start, start + record.itemsize)


def _set_state(e: np.void, params: np.void, inputs: EstimatorInputs, state: LoggedState) -> None:
    until = int(e["time_delayed_us"])
    # the state stays as long as what was made of it, so that its number is no other's
    _, (q, velocity, position) = inputs.memo.get(
        ("carried on", id(state), until), lambda: (state, _carried_on(state, inputs.arrays.imu, until))
    )
    e["q"], e["vel"] = q, velocity
    e["R_to_earth"] = rotation_matrix(q)
    origin = e["origin"]
    lat, lon = 0.0, 0.0
    if state.origin is not None:
        lat, lon = math.radians(state.origin[0]), math.radians(state.origin[1])
        origin["lat_rad"], origin["lon_rad"], origin["alt"] = lat, lon, state.origin[2]
        origin["lat_lon_valid"] = origin["valid"] = True
        origin["timestamp"] = max(int(e["time_delayed_us"]) - 1, 1)
    base = state.origin[2] if state.origin is not None else 0.0
    e["gpos_lat"], e["gpos_lon"] = reproject.py_func(lat, lon, float(position[0]), float(position[1]))
    e["gpos_alt"] = float(np.float32(base - position[2]))
    for known, here in (("last_known_lat", "gpos_lat"), ("last_known_lon", "gpos_lon"), ("last_known_alt", "gpos_alt")):
        e[known] = e[here]
    put_local_position(e, position)
    e["gyro_bias"], e["accel_bias"] = state.gyro_bias, state.accel_bias
    e["wind_vel"] = state.wind
    e["height_rate_lpf"] = velocity[2]
    # in the air the ground is taken to be level with the origin, which lies where the vehicle was switched on
    level = 0.0 if is_local(e) else -base
    ground = -e["gpos_alt"] if "in_air" not in state.flags else level
    e["terrain"] = float(np.float32(ground + params["EKF2_MIN_RNG"]))
    e["last_on_ground_pos_d"] = ground


def _carried_on(state: LoggedState, imu: np.ndarray, until: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The logged state carried on to the horizon, at most one update interval later."""
    q, velocity, position = state.q.copy(), state.velocity.copy(), state.position.copy()
    first, last = np.searchsorted(imu["time_us"], (state.time_us, until), side="right")
    for sample in imu_samples(imu[first : min(last + 1, len(imu))]):
        begin = int(sample["time_us"]) - round(float(sample["delta_ang_dt"]) * 1e6)
        share = (min(until, int(sample["time_us"])) - max(state.time_us, begin)) / max(
            int(sample["time_us"]) - begin, 1
        )
        if share <= 0.0:
            continue
        dt = share * float(sample["delta_vel_dt"])
        turn = share * (sample["delta_ang"] - state.gyro_bias * sample["delta_ang_dt"])
        q = _turned(q, turn)
        change = rotation_matrix(q) @ (share * (sample["delta_vel"] - state.accel_bias * sample["delta_vel_dt"]))
        change[2] += ONE_G * dt
        position += (velocity + 0.5 * change) * dt
        velocity += change
    return q, velocity, position


def _turned(q: np.ndarray, turn: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(turn))
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    result = quaternion_product(q, np.array([math.cos(0.5 * angle), *(scale * turn)]))
    return result / np.linalg.norm(result)


def quaternion_product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Products (…, 4) of a quaternion (w, x, y, z) with others, by vectors; the last bits of `multiply` differ."""
    scalar = p[0] * q[..., 0] - np.vecdot(p[1:], q[..., 1:])
    vector = p[0] * q[..., 1:] + q[..., :1] * p[1:] + np.cross(p[1:], q[..., 1:])
    return np.concatenate([np.expand_dims(scalar, -1), vector], axis=-1)


def _set_variances(e: np.void, params: np.void, state: LoggedState) -> None:
    variances = state.variances.copy()
    for block, lowest in MIN_VARIANCES.items():
        first, length = ERROR_STATE_BLOCKS[block]
        variances[first : first + length] = np.maximum(variances[first : first + length], lowest)
    if variances[0] <= 1e-8 and variances[1] <= 1e-8:
        variances[:2] = params["EKF2_ANGERR_INIT"] ** 2
    mag = slice(MAG_EARTH, MAG_BODY + 3)
    if not knows_field(state):
        variances[mag] = params["EKF2_MAG_NOISE"] ** 2
    unknown_wind = variances[WIND : WIND + 2] <= 0.0
    variances[WIND : WIND + 2][unknown_wind] = WIND_VARIANCE
    if variances[TERRAIN] <= 0.0:
        variances[TERRAIN] = max(params["EKF2_MIN_RNG"], 0.01) ** 2
    if not np.any(variances[ACCEL_BIAS : ACCEL_BIAS + 3] > MIN_VARIANCES["accel_bias"]):
        variances[ACCEL_BIAS : ACCEL_BIAS + 3] = params["EKF2_ABIAS_INIT"] ** 2
    e["P"] = np.diag(variances)


def knows_field(state: LoggedState) -> bool:
    """Whether the vehicle estimated the field, in its heading mode of old releases it did not."""
    return bool(
        MAG_FUSED & state.flags
        and np.min(state.variances[MAG_EARTH : MAG_BODY + 3]) > MAG_VARIANCE_MIN
        and np.linalg.norm(state.mag_earth) > 0.0
    )


def _set_flags(e: np.void, params: np.void, state: LoggedState) -> None:
    e["cs"] = np.zeros((), e["cs"].dtype)
    enabled = {name: name in state.flags for name in TAKEN_FLAGS if name in CONTROL_STATUS_NAMES}
    enabled["baro_hgt"] &= int(params["EKF2_BARO_CTRL"]) == 1
    for name, value in enabled.items():
        e["cs"][name] = value
    if knows_field(state):
        e["cs"]["mag"] = True
    e["cs"]["mag_heading_consistent"] = "mag_heading_consistent" in state.flags or bool(MAG_FUSED & state.flags)
    e["cs_prev"] = e["cs"]
    wanted = int(params["EKF2_HGT_REF"])
    reference = HEIGHT_REF_UNKNOWN
    if wanted == HEIGHT_REF_BARO and enabled["baro_hgt"]:
        reference = HEIGHT_REF_BARO
    elif wanted == HEIGHT_REF_GNSS and enabled["gps_hgt"]:
        reference = HEIGHT_REF_GNSS
    e["height_sensor_ref"] = reference


def _set_timers(e: np.void) -> None:
    """Everything that is fused has just been fused."""
    now = int(e["time_delayed_us"])
    for name in (
        "time_last_horizontal_aiding", "time_last_v_pos_aiding", "time_last_v_vel_aiding", "time_last_hor_pos_fuse",
        "time_last_hgt_fuse", "time_last_hor_vel_fuse", "time_last_ver_vel_fuse", "time_last_heading_fuse",
        "time_good_vert_accel",
    ):  # fmt: skip
        e[name] = now
    e["time_last_in_air" if e["cs"]["in_air"] else "time_last_on_ground"] = now
    if e["cs"]["gnd_effect"]:
        e["time_last_gnd_effect_on"] = now
    for name in ("horizontal", "vertical_position", "vertical_velocity"):
        e[f"{name}_deadreckon_time_exceeded"] = False
    for source, active in (
        ("gnss_vel", "gnss_vel"), ("gnss_pos", "gnss_pos"), ("gnss_hgt", "gps_hgt"), ("baro_hgt", "baro_hgt"),
        ("mag", "mag"),
    ):  # fmt: skip
        if e["cs"][active]:
            e["aid"][source]["time_last_fuse"] = now


def _set_gnss(e: np.void) -> None:
    """The checks have been passed long ago, if the vehicle was using GNSS."""
    if not (e["cs"]["gnss_pos"] or e["cs"]["gnss_vel"]):
        return
    now = int(e["time_delayed_us"])
    e["gnss"]["checks_passed"] = True
    if "gnss_trust" in (e.dtype.names or ()):
        e["gnss_trust"]["passed"] = True
    e["gnss"]["intermittent"] = False
    e["gnss"]["last_pass_us"] = now
    e["gnss"]["last_fail_us"] = max(now - CHECKS_PASSED_US, 1)
    e["gps_hgt_b_est"]["fusion_active"] = bool(e["cs"]["gps_hgt"])


def _set_baro(e: np.void, inputs: EstimatorInputs) -> None:
    """The barometer's bias is what its height now differs from the estimate by."""
    samples = inputs.arrays.baro
    if not len(samples):
        e["cs"]["baro_hgt"] = e["cs_prev"]["baro_hgt"] = False
        return
    now = int(e["time_delayed_us"])
    height = inputs.memo.get(("barometer at", now), lambda: float(np.interp(now, samples["time_us"], samples["hgt"])))
    e["baro"]["lpf"] = height
    e["baro"]["counter"] = int(e["buffers"]["observation_length"]) + 1
    e["baro_b_est"]["bias"] = height - e["gpos_alt"]
    e["baro_b_est"]["bias_var"] = BARO_BIAS_VARIANCE
    e["baro_b_est"]["fusion_active"] = bool(e["cs"]["baro_hgt"])


def _set_mag(e: np.void, inputs: EstimatorInputs, state: LoggedState) -> None:
    """Field states where the vehicle had them; else the filter resets them, not the heading, at the first sample."""
    now = int(e["time_delayed_us"])
    mag = e["mag"]
    if e["origin"]["lat_lon_valid"] and knows_field(state):
        place = place_of(e)
        release = release_of_fields(e.dtype.names or ())
        declination, inclination, strength = inputs.memo.get(
            ("field at", place, release), lambda: field_at(*place, release)
        )
        mag["wmm_declination"], mag["wmm_inclination"], mag["wmm_strength"] = declination, inclination, strength
        earth_field_vector.py_func(declination, inclination, strength, mag["wmm_earth_field"])
        mag["wmm_time_last_checked"] = now
    if knows_field(state):
        e["mag_I"], e["mag_B"] = state.mag_earth, state.mag_body
    samples = inputs.arrays.mag
    if len(samples):
        mag["lpf"] = inputs.memo.get(
            ("magnetometer at", now),
            lambda: [np.interp(now, samples["time_us"], samples["mag"][:, axis]) for axis in range(3)],
        )
        mag["counter"] = MAG_SAMPLES_SEEN
    mag["flt_mag_align_start_time"] = now
    mag["time_last_check_failing"] = max(now - MAG_HEALTHY_US, 1)


def _align_output(e: np.void) -> None:
    """Turn and move the output predictor's history so that it agrees with the filter at the horizon."""
    output = e["output"]
    oldest = output["history"][int(output["tail"])].copy()
    turn = quaternion_product(e["q"], conjugate(oldest["q"]))
    matrix = rotation_matrix(turn / np.linalg.norm(turn))
    start = oldest["vel"]
    samples = output["history"][: int(output["size"])]
    samples["q"] = quaternion_product(turn, samples["q"])
    samples["vel"] = start + np.matmul(matrix, (samples["vel"] - start)[..., None])[..., 0]
    output["vel_offset"] = e["vel"] - start
    output["pos_offset"] = position_of_output(e) - oldest["pos"]
    # the predictor of a local position counts from the origin itself
    reference = (0.0, 0.0, 0.0) if is_local(e) else (e["gpos_lat"], e["gpos_lon"], e["gpos_alt"])
    output["ref_lat"], output["ref_lon"], output["ref_alt"] = reference
    newest = output["history"][int(output["head"])]
    output["newest"]["q"] = newest["q"]
    output["newest"]["vel"] = newest["vel"] + output["vel_offset"]
    output["newest"]["pos"] = newest["pos"] + output["pos_offset"]
    unit = bias_unit(e)
    output["gyro_bias"], output["accel_bias"] = e["gyro_bias"] / unit, e["accel_bias"] / unit
    for name in ("vel_err_integ", "pos_err_integ", "delta_angle_corr"):
        output[name] = 0.0
