"""The estimator's own memory: state, covariance, flags, timers and resets, shared by all its parts.

`estimator.py` joins these fields with the memory of every aid source into the one record that all kernels take as
their first argument, `ekf`. Times are µs at the fusion time horizon, 0 meaning never.
"""

import numpy as np

from fusetune.ekf2.feed.sensor_samples import IMU_SAMPLE
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCES
from fusetune.ekf2.filter.common.control_status import (
    CONTROL_STATUS,
    FAULT_STATUS,
    INFORMATION_EVENTS,
    INNOVATION_REJECTION,
)
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.replay.withholding import WITHHELD

HEIGHT_REF_BARO, HEIGHT_REF_GNSS, HEIGHT_REF_RANGE, HEIGHT_REF_EV, HEIGHT_REF_UNKNOWN = 0, 1, 2, 3, 4
"""Height reference: the values of `EKF2_HGT_REF`, and the unknown one at start."""

POSITION_REF_GNSS, POSITION_REF_EV = 0, 1

STATE_RESET = np.dtype(
    [
        ("vel_ne_counter", "i8"),
        ("vel_d_counter", "i8"),
        ("pos_ne_counter", "i8"),
        ("pos_d_counter", "i8"),
        ("quat_counter", "i8"),
        ("hagl_counter", "i8"),
        ("vel_ne_change", "f8", (2,)),
        ("vel_d_change", "f8"),
        ("pos_ne_change", "f8", (2,)),
        ("pos_d_change", "f8"),
        ("quat_change", "f8", (4,)),
        ("hagl_change", "f8"),
    ],
    align=True,
)
"""How often a state was reset (modulo 256, as published), and the sum of changes of the last update that did."""

STATE_RESET_COUNTERS = np.dtype(
    [(name, "i8") for name in STATE_RESET.names or () if name.endswith("_counter")],
    align=True,
)

SCRATCH = np.dtype(
    [
        ("H", "f8", (ERROR_STATE_SIZE,)),
        ("K", "f8", (ERROR_STATE_SIZE,)),
        ("PH", "f8", (ERROR_STATE_SIZE,)),
        ("K_reduce", "f8", (ERROR_STATE_SIZE,)),
        ("PH_reduce", "f8", (ERROR_STATE_SIZE,)),
        ("FP", "f8", (9, ERROR_STATE_SIZE)),
        ("quat_before", "f8", (4,)),
        ("quat_error", "f8", (4,)),
        ("R", "f8", (3, 3)),
    ],
    align=True,
)
"""Work space, so that kernels allocate nothing. `H` and `K` are free for any aid source to fill before an update."""

CORE_FIELDS = [
    ("time_delayed_us", "i8"),
    ("time_latest_us", "i8"),
    ("imu_delayed", IMU_SAMPLE),
    ("imu_newest", IMU_SAMPLE),
    ("imu_updated", "?"),
    ("filter_initialised", "?"),
    ("is_first_imu_sample", "?"),
    ("dt_ekf_avg", "f8"),
    ("q", "f8", (4,)),
    ("vel", "f8", (3,)),
    ("gpos_lat", "f8"),
    ("gpos_lon", "f8"),
    ("gpos_alt", "f8"),
    ("gyro_bias", "f8", (3,)),
    ("accel_bias", "f8", (3,)),
    ("mag_I", "f8", (3,)),
    ("mag_B", "f8", (3,)),
    ("wind_vel", "f8", (2,)),
    ("terrain", "f8"),
    ("R_to_earth", "f8", (3, 3)),
    ("P", "f8", (ERROR_STATE_SIZE, ERROR_STATE_SIZE)),
    ("scratch", SCRATCH),
    ("cs", CONTROL_STATUS),
    ("cs_prev", CONTROL_STATUS),
    ("fs", FAULT_STATUS),
    ("reject", INNOVATION_REJECTION),
    ("events", INFORMATION_EVENTS),
    ("aid", AID_SOURCES),
    ("withheld", WITHHELD),
    ("state_reset", STATE_RESET),
    ("state_reset_prev", STATE_RESET_COUNTERS),
    ("height_sensor_ref", "i8"),
    ("position_sensor_ref", "i8"),
    # global position: what predictions and corrections need of the ellipsoid at the present latitude
    ("ellipsoid_lat_ref", "f8"),
    ("ellipsoid_meridian_radius", "f8"),
    ("ellipsoid_transverse_radius", "f8"),
    ("ellipsoid_cos_lat", "f8"),
    ("ellipsoid_tan_lat", "f8"),
    ("earth_rate_lat_ref", "f8"),
    ("earth_rate_ned", "f8", (3,)),
    ("last_known_lat", "f8"),
    ("last_known_lon", "f8"),
    ("last_known_alt", "f8"),
    # low-pass filters
    ("accel_lpf", "f8", (3,)),
    ("gyro_lpf", "f8", (3,)),
    ("accel_horiz_lpf", "f8", (2,)),
    ("height_rate_lpf", "f8"),
    # IMU bias learning
    ("gyro_bias_inhibit", "i8", (3,)),
    ("accel_bias_inhibit", "i8", (3,)),
    ("accel_magnitude_filt", "f8"),
    ("ang_rate_magnitude_filt", "f8"),
    # vertical acceleration health
    ("time_bad_vert_accel", "i8"),
    ("time_good_vert_accel", "i8"),
    ("clip_counter", "i8", (3,)),
    # aiding timers
    ("time_last_horizontal_aiding", "i8"),
    ("time_last_v_pos_aiding", "i8"),
    ("time_last_v_vel_aiding", "i8"),
    ("time_last_hor_pos_fuse", "i8"),
    ("time_last_hgt_fuse", "i8"),
    ("time_last_hor_vel_fuse", "i8"),
    ("time_last_ver_vel_fuse", "i8"),
    ("time_last_heading_fuse", "i8"),
    ("time_last_terrain_fuse", "i8"),
    ("time_last_zero_velocity_fuse", "i8"),
    ("time_last_on_ground", "i8"),
    ("time_last_in_air", "i8"),
    ("time_last_gnd_effect_on", "i8"),
    ("horizontal_deadreckon_time_exceeded", "?"),
    ("vertical_position_deadreckon_time_exceeded", "?"),
    ("vertical_velocity_deadreckon_time_exceeded", "?"),
    # terrain
    ("terrain_valid", "?"),
    ("last_on_ground_pos_d", "f8"),
]

CORE_MEMORY = np.dtype(CORE_FIELDS, align=True)
"""The core alone: enough for the kernels of prediction, measurement update and resets."""
