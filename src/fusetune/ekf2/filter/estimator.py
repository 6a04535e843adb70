"""The whole estimator: its memory in one record, and one update.

`update` predicts covariance and state over the interval at the fusion time horizon, lets every aid source act, and
corrects the output predictor.

Mirrors PX4 v1.16 `EKF/ekf.cpp`, whose `predictState` stands in `prediction.py`.
"""

from functools import cache

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.buffers import BUFFER_LENGTHS
from fusetune.ekf2.feed.sensors import SENSORS
from fusetune.ekf2.filter.accel_bias_check import ACCEL_BIAS_CHECK
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_memory import AIRSPEED_MEMORY
from fusetune.ekf2.filter.aid_sources.barometer.baro_memory import BARO_MEMORY
from fusetune.ekf2.filter.aid_sources.barometer.baro_offset_bias import initialise_baro_bias
from fusetune.ekf2.filter.aid_sources.drag.drag_memory import DRAG_MEMORY
from fusetune.ekf2.filter.aid_sources.external_vision.ev_memory import EV_MEMORY, initialise_ev_memory
from fusetune.ekf2.filter.aid_sources.external_vision.vision_by_mask import VISION_STEPS
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import GNSS_ARRIVALS
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import (
    GNSS_MEMORY,
    GNSS_TRUST,
    GNSS_YAW_RETRIES,
    initialise_gnss_memory,
)
from fusetune.ekf2.filter.aid_sources.gnss.gnss_taken import GNSS_TAKEN
from fusetune.ekf2.filter.aid_sources.gravity.gravity_fusion import GRAVITY_MEMORY
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_memory import (
    FIELD_HISTORY,
    MAG_MEMORY,
    MAG_MODES,
    initialise_mag_memory,
    initialise_mag_modes,
)
from fusetune.ekf2.filter.aid_sources.optical_flow.flow_memory import FLOW_MEMORY, FLOW_RATES, initialise_flow_memory
from fusetune.ekf2.filter.aid_sources.optical_flow.integrated_flow import FLOW_INTEGRALS
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import RANGE_MEMORY, initialise_range_memory
from fusetune.ekf2.filter.aid_sources.zero_gyro_update import ZERO_GYRO_MEMORY
from fusetune.ekf2.filter.bias_estimator.height_bias_estimator import (
    HEIGHT_BIAS_ESTIMATOR,
    initialise_height_bias_estimator,
)
from fusetune.ekf2.filter.bias_estimator.position_bias_estimator import (
    POSITION_BIAS_ESTIMATOR,
    initialise_position_bias_estimator,
)
from fusetune.ekf2.filter.bias_inhibition import update_imu_bias_inhibit
from fusetune.ekf2.filter.common.aid_source_status import OLD_AID_SOURCES
from fusetune.ekf2.filter.common.core_memory import CORE_FIELDS, POSITION_REF_GNSS
from fusetune.ekf2.filter.common.heading_observability import HEADING_MEMORY
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_UNKNOWN
from fusetune.ekf2.filter.common.levelling import LEVELLING_MEMORY, follow_specific_force
from fusetune.ekf2.filter.common.local_origin import LOCAL_ORIGIN, initialise_local_origin
from fusetune.ekf2.filter.common.local_position import LOCAL_POSITION
from fusetune.ekf2.filter.control import control_fusion_modes
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.one_height_source import HEIGHTS
from fusetune.ekf2.filter.output_predictor.output_predictor import OUTPUT_MEMORY, align_output_predictor, correct_output
from fusetune.ekf2.filter.prediction import predict_covariance, predict_state
from fusetune.ekf2.filter.quaternion_core.core_memory import QUATERNION_CORE, initialise_quaternion_core
from fusetune.ekf2.filter.quaternion_core.quaternion_start import add_heading_uncertainty
from fusetune.ekf2.filter.sample_start import start_by_angles_and_field
from fusetune.ekf2.filter.terrain_filter.terrain_filter import run_terrain_filter, start_terrain_filter
from fusetune.ekf2.filter.terrain_filter.terrain_memory import TERRAIN_FILTER
from fusetune.ekf2.filter.vertical_innovations import VERTICAL_INNOVATIONS
from fusetune.ekf2.filter.wind import WIND_MEMORY
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import GSF_MEMORY
from fusetune.ekf2.filter.yaw_estimator.matrix_bank import MATRIX_BANK, YAW_VELOCITY
from fusetune.ekf2.filter.yaw_estimator.yaw_bank import initialise_yaw_bank
from fusetune.ekf2.numerics.constants import AIR_DENSITY_SEA_LEVEL
from fusetune.ekf2.numerics.rotations import quat_aligning_with_up, quat_to_dcm
from fusetune.ekf2.releases.behaviours import BASELINE, BEHAVIOURS
from fusetune.ekf2.releases.by_release import by_release, marked

EKF = np.dtype(
    [
        *CORE_FIELDS,
        ("sensors", SENSORS),
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
        ("buffers", BUFFER_LENGTHS),
        ("output", OUTPUT_MEMORY),
    ],
    align=True,
)
"""The record `ekf`."""


RELEASE_MEMORIES = (
    ("levels_at_the_horizon", "levelling", LEVELLING_MEMORY),
    ("controls_gnss_sources_apart", "gnss_trust", GNSS_TRUST),
    ("scales_terrain_to_flow", "flow_rates", FLOW_RATES),
    ("holds_unobservable_heading", "heading", HEADING_MEMORY),
    ("limits_declination", "field_history", FIELD_HISTORY),
    ("fuses_heading_or_field", "mag_modes", MAG_MODES),
    ("filters_terrain_apart", "terrain_filter", TERRAIN_FILTER),
    ("filters_terrain_apart", "rng_hgt_b_est", HEIGHT_BIAS_ESTIMATOR),
    ("keeps_position_local", "local", LOCAL_POSITION),
    ("adds_quaternion_errors", "quaternion", QUATERNION_CORE),
    ("doubts_stuck_accel_bias", "accel_bias_check", ACCEL_BIAS_CHECK),
    ("keeps_yaw_bank_as_matrices", "yaw_matrices", MATRIX_BANK),
    ("retries_gnss_yaw", "gnss_yaw_retries", GNSS_YAW_RETRIES),
    ("checks_gnss_on_arrival", "gnss_arrivals", GNSS_ARRIVALS),
    ("checks_gnss_on_arrival", "yaw_velocity", YAW_VELOCITY),
    ("integrates_flow", "flow_interval", np.dtype("f8")),
    ("integrates_flow", "flow_integrals", FLOW_INTEGRALS),
    ("feels_drag_in_air", "drag_waits", np.dtype("?")),
    ("fuses_vision_by_mask", "vision_steps", VISION_STEPS),
    ("aids_gnss_by_mask", "gnss_taken", GNSS_TAKEN),
    ("aids_gnss_by_mask", "vertical", VERTICAL_INNOVATIONS),
    ("has_one_height_source", "heights", HEIGHTS),
)
"""What a behaviour remembers, under which name of the record."""


@cache
def ekf_record(release: str) -> np.dtype:
    """The record `ekf` of a release: that of v1.16, followed by what its own behaviours remember."""
    if release == BASELINE:
        return EKF
    does = BEHAVIOURS[release]
    memories = [(name, EKF[name]) for name in EKF.names or ()]
    if does.filters_terrain_apart:
        memories = [(name, OLD_AID_SOURCES if name == "aid" else memory) for name, memory in memories]
    memories += [(name, memory) for behaviour, name, memory in RELEASE_MEMORIES if getattr(does, behaviour)]
    return marked(np.dtype(memories, align=True), release)


@kernel
def _initialise_nothing(ekf):
    """v1.16's range finder has no bias."""


@kernel
def _have_no_heights(ekf):
    """Since v1.14 each source has a bias."""


@kernel
def _initialise_bias_of_range(ekf):
    initialise_height_bias_estimator(ekf.rng_hgt_b_est)


@kernel
def _initialise_bias_of_baro(ekf):
    initialise_baro_bias(ekf.heights.baro_bias)


_initialise_heights = by_release(_have_no_heights, "has_one_height_source", _initialise_bias_of_baro)
_initialise_range_bias = by_release(_initialise_nothing, "takes_range_for_height", _initialise_bias_of_range)


@kernel
def initialise_estimator(ekf, params):
    """Give an `EKF` record of zeros the values it has when the vehicle boots."""
    ekf.q[0] = 1.0
    for i in range(3):
        ekf.R_to_earth[i, i] = 1.0
    ekf.state_reset.quat_change[0] = 1.0
    ekf.dt_ekf_avg = 0.01
    ekf.cs.in_air = True
    ekf.cs_prev.in_air = True
    ekf.height_sensor_ref = HEIGHT_REF_UNKNOWN
    ekf.position_sensor_ref = POSITION_REF_GNSS
    ekf.horizontal_deadreckon_time_exceeded = True
    ekf.vertical_position_deadreckon_time_exceeded = True
    ekf.vertical_velocity_deadreckon_time_exceeded = True
    ekf.air_density = AIR_DENSITY_SEA_LEVEL
    initialise_local_origin(ekf.origin)
    initialise_height_bias_estimator(ekf.baro_b_est)
    initialise_height_bias_estimator(ekf.gps_hgt_b_est)
    initialise_height_bias_estimator(ekf.ev_hgt_b_est)
    _initialise_range_bias(ekf)
    initialise_position_bias_estimator(ekf.ev_pos_b_est)
    initialise_gnss_memory(ekf.gnss)
    initialise_mag_memory(ekf.mag)
    initialise_mag_modes(ekf)
    initialise_range_memory(ekf.range)
    initialise_ev_memory(ekf.ev)
    initialise_flow_memory(ekf.flow)
    _initialise_heights(ekf)
    initialise_yaw_bank(ekf)
    initialise_quaternion_core(ekf)
    # on the ground, the vehicle stands this far above it
    ekf.terrain = -ekf.gpos_alt + params.EKF2_MIN_RNG


@kernel
def _level_filter(ekf, params, levelling):
    """Start the filter: level it by the specific force (m/s², body), the attitude that it measures at rest."""
    specific_force = levelling.accel
    quat_aligning_with_up(specific_force[0], specific_force[1], specific_force[2], ekf.q)
    quat_to_dcm(ekf.q, ekf.R_to_earth)
    initialise_covariance(ekf, params)
    start_terrain_filter(ekf, params)
    align_output_predictor(ekf)
    ekf.filter_initialised = True


@kernel
def _level_filter_and_remember(ekf, params, levelling):
    """As v1.16, with the low-passed specific force kept."""
    for axis in range(3):
        ekf.levelling.specific_force[axis] = levelling.accel[axis]
    _level_filter(ekf, params, levelling)


@kernel
def _start_with_samples(ekf, params, levelling):
    """Start with tilt, heading and the barometer's height."""
    start_by_angles_and_field(ekf, params, levelling)
    initialise_covariance(ekf, params)
    add_heading_uncertainty(ekf, params)
    start_terrain_filter(ekf, params)
    ekf.time_last_hgt_fuse = ekf.time_latest_us
    ekf.time_last_hor_pos_fuse = ekf.time_latest_us
    ekf.time_last_hor_vel_fuse = ekf.time_latest_us
    align_output_predictor(ekf)
    ekf.filter_initialised = True


level_filter = by_release(
    by_release(_level_filter, "levels_at_the_horizon", _level_filter_and_remember),
    "starts_with_samples",
    _start_with_samples,
)
"""Start the filter by what LEVELLING holds: the tilt by the specific force; in v1.13 also heading and height."""


@kernel
def _update(ekf, params):
    """Run the filter over `ekf.imu_delayed`, with the samples that are due in `ekf.sensors`.

    Parameters
    ----------
    ekf : EKF record
    params : EKF2_PARAMETERS record
    """
    update_imu_bias_inhibit(ekf, params)
    predict_covariance(ekf, params)
    predict_state(ekf, params)
    control_fusion_modes(ekf, params)
    run_terrain_filter(ekf, params)
    correct_output(ekf, params)


@kernel
def _update_after_state(ekf, params):
    """As v1.16, with the state predicted first, and what is noted and asked for by the time of the newest sample."""
    predict_state(ekf, params)
    update_imu_bias_inhibit(ekf, params)
    predict_covariance(ekf, params)
    ekf.time_delayed_us = ekf.time_latest_us
    control_fusion_modes(ekf, params)
    run_terrain_filter(ekf, params)
    ekf.time_delayed_us = ekf.imu_delayed.time_us
    correct_output(ekf, params)


@kernel
def _update_and_follow_force(ekf, params):
    """As v1.16, after the specific force at the horizon has been low-passed."""
    follow_specific_force(ekf)
    _update(ekf, params)


update = by_release(
    by_release(_update, "levels_at_the_horizon", _update_and_follow_force), "predicts_state_first", _update_after_state
)
