"""From where on a flight is refused or replayed with a warning: the section `verdict` of the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.number_settings import checked_numbers


@dataclass(frozen=True)
class VerdictThresholds:
    """From where on a flight can be replayed, and from where on it is replayed with a warning.

    Section `verdict` of the configuration. Beyond what is called `min` or `max` a flight is refused, beyond `low` or
    `high` it is replayed with a warning.
    """

    min_imu_rate_hz: float = 50.0
    """Below it the attitude cannot be integrated (EKF2 itself predicts at 100 Hz)."""
    low_imu_rate_hz: float = 100.0
    min_imu_duration_s: float = 10.0
    """EKF2's GNSS checks alone must hold for EKF2_REQ_GPS_H = 10 s before anything is aided."""
    min_imu_coverage: float = 0.5
    """Integrated share of the time between the first and the last IMU sample."""
    low_imu_coverage: float = 0.97
    max_imu_gap_s: float = 30.0
    """A gap so long parts the log into two flights."""
    high_imu_gap_s: float = 0.1
    max_imu_step_back_s: float = 1.0
    """A step of the clock against time that means records are lost or out of order, not merely swapped."""
    max_left_out_share: float = 0.01
    """Share of the IMU samples that are impossible: with more the damage is not one of single bits."""
    high_clipping_share: float = 0.001
    low_gravity_share: float = 0.9
    """Of the specific force, averaged over a second (median), in standard gravity: what flies sees gravity."""
    high_gravity_share: float = 1.3
    min_gravity_share: float = 0.5
    max_gravity_share: float = 2.0
    high_imu_coverage: float = 1.02
    """Integration times cannot add up to more than the time that passed."""
    max_imu_coverage: float = 1.2
    high_stuck_imu_s: float = 0.5
    """Noise moves the sums of an accelerometer or gyroscope from one row to the next."""
    high_stuck_aid_s: float = 5.0
    """Barometers repeat values over a second where the pressure stands still; nothing does so for longer in the air."""
    max_stuck_share: float = 0.5
    """Share of the time in which a sensor is stuck: with more the flight says nothing about the filter."""
    high_repeated_share: float = 0.05
    """Share of the IMU rows that repeat the row before."""
    low_field_strength_ga: float = 0.15
    """The earth's field has 0.22 to 0.67 Gs at the ground (IGRF-13); an uncalibrated sensor may be off by as much."""
    high_field_strength_ga: float = 1.5
    low_magnetometer_rate_hz: float = 10.0
    max_field_scatter_left: float = 0.1
    """Share of the field's scatter left by another mounting of the magnetometer, below which it sits otherwise.

    Of sensors that are mounted as told nearly all is left.
    """
    low_barometer_rate_hz: float = 10.0
    low_gnss_rate_hz: float = 4.0
    low_gnss_fix_share: float = 0.8
    high_gnss_eph_m: float = 3.0
    """Default of EKF2_REQ_EPH, as those of EKF2_REQ_EPV and EKF2_REQ_SACC below."""
    high_gnss_epv_m: float = 5.0
    high_gnss_speed_error_m_s: float = 0.5
    low_airborne_s: float = 10.0
    low_lead_s: float = 10.0
    """Time on the ground before take-off in which the filter aligns and the GNSS checks hold."""

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> VerdictThresholds:
        """Thresholds from the section `verdict` of the configuration; keys left out have their defaults.

        Raises
        ------
        UserError
            A key is no threshold, or its value no finite number from 0 on.
        """
        return cls(**checked_numbers("verdict", "threshold", cls, values))
