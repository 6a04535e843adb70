"""From where on a flight is refused or replayed with a warning: every threshold, its default and its source."""

from __future__ import annotations

from dataclasses import dataclass

from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class VerdictThresholds:
    """From where on a flight is refused (`min`, `max`) or replayed with a warning (`low`, `high`).

    Section `verdict` of the configuration.
    """

    min_imu_rate_hz: float = setting(50.0, "below this IMU rate a flight is refused", unit="Hz", low=1, high=1000)
    """Below it the attitude cannot be integrated (EKF2 itself predicts at 100 Hz)."""
    low_imu_rate_hz: float = setting(
        100.0, "below this IMU rate it is replayed with a warning", unit="Hz", low=1, high=1000
    )
    """EKF2's own rate: it puts faster samples together to steps of EKF2_PREDICT_US = 10 ms."""
    min_imu_duration_s: float = setting(
        10.0, "a log with less time of IMU samples is refused", unit="s", low=1, high=3600
    )
    """EKF2's GNSS checks alone must hold for EKF2_REQ_GPS_H = 10 s before anything is aided."""
    min_imu_coverage: float = setting(
        0.5, "below this share of the time covered by IMU samples a flight is refused", low=0, high=1
    )
    """Integrated share of the time between the first and the last IMU sample."""
    low_imu_coverage: float = setting(
        0.97, "below this share of the time covered by IMU samples it is replayed with a warning", low=0, high=1
    )
    max_imu_gap_s: float = setting(
        30.0, "with a longer gap between IMU samples a flight is refused", unit="s", low=0.1, high=3600
    )
    """A gap so long parts the log into two flights."""
    high_imu_gap_s: float = setting(
        0.1, "with a longer gap between IMU samples it is replayed with a warning", unit="s", low=0.01, high=60
    )
    max_imu_step_back_s: float = setting(
        1.0, "with a larger step back of the time a flight is refused", unit="s", low=0, high=60
    )
    """A step of the clock against time that means records are lost or out of order, not merely swapped."""
    max_left_out_share: float = setting(
        0.01, "with a larger share of impossible IMU samples a flight is refused", low=0, high=1
    )
    """With more the damage is not one of single bits."""
    high_clipping_share: float = setting(
        0.001, "above this share of clipping IMU samples there is a warning", low=0, high=1
    )
    low_gravity_share: float = setting(
        0.9,
        "below this specific force (mean over a second, median, in g) there is a warning",
        unit="g",
        low=0,
        high=10,
    )
    """What flies sees gravity."""
    high_gravity_share: float = setting(1.3, "above this specific force there is a warning", unit="g", low=0, high=10)
    min_gravity_share: float = setting(
        0.5,
        "below this specific force a flight is refused: the accelerometer does not see gravity",
        unit="g",
        low=0,
        high=10,
    )
    max_gravity_share: float = setting(2.0, "above this specific force a flight is refused", unit="g", low=0, high=10)
    high_imu_coverage: float = setting(
        1.02,
        "where the integration times of the IMU add up to more than this share of the time there is a warning",
        low=1,
        high=10,
    )
    """They cannot add up to more than the time that passed."""
    max_imu_coverage: float = setting(
        1.2, "where the integration times of the IMU add up to more than this share a flight is refused", low=1, high=10
    )
    high_stuck_imu_s: float = setting(
        0.5,
        "with an axis of accelerometer or gyroscope standing still for longer in the air there is a warning",
        unit="s",
        low=0.01,
        high=60,
    )
    """Noise moves the sums of an accelerometer or gyroscope from one row to the next."""
    high_stuck_aid_s: float = setting(
        5.0,
        "with magnetometer, barometer or GNSS standing still for longer in the air there is a warning",
        unit="s",
        low=0.1,
        high=600,
    )
    """Barometers repeat values over a second where the pressure stands still; nothing does so for longer in the air."""
    max_stuck_share: float = setting(
        0.5, "with a sensor standing still in a larger share of the time in the air a flight is refused", low=0, high=1
    )
    """With more the flight says nothing about the filter."""
    high_repeated_share: float = setting(
        0.05, "above this share of IMU samples that repeat the one before there is a warning", low=0, high=1
    )
    low_field_strength_ga: float = setting(
        0.15,
        "below this strength of the measured magnetic field (median) there is a warning",
        unit="Gs",
        low=0,
        high=10,
    )
    """The earth's field has 0.22 to 0.67 Gs at the ground (IGRF-13); an uncalibrated sensor may be off by as much."""
    high_field_strength_ga: float = setting(
        1.5, "above this strength of the measured magnetic field there is a warning", unit="Gs", low=0, high=100
    )
    low_magnetometer_rate_hz: float = setting(
        10.0, "below this rate of the magnetometer there is a warning", unit="Hz", low=0, high=1000
    )
    max_field_scatter_left: float = setting(
        0.1,
        "with less of the field's scatter left by turning the magnetometer by quarter turns there is a warning",
        low=0,
        high=1,
    )
    """The magnetometer then sits otherwise than told; of one that is mounted as told nearly all is left."""
    low_barometer_rate_hz: float = setting(
        10.0, "below this rate of the barometer there is a warning", unit="Hz", low=0, high=1000
    )
    low_gnss_rate_hz: float = setting(4.0, "below this rate of GNSS there is a warning", unit="Hz", low=0, high=100)
    low_gnss_fix_share: float = setting(
        0.8,
        "below this share of GNSS samples with a 3D fix, or that the estimator takes, there is a warning",
        low=0,
        high=1,
    )
    high_gnss_eph_m: float = setting(
        3.0, "above this reported horizontal error (median) there is a warning", unit="m", low=0, high=1000
    )
    """Default of EKF2_REQ_EPH."""
    high_gnss_epv_m: float = setting(
        5.0, "above this reported vertical error (median) there is a warning", unit="m", low=0, high=1000
    )
    """Default of EKF2_REQ_EPV."""
    high_gnss_speed_error_m_s: float = setting(
        0.5, "above this reported error of the velocity (median) there is a warning", unit="m/s", low=0, high=100
    )
    """Default of EKF2_REQ_SACC."""
    low_airborne_s: float = setting(10.0, "with less time in the air there is a warning", unit="s", low=0, high=3600)
    low_lead_s: float = setting(
        10.0, "with less time between the first sample and take-off there is a warning", unit="s", low=0, high=3600
    )
    """Time on the ground in which the filter aligns and the GNSS checks hold."""
