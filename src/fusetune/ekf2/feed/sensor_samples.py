"""One record type per sensor: a sample as the estimator keeps it in its buffers.

Every `time_us` is the time of the measurement (µs): arrival time less the sensor's delay, and for aiding samples
less half an update interval, as PX4's estimator interface does on arrival. Vectors are FRD (body) or NED; angles
are rad, heights m upwards, magnetic field Gauss.
"""

import numpy as np

IMU_SAMPLE = np.dtype(
    [
        ("time_us", "i8"),
        ("delta_ang", "f8", (3,)),
        ("delta_vel", "f8", (3,)),
        ("delta_ang_dt", "f8"),
        ("delta_vel_dt", "f8"),
        ("delta_vel_clipping", "i8", (3,)),
    ],
    align=True,
)

GNSS_SAMPLE = np.dtype(
    [
        ("time_us", "i8"),
        ("lat_deg", "f8"),
        ("lon_deg", "f8"),
        ("alt", "f8"),
        ("vel", "f8", (3,)),
        ("hacc", "f8"),
        ("vacc", "f8"),
        ("sacc", "f8"),
        ("fix_type", "i8"),
        ("nsats", "i8"),
        ("pdop", "f8"),
        ("yaw", "f8"),
        ("yaw_acc", "f8"),
        ("yaw_offset", "f8"),
        ("spoofed", "?"),
    ],
    align=True,
)

MAG_SAMPLE = np.dtype([("time_us", "i8"), ("mag", "f8", (3,)), ("reset", "?")], align=True)

BARO_SAMPLE = np.dtype([("time_us", "i8"), ("hgt", "f8"), ("reset", "?")], align=True)

RANGE_SAMPLE = np.dtype([("time_us", "i8"), ("range", "f8"), ("quality", "i8")], align=True)

FLOW_SAMPLE = np.dtype(
    [("time_us", "i8"), ("flow_rate", "f8", (2,)), ("gyro_rate", "f8", (3,)), ("quality", "i8")], align=True
)

EV_SAMPLE = np.dtype(
    [
        ("time_us", "i8"),
        ("pos", "f8", (3,)),
        ("quat", "f8", (4,)),
        ("vel", "f8", (3,)),
        ("position_var", "f8", (3,)),
        ("velocity_var", "f8", (3,)),
        ("orientation_var", "f8", (3,)),
        ("pos_frame", "i8"),
        ("vel_frame", "i8"),
        ("reset_counter", "i8"),
        ("quality", "i8"),
    ],
    align=True,
)
"""External vision. Frames: 0 unknown, 1 local NED, 2 local FRD, 3 body FRD (velocity only)."""

EV_FRAME_UNKNOWN, EV_FRAME_NED, EV_FRAME_FRD, EV_FRAME_BODY_FRD = 0, 1, 2, 3

AIRSPEED_SAMPLE = np.dtype([("time_us", "i8"), ("true_airspeed", "f8"), ("eas2tas", "f8")], align=True)

DRAG_SAMPLE = np.dtype([("time_us", "i8"), ("accel_xy", "f8", (2,))], align=True)

AUXVEL_SAMPLE = np.dtype([("time_us", "i8"), ("vel", "f8", (2,)), ("vel_var", "f8", (2,))], align=True)

SYSTEM_FLAGS_SAMPLE = np.dtype(
    [
        ("time_us", "i8"),
        ("at_rest", "?"),
        ("in_air", "?"),
        ("is_fixed_wing", "?"),
        ("gnd_effect", "?"),
        ("constant_pos", "?"),
    ],
    align=True,
)
