"""Which checks a verdict is made of, in the order in which they run and are told.

A check is a function in a file named for what it looks at; here it is only listed. What the lists mean for a flight is
said in `fusetune.save.verdict`.
"""

from __future__ import annotations

from fusetune.check import Check
from fusetune.save.checks.aiding import horizontal_aid, samples_given
from fusetune.save.checks.barometer import barometer, barometer_stuck
from fusetune.save.checks.flight import airborne, estimator_instances, imu_selection, land_detector, log_start
from fusetune.save.checks.gnss import (
    gnss,
    gnss_fix,
    gnss_height_accuracy,
    gnss_position_accuracy,
    gnss_speed_accuracy,
    gnss_stuck,
)
from fusetune.save.checks.imu import (
    imu_clipping,
    imu_clock,
    imu_coverage,
    imu_duration,
    imu_gaps,
    imu_present,
    imu_rate,
)
from fusetune.save.checks.imu_values import accelerometer_gravity, accelerometer_stuck, gyroscope_stuck, imu_repeats
from fusetune.save.checks.judged_flight import JudgedFlight
from fusetune.save.checks.log import (
    definitions,
    firmware,
    logging_profile,
    readable,
    sensor_values,
    tables,
    time_stamps,
)
from fusetune.save.checks.magnetometer import magnetometer, magnetometer_strength, magnetometer_stuck
from fusetune.save.checks.magnetometer_mounting import magnetometer_mounting
from fusetune.save.checks.parameters import parameter_changes, parameter_values

OF_THE_LOG: tuple[Check[JudgedFlight], ...] = (
    readable,
    definitions,
    tables,
    time_stamps,
    sensor_values,
    firmware,
    parameter_values,
    logging_profile,
)
"""They need nothing of a flight."""

NEEDED: Check[JudgedFlight] = imu_present
"""Without it no other is asked."""

OF_THE_IMU: tuple[Check[JudgedFlight], ...] = (
    imu_clock,
    imu_rate,
    imu_duration,
    imu_gaps,
    imu_coverage,
    imu_clipping,
    accelerometer_gravity,
    accelerometer_stuck,
    gyroscope_stuck,
    imu_repeats,
)
"""After a failed one the rest of them is left out."""

OF_THE_FLIGHT: tuple[Check[JudgedFlight], ...] = (
    magnetometer,
    magnetometer_mounting,
    barometer,
    gnss,
    gnss_fix,
    gnss_position_accuracy,
    gnss_height_accuracy,
    gnss_speed_accuracy,
    horizontal_aid,
    samples_given,
    magnetometer_stuck,
    magnetometer_strength,
    barometer_stuck,
    gnss_stuck,
    land_detector,
    airborne,
    log_start,
    estimator_instances,
    imu_selection,
    parameter_changes,
)

CHECKS: tuple[Check[JudgedFlight], ...] = (*OF_THE_LOG, NEEDED, *OF_THE_IMU, *OF_THE_FLIGHT)
"""All of them."""
