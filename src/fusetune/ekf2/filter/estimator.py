"""The whole estimator: its memory in one record, and one update.

Per IMU sample, `update` first levels the filter if it has not started yet, then, when a new down-sampled sample moved
the fusion time horizon, predicts covariance and state over the oldest buffered interval, lets every aid source act,
and corrects the output predictor.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.buffers import BUFFERS_MEMORY
from fusetune.ekf2.feed.sensor_samples import (
    AIRSPEED_SAMPLE,
    AUXVEL_SAMPLE,
    BARO_SAMPLE,
    DRAG_SAMPLE,
    EV_SAMPLE,
    FLOW_SAMPLE,
    GNSS_SAMPLE,
    MAG_SAMPLE,
    RANGE_SAMPLE,
    SYSTEM_FLAGS_SAMPLE,
)
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_memory import AIRSPEED_MEMORY
from fusetune.ekf2.filter.aid_sources.barometer.baro_memory import BARO_MEMORY
from fusetune.ekf2.filter.aid_sources.drag.drag_memory import DRAG_MEMORY
from fusetune.ekf2.filter.aid_sources.external_vision.ev_memory import EV_MEMORY, initialise_ev_memory
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GNSS_MEMORY, initialise_gnss_memory
from fusetune.ekf2.filter.aid_sources.gravity.gravity_fusion import GRAVITY_MEMORY
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_memory import MAG_MEMORY, initialise_mag_memory
from fusetune.ekf2.filter.aid_sources.optical_flow.flow_memory import FLOW_MEMORY, initialise_flow_memory
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import RANGE_MEMORY, initialise_range_memory
from fusetune.ekf2.filter.aid_sources.zero_gyro import ZERO_GYRO_MEMORY
from fusetune.ekf2.filter.bias_estimator.height_bias_estimator import (
    HEIGHT_BIAS_ESTIMATOR,
    initialise_height_bias_estimator,
)
from fusetune.ekf2.filter.bias_estimator.position_bias_estimator import (
    POSITION_BIAS_ESTIMATOR,
    initialise_position_bias_estimator,
)
from fusetune.ekf2.filter.bias_inhibition import update_imu_bias_inhibit
from fusetune.ekf2.filter.common.core_memory import CORE_FIELDS, HEIGHT_REF_UNKNOWN, POSITION_REF_GNSS
from fusetune.ekf2.filter.common.local_origin import LOCAL_ORIGIN, initialise_local_origin
from fusetune.ekf2.filter.control import control_fusion_modes
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.imu_down_sampler import DOWN_SAMPLER_MEMORY
from fusetune.ekf2.filter.output_predictor import OUTPUT_MEMORY, align_output_predictor, correct_output
from fusetune.ekf2.filter.prediction import GRAVITY, predict_covariance, predict_state, update_average_interval
from fusetune.ekf2.filter.wind import WIND_MEMORY
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import GSF_MEMORY, initialise_gsf_memory
from fusetune.ekf2.numerics.rotations import quat_aligning_with_up, quat_to_dcm

SAMPLES = {
    "gnss": GNSS_SAMPLE,
    "mag": MAG_SAMPLE,
    "baro": BARO_SAMPLE,
    "range": RANGE_SAMPLE,
    "flow": FLOW_SAMPLE,
    "ev": EV_SAMPLE,
    "airspeed": AIRSPEED_SAMPLE,
    "auxvel": AUXVEL_SAMPLE,
    "drag": DRAG_SAMPLE,
    "system_flags": SYSTEM_FLAGS_SAMPLE,
}

SAMPLE_FIELDS = [
    field
    for name, sample in SAMPLES.items()
    for field in (
        (f"{name}_sample", sample),
        (f"{name}_data_ready", "?"),
        (f"{name}_newest_time_us", "i8"),
        (f"{name}_buffer_exists", "?"),
    )
]
"""Per sensor: the sample at the fusion time horizon, whether it is new, when one last arrived, whether any ever did."""

EKF = np.dtype(
    [
        *CORE_FIELDS,
        *SAMPLE_FIELDS,
        ("gnss_yaw_newest_time_us", "i8"),
        ("air_density", "f8"),
        ("origin", LOCAL_ORIGIN),
        ("baro_b_est", HEIGHT_BIAS_ESTIMATOR),
        ("gps_hgt_b_est", HEIGHT_BIAS_ESTIMATOR),
        ("ev_hgt_b_est", HEIGHT_BIAS_ESTIMATOR),
        ("ev_pos_b_est", POSITION_BIAS_ESTIMATOR),
        ("gnss", GNSS_MEMORY),
        ("gsf", GSF_MEMORY),
        ("mag", MAG_MEMORY),
        ("baro", BARO_MEMORY),
        ("range", RANGE_MEMORY),
        ("flow", FLOW_MEMORY),
        ("ev", EV_MEMORY),
        ("airspeed", AIRSPEED_MEMORY),
        ("drag", DRAG_MEMORY),
        ("gravity", GRAVITY_MEMORY),
        ("wind", WIND_MEMORY),
        ("zero_gyro", ZERO_GYRO_MEMORY),
        ("down_sampler", DOWN_SAMPLER_MEMORY),
        ("buffers", BUFFERS_MEMORY),
        ("output", OUTPUT_MEMORY),
    ],
    align=True,
)
"""The record `ekf`."""

SEA_LEVEL_AIR_DENSITY = 1.225
LEVELLING_LPF_ALPHA = 0.1
LEVELLING_MIN_SPECIFIC_FORCE = 0.8 * GRAVITY
LEVELLING_MAX_SPECIFIC_FORCE = 1.2 * GRAVITY
LEVELLING_MAX_RATE = math.radians(15.0)
MIN_IMU_INTERVAL_S = 1e-4


@kernel
def initialise_estimator(ekf, params):
    """Give an `EKF` record of zeros the values it has when the vehicle boots."""
    ekf.q[0] = 1.0
    for i in range(3):
        ekf.R_to_earth[i, i] = 1.0
    ekf.state_reset.quat_change[0] = 1.0
    ekf.dt_ekf_avg = 0.01
    ekf.is_first_imu_sample = True
    ekf.cs.in_air = True
    ekf.cs_prev.in_air = True
    ekf.height_sensor_ref = HEIGHT_REF_UNKNOWN
    ekf.position_sensor_ref = POSITION_REF_GNSS
    ekf.horizontal_deadreckon_time_exceeded = True
    ekf.vertical_position_deadreckon_time_exceeded = True
    ekf.vertical_velocity_deadreckon_time_exceeded = True
    ekf.air_density = SEA_LEVEL_AIR_DENSITY
    initialise_local_origin(ekf.origin)
    initialise_height_bias_estimator(ekf.baro_b_est)
    initialise_height_bias_estimator(ekf.gps_hgt_b_est)
    initialise_height_bias_estimator(ekf.ev_hgt_b_est)
    initialise_position_bias_estimator(ekf.ev_pos_b_est)
    initialise_gnss_memory(ekf.gnss)
    initialise_mag_memory(ekf.mag)
    initialise_range_memory(ekf.range)
    initialise_ev_memory(ekf.ev)
    initialise_flow_memory(ekf.flow)
    initialise_gsf_memory(ekf.gsf)
    # on the ground, the vehicle stands this far above it
    ekf.terrain = -ekf.gpos_alt + params.EKF2_MIN_RNG


@kernel
def update(ekf, params, inputs):
    """Run the filter after an IMU sample; return whether its states are new.

    Parameters
    ----------
    ekf : EKF record, with `imu_newest` and `imu_delayed` set if `imu_updated`
    params : EKF2_PARAMETERS record
    inputs : named tuple of sample arrays, `fusetune.ekf2.feed.inputs.EstimatorInputs`
    """
    if not ekf.filter_initialised:
        ekf.filter_initialised = _initialise_filter(ekf, params)
        if not ekf.filter_initialised:
            return False
    if not ekf.imu_updated:
        return False
    ekf.imu_updated = False
    update_average_interval(ekf, params)
    update_imu_bias_inhibit(ekf, params)
    predict_covariance(ekf, params)
    predict_state(ekf, params)
    control_fusion_modes(ekf, params, inputs)
    correct_output(ekf, params)
    return True


@kernel
def _initialise_filter(ekf, params):
    """Level the filter by the filtered specific force once it is close to 1 g and the vehicle hardly turns."""
    imu = ekf.imu_newest
    if imu.delta_vel_dt < MIN_IMU_INTERVAL_S or imu.delta_ang_dt < MIN_IMU_INTERVAL_S:
        return False
    alpha = 1.0 if ekf.is_first_imu_sample else LEVELLING_LPF_ALPHA
    ekf.is_first_imu_sample = False
    for i in range(3):
        ekf.accel_lpf[i] += alpha * (imu.delta_vel[i] / imu.delta_vel_dt - ekf.accel_lpf[i])
        ekf.gyro_lpf[i] += alpha * (imu.delta_ang[i] / imu.delta_ang_dt - ekf.gyro_lpf[i])
    if not _initialise_tilt(ekf):
        return False
    initialise_covariance(ekf, params)
    align_output_predictor(ekf)
    return True


@kernel
def _initialise_tilt(ekf):
    accel, gyro = ekf.accel_lpf, ekf.gyro_lpf
    specific_force = math.sqrt(accel[0] ** 2 + accel[1] ** 2 + accel[2] ** 2)
    rate = math.sqrt(gyro[0] ** 2 + gyro[1] ** 2 + gyro[2] ** 2)
    if (
        specific_force < LEVELLING_MIN_SPECIFIC_FORCE
        or specific_force > LEVELLING_MAX_SPECIFIC_FORCE
        or rate > LEVELLING_MAX_RATE
    ):
        return False
    quat_aligning_with_up(accel[0], accel[1], accel[2], ekf.q)
    quat_to_dcm(ekf.q, ekf.R_to_earth)
    return True
