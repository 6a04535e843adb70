"""The estimator's own memory: state, covariance, flags, timers and resets, shared by all its parts.

`estimator.py` joins these fields with the memory of every aid source into the one record that all kernels take as
their first argument, `ekf`. Times are µs at the fusion time horizon, 0 meaning never.
"""

import numpy as np

from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.feed.sensor_samples import IMU_SAMPLE
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCES
from fusetune.ekf2.filter.common.control_status import (
    CONTROL_STATUS,
    FAULT_STATUS,
    INFORMATION_EVENTS,
    INNOVATION_REJECTION,
)
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE

POSITION_REF_GNSS, POSITION_REF_EV = 0, 1

STATE_RESET = np.dtype(
    [
        *fields(
            "i8", "vel_ne_counter", "vel_d_counter", "pos_ne_counter", "pos_d_counter", "quat_counter", "hagl_counter"
        ),
        *fields("f8", "vel_ne_change", "pos_ne_change", shape=(2,)),
        *fields("f8", "vel_d_change", "pos_d_change", "hagl_change"),
        ("quat_change", "f8", (4,)),
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
        *fields("f8", "H", "K", "PH", shape=(ERROR_STATE_SIZE,)),
        ("HPH", "f8"),
        *fields("f8", "quat_before", "quat_error", shape=(4,)),
        ("R", "f8", (3, 3)),
    ],
    align=True,
)
"""Work space, so that kernels allocate nothing. Of an observation: `H` its Jacobian, free for any aid source to fill,
`PH` P Hᵀ, `HPH` H P Hᵀ, `K` the gain; an update takes the last three from here.
"""

CORE_FIELDS = [
    # first, so that rows begin where cache lines do; see `zeros_on_cache_lines`
    ("P", "f8", (ERROR_STATE_SIZE, ERROR_STATE_SIZE)),
    ("scratch", SCRATCH),
    *fields("i8", "time_delayed_us", "time_latest_us"),
    ("imu_delayed", IMU_SAMPLE),
    ("filter_initialised", "?"),
    ("dt_ekf_avg", "f8"),
    ("q", "f8", (4,)),
    ("vel", "f8", (3,)),
    *fields("f8", "gpos_lat", "gpos_lon", "gpos_alt"),
    *fields("f8", "gyro_bias", "accel_bias", "mag_I", "mag_B", shape=(3,)),
    ("wind_vel", "f8", (2,)),
    ("terrain", "f8"),
    ("R_to_earth", "f8", (3, 3)),
    ("cs", CONTROL_STATUS),
    ("cs_prev", CONTROL_STATUS),
    ("fs", FAULT_STATUS),
    ("reject", INNOVATION_REJECTION),
    ("events", INFORMATION_EVENTS),
    ("aid", AID_SOURCES),
    ("state_reset", STATE_RESET),
    ("state_reset_prev", STATE_RESET_COUNTERS),
    ("height_sensor_ref", "i8"),
    ("position_sensor_ref", "i8"),
    # global position: what predictions and corrections need of the ellipsoid at the present latitude
    *fields("f8", "ellipsoid_lat_ref", "ellipsoid_meridian_radius", "ellipsoid_transverse_radius"),
    *fields("f8", "ellipsoid_cos_lat", "ellipsoid_tan_lat", "earth_rate_lat_ref"),
    ("earth_rate_ned", "f8", (3,)),
    *fields("f8", "last_known_lat", "last_known_lon", "last_known_alt"),
    # low-pass filters
    ("accel_horiz_lpf", "f8", (2,)),
    ("height_rate_lpf", "f8"),
    # IMU bias learning
    *fields("i8", "gyro_bias_inhibit", "accel_bias_inhibit", shape=(3,)),
    *fields("f8", "accel_magnitude_filt", "ang_rate_magnitude_filt"),
    # vertical acceleration health
    *fields("i8", "time_bad_vert_accel", "time_good_vert_accel"),
    ("clip_counter", "i8", (3,)),
    # aiding timers
    *fields("i8", "time_last_horizontal_aiding", "time_last_v_pos_aiding", "time_last_v_vel_aiding"),
    *fields("i8", "time_last_hor_pos_fuse", "time_last_hgt_fuse", "time_last_hor_vel_fuse", "time_last_ver_vel_fuse"),
    *fields("i8", "time_last_heading_fuse", "time_last_terrain_fuse", "time_last_zero_velocity_fuse"),
    *fields("i8", "time_last_on_ground", "time_last_in_air", "time_last_gnd_effect_on"),
    *fields("?", "horizontal_deadreckon_time_exceeded", "vertical_position_deadreckon_time_exceeded"),
    ("vertical_velocity_deadreckon_time_exceeded", "?"),
    # terrain
    ("terrain_valid", "?"),
    ("last_on_ground_pos_d", "f8"),
]

CORE_MEMORY = np.dtype(CORE_FIELDS, align=True)
"""The core alone: enough for the kernels of prediction, measurement update and resets."""

CACHE_LINE = 64


def zeros_on_cache_lines(dtype: np.dtype) -> np.ndarray:
    """A record of zeros, as an array of one, that begins with a cache line.

    NumPy aligns to 16 bytes; covariance rows that straddle the lines make a scalar update 10 % slower.
    """
    memory = np.zeros(dtype.itemsize + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % CACHE_LINE
    return memory[start : start + dtype.itemsize].view(dtype)
