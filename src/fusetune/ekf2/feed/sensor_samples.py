"""One record type per sensor: a sample as the estimator keeps it in its buffers.

Every `time_us` is the time of the measurement (µs): arrival time less the sensor's delay, and for aiding samples
less half an update interval, as PX4's estimator interface does on arrival. Vectors are FRD (body) or NED; angles
are rad, heights m upwards, magnetic field Gauss.
"""

import numpy as np

from fusetune.ekf2.feed.record_fields import fields

IMU_SAMPLE = np.dtype(
    [
        ("time_us", "i8"),
        *fields("f8", "delta_ang", "delta_vel", shape=(3,)),
        *fields("f8", "delta_ang_dt", "delta_vel_dt"),
        ("delta_vel_clipping", "i8", (3,)),
    ],
    align=True,
)

GNSS_SAMPLE = np.dtype(
    [
        ("time_us", "i8"),
        *fields("f8", "lat_deg", "lon_deg", "alt"),
        ("vel", "f8", (3,)),
        *fields("f8", "hacc", "vacc", "sacc"),
        *fields("i8", "fix_type", "nsats"),
        *fields("f8", "pdop", "yaw", "yaw_acc", "yaw_offset"),
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
        *fields("f8", "pos", "vel", shape=(3,)),
        ("quat", "f8", (4,)),
        *fields("f8", "position_var", "velocity_var", "orientation_var", shape=(3,)),
        *fields("i8", "pos_frame", "vel_frame", "reset_counter", "quality"),
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
        *fields(
            "?", "at_rest", "in_air", "is_fixed_wing", "gnd_effect", "constant_pos", "status_is_new", "land_is_new"
        ),
    ],
    align=True,
)
