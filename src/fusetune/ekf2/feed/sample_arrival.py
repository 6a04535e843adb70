"""What parameters say of a sample's noise or mounting, which is what they said when it arrived.

Mirrors what PX4 v1.16's `EKF2.cpp` and `EKF/estimator_interface.cpp` do to a sample before they buffer it.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel

NOTE = np.dtype(
    [
        ("run", "i8"),
        ("yaw_offset_deg", "f8"),
        *((name, "f8") for name in ("position_noise", "velocity_noise", "attitude_noise")),
        ("noise_mode", "i8"),
    ],
    align=True,
)
"""From which run on: EKF2_GPS_YAW_OFF, EKF2_EVP_NOISE (m), EKF2_EVV_NOISE (m/s), EKF2_EVA_NOISE (rad) and
EKF2_EV_NOISE_MD."""

NOTED = dict(
    zip(
        ("EKF2_GPS_YAW_OFF", "EKF2_EVP_NOISE", "EKF2_EVV_NOISE", "EKF2_EVA_NOISE", "EKF2_EV_NOISE_MD"),
        (NOTE.names or ())[1:],
        strict=True,
    )
)
"""Field of a NOTE by parameter."""


@kernel
def is_fusion_due(sensor):
    """Whether the filter is to use the sample in hand: there is one, and no experiment withholds the sensor."""
    return sensor.data_ready and not sensor.withheld


@kernel
def apply_antenna_yaw_offset(sample, note):
    """Use EKF2_GPS_YAW_OFF where a GNSS sample reports a heading but no offset of its own."""
    offset = np.deg2rad(note.yaw_offset_deg)
    if abs(offset) > 0.0 and not np.isfinite(sample.yaw_offset) and np.isfinite(sample.yaw):
        offset = np.arctan2(np.sin(offset), np.cos(offset))
        sample.yaw_offset = offset
        sample.yaw = np.arctan2(np.sin(sample.yaw - offset), np.cos(sample.yaw - offset))


@kernel
def apply_vision_noise(sample, note):
    """Replace the variances of a vision sample by the parameters, or floor them (EKF2_EV_NOISE_MD)."""
    use_reported = note.noise_mode == 0
    _floor_variance(sample.position_var, note.position_noise, use_reported)
    _floor_variance(sample.velocity_var, note.velocity_noise, use_reported)
    _floor_variance(sample.orientation_var, note.attitude_noise, use_reported)


@kernel
def _floor_variance(variance, noise, use_reported):
    reported = use_reported and np.isfinite(variance[0]) and np.isfinite(variance[1]) and np.isfinite(variance[2])
    for axis in range(3):
        variance[axis] = max(noise * noise, variance[axis]) if reported else noise * noise
