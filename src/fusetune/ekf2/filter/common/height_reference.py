"""The source that defines height zero; the others are followed with a bias against it (EKF2_HGT_REF)."""

from fusetune.ekf2.compiled.kernel import kernel

HEIGHT_REF_BARO, HEIGHT_REF_GNSS, HEIGHT_REF_RANGE, HEIGHT_REF_EV, HEIGHT_REF_UNKNOWN = 0, 1, 2, 3, 4
"""Height reference: the values of `EKF2_HGT_REF`, and the unknown one at start."""


@kernel
def give_up_height_reference(ekf, sensor):
    """If this source was the reference, there is none until another is chosen."""
    if ekf.height_sensor_ref == sensor:
        ekf.height_sensor_ref = HEIGHT_REF_UNKNOWN
