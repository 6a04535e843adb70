"""Causes that are nothing but consequences of another that holds on the same flight.

Each pair says what separates the two where they do stand side by side: what is told here is only that the first, where
it holds at the same time, makes the signs of the second by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fusetune.analyze.diagnosis.diagnosis import Diagnosis

GRACE_US = 3_000_000
"""Consequences outlive their cause: filters settle within some seconds."""

MAKES: Mapping[str, tuple[str, ...]] = {
    "accelerometer_clipping": (
        "vibration",
        "baro_drift",
        "noise_claim",
        "gnss_delay",
        "gnss_lever_arm",
        "static_pressure",
        "range_step",
        "vision_scale",
        "vision_delay",
        "magnetic_disturbance",
    ),
    "vibration": (
        "noise_claim",
        "baro_drift",
        "static_pressure",
        "gnss_delay",
        "gnss_lever_arm",
        "vision_scale",
        "vision_delay",
        "range_step",
        "parameter_at_limit",
    ),
    "gyro_bias": ("magnetic_disturbance", "yaw_alignment", "motor_magnetic_field", "gnss_lever_arm", "gnss_delay"),
    "imu_gaps": ("noise_claim",),
    "gnss_interference": (
        "gnss_loss",
        "gnss_accuracy",
        "gnss_glitch",
        "noise_claim",
        "sensor_stuck",
        "gnss_delay",
        "baro_drift",
    ),
    "gnss_accuracy": ("noise_claim", "gnss_glitch", "gnss_delay", "gnss_lever_arm", "baro_drift"),
    "gnss_glitch": ("baro_drift", "noise_claim", "gnss_delay", "gnss_lever_arm"),
    "gnss_loss": ("baro_drift",),
    "sensor_stuck": (
        "magnetic_disturbance",
        "magnetometer_scale",
        "baro_drift",
        "gnss_glitch",
        "gnss_loss",
        "gnss_delay",
        "gnss_lever_arm",
        "yaw_alignment",
        "motor_magnetic_field",
    ),
    "magnetometer_rotated": (
        "yaw_alignment",
        "magnetic_disturbance",
        "magnetometer_scale",
        "motor_magnetic_field",
        "vision_yaw",
    ),
    "motor_magnetic_field": ("yaw_alignment", "magnetometer_scale"),
    "magnetometer_scale": ("yaw_alignment",),
    "yaw_alignment": ("magnetometer_scale", "magnetic_disturbance"),
    "gnss_delay": ("noise_claim",),
    "gnss_lever_arm": ("noise_claim",),
    "range_obstruction": ("range_step", "flow_scale", "flow_delay", "flow_rotation"),
    "range_step": ("flow_delay",),
    "propeller_wash": ("baro_drift",),
    "baro_ground_effect": ("baro_drift",),
    "static_pressure": ("baro_drift",),
    "flow_rotation": ("flow_scale", "flow_delay"),
    "flow_scale": ("flow_delay",),
    "vision_scale": ("vision_delay",),
    "vision_delay": ("vision_scale",),
}
"""Cause → what it makes look like a cause of its own: what was seen with it alone, or what its own signs are made of.
More would hide a second cause that is there."""


def explained_away(found: Iterable[Diagnosis]) -> list[Diagnosis]:
    """What is left of some diagnoses without those that another of them makes at the same time."""
    found = list(found)
    by_id = {one.id: one for one in found}
    gone: set[str] = set()
    for cause, made in MAKES.items():
        first = by_id.get(cause)
        if first is None or cause in gone:
            continue
        for other in made:
            second = by_id.get(other)
            if second is not None and other not in gone and _meet(first, second) and _may_follow(second):
                gone.add(other)
    return [one for one in found if one.id not in gone]


HELD_AGAINST_OTHERS = ("EKF2_GPS_V_NOISE", "EKF2_GPS_P_NOISE")
"""Noises that are measured with the IMU or GNSS; that of a barometer or magnetometer is of its own readings alone."""


def _may_follow(second: Diagnosis) -> bool:
    """Whether another cause can make it: of claimed noises those of sensors that are held against others."""
    return second.id != "noise_claim" or all(name in HELD_AGAINST_OTHERS for name in second.values)


def _meet(first: Diagnosis, second: Diagnosis) -> bool:
    return first.start_us - GRACE_US <= second.stop_us and second.start_us <= first.stop_us + GRACE_US
