"""Which causes are asked, in the order in which they stand in the documentation; each a function named `diagnose`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fusetune.analyze.diagnosis.causes import (
    accelerometer_clipping,
    airspeed_scale,
    baro_drift,
    baro_ground_effect,
    flow_delay,
    flow_rotation,
    flow_scale,
    gnss_accuracy,
    gnss_delay,
    gnss_glitch,
    gnss_interference,
    gnss_lever_arm,
    gnss_loss,
    gyro_bias,
    imu_gaps,
    instance_whipsaw,
    magnetic_disturbance,
    magnetometer_rotated,
    magnetometer_scale,
    motor_magnetic_field,
    noise_claim,
    parameter_at_limit,
    propeller_wash,
    range_obstruction,
    range_step,
    sensor_stuck,
    static_pressure,
    vibration,
    vision_covariance,
    vision_delay,
    vision_scale,
    vision_yaw,
    yaw_alignment,
)
from fusetune.analyze.diagnosis.diagnosis import Diagnosis
from fusetune.analyze.diagnosis.signs import Signs

MODULES = (
    vibration,
    accelerometer_clipping,
    gyro_bias,
    imu_gaps,
    yaw_alignment,
    magnetic_disturbance,
    motor_magnetic_field,
    magnetometer_rotated,
    magnetometer_scale,
    gnss_accuracy,
    gnss_glitch,
    gnss_loss,
    gnss_interference,
    gnss_delay,
    gnss_lever_arm,
    baro_ground_effect,
    static_pressure,
    propeller_wash,
    baro_drift,
    range_obstruction,
    range_step,
    flow_scale,
    flow_delay,
    flow_rotation,
    vision_yaw,
    vision_scale,
    vision_delay,
    vision_covariance,
    airspeed_scale,
    noise_claim,
    parameter_at_limit,
    instance_whipsaw,
    sensor_stuck,
)

CAUSES: Mapping[str, Callable[[Signs], Diagnosis | None]] = {
    module.__name__.rpartition(".")[2]: module.diagnose for module in MODULES
}
"""By id, which is the name of the file."""
