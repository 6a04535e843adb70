"""What tells that the bias of the accelerometer is on the wrong side: innovations that have the other sign."""

from fusetune.ekf2.compiled.kernel import kernel

SHARE_OF_LIMIT = 0.9
DOUBT_BEFORE_RESET_US = 7_000_000


@kernel
def down_accel_bias(ekf):
    """Component of `ekf.accel_bias` along the vertical, positive down, in its unit."""
    R, bias = ekf.R_to_earth, ekf.accel_bias
    return R[2, 0] * bias[0] + R[2, 1] * bias[1] + R[2, 2] * bias[2]


@kernel
def contradicts_height(ekf, down_bias):
    """Whether an innovation of a height that is fused has the other sign than a bias."""
    cs, aid = ekf.cs, ekf.aid
    return (
        (cs.baro_hgt and not ekf.sensors.baro.withheld and down_bias * aid.baro_hgt.innovation[0] < 0.0)
        or (cs.ev_hgt and down_bias * aid.ev_hgt.innovation[0] < 0.0)
        or (cs.gps_hgt and not ekf.sensors.gnss.withheld and down_bias * aid.gnss_hgt.innovation[0] < 0.0)
        or (cs.rng_hgt and down_bias * aid.rng_hgt.innovation[0] < 0.0)
    )


@kernel
def contradicts_vertical_velocity(ekf, down_bias, uses_vision):
    """Whether the vertical innovation of a velocity that is fused has the other sign than a bias."""
    cs, aid = ekf.cs, ekf.aid
    return (uses_vision and down_bias * aid.ev_vel.innovation[2] < 0.0) or (
        cs.gnss_vel and not ekf.sensors.gnss.withheld and down_bias * aid.gnss_vel.innovation[2] < 0.0
    )
