"""From where on a figure of the health table is a warning or a failure: every limit, its default and its source."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from fusetune.save.thresholds import VerdictThresholds
from fusetune.settings.declaration import setting

_NEVER = math.inf

REJECTED_RATIO = 1.0
"""Beyond this test ratio EKF2 rejects a sample: the gate is part of the ratio."""


class Levels(NamedTuple):
    """Beyond which a figure is a warning, and a failure; infinite where it never is."""

    warning: float
    fail: float = _NEVER


@dataclass(frozen=True)
class HealthSettings:
    """From where on a figure of the health table is a warning or a failure.

    Pairs are warning and failure. Argued in docs/health.md; "PX4" is its `ecl_ekf` scripts.
    """

    min_flight_s: float = setting(5.0, "shorter times in the air are not judged", unit="s", low=0, high=600)
    """PX4's."""
    worst_window_s: float = setting(30.0, "length of the worst stretch of a flight", unit="s", low=1, high=600)
    raised_ratio: float = setting(0.5, "test ratios above this are raised", above=0, high=1)
    """PX4's tuning guide: all test ratios of a healthy flight stay below it but for single spikes."""
    raised_share: tuple[float, float] = setting(
        (0.05, 0.5), "warning and failure: share of raised test ratios, those above 1 among them", low=0, high=1
    )
    """PX4's, who takes those above 1 away first."""
    fewest_samples: int = setting(10, "of fewer samples the shares are told and not judged", low=1)
    rejected_share: tuple[float, float] = setting(
        (0.0, 0.01), "warning and failure: share of samples, or of the time, that was rejected", low=0, high=1
    )
    """PX4 fails any; a single spike is what the gate is there for."""
    loose_rejected_share: tuple[float, float] = setting(
        (0.01, 0.1), "the same of height above ground, range finder and optical flow", low=0, high=1
    )
    """PX4's level is 1 %: ground is not always a good target."""
    unfused_s: float = setting(
        7.0, "warning: time without fusion of a source that is switched on", unit="s", low=0, high=600
    )
    """EKF2 resets to a source that was rejected for so long (`reset_timeout_max`)."""
    unaided_s: tuple[float, float] = setting(
        (1.0, 5.0), "warning and failure: time in flight without any horizontal aiding", unit="s", low=0, high=600
    )
    """EKF2 calls it dead reckoning after 1 s (`no_aid_timeout_max`), its position no longer valid after
    EKF2_NOAID_TOUT = 5 s."""
    unflagged_loss_s: tuple[float, float] = setting(
        (1.0, 5.0), "warning and failure: of that, time in which the filter does not say so", unit="s", low=0, high=600
    )
    resets: float = setting(0.0, "warning: resets in flight, of position, velocity or height", low=0, high=1000)
    heading_resets: float = setting(1.0, "warning: resets of the heading in flight", low=0, high=1000)
    """EKF2 aligns the heading anew once above the ground's fields."""
    coning: tuple[float, float] = setting(
        (3.6e-6, 1.8e-5), "warnings: mean and peak of the coning of delta angles up to v1.12", unit="rad²", low=0
    )
    """PX4's."""
    gyro_vibration: tuple[float, float] = setting(
        (0.6, 3.0), "warnings: mean and peak of the gyro's vibration metric", unit="rad/s", low=0
    )
    """The geometric middle of PX4's first ones, 6e-4 and 3e-3 rad in 4 ms, and its present ones, 2.4 and 12 rad/s."""
    accel_vibration: tuple[float, float] = setting(
        (18.0, 90.0), "warnings: mean and peak of the accelerometer's vibration metric", unit="m/s²", low=0
    )
    """Likewise of 0.018 and 0.09 m/s in 4 ms, and 72 and 360 m/s²."""
    clipped: tuple[float, float] = setting(
        (0.0, 100.0), "warning and failure: clipped accelerometer samples in flight, clear of the ground", low=0
    )
    """A hard landing clips; what clips in flight falsifies the velocity."""
    gyro_bias: float = setting(0.044, "warning: norm of the median gyro bias", unit="rad/s", low=0)
    """PX4's 4.4e-4 rad per update, at 10 ms."""
    gyro_bias_change: float = setting(0.05, "warning: change of the gyro bias in flight", unit="rad/s", low=0)
    """PX4's tuning guide: 5e-4 rad per update, about 3 °/s."""
    accel_bias: float = setting(0.48, "warning: norm of the median accelerometer bias", unit="m/s²", low=0)
    """PX4's 4.8e-3 m/s per update, at 10 ms."""
    bias_at_limit: float = setting(0.95, "a bias beyond this share of its limit is at it", above=0, high=1)
    bias_at_limit_share: float = setting(0.05, "warning: share of the time with a bias at its limit", low=0, high=1)
    output_errors: tuple[float, float, float] = setting(
        (8e-3, 0.05, 0.15),
        "warnings: median output-predictor error of angle (rad), velocity (m/s), position (m)",
        low=0,
    )
    """PX4's."""
    gnss_share: float = setting(
        0.05, "share of samples that may be beyond a limit of EKF2_REQ_* without a warning", low=0, high=0.5
    )
    unchecked_share: tuple[float, float] = setting(
        (0.05, 0.5), "warning and failure: share of the flight with a GNSS check that fails", low=0, high=1
    )
    min_imu_rate_hz: float = setting(100.0, "warning: below this rate of the IMU", unit="Hz", low=0)
    """PX4's tuning guide, as the next two."""
    min_mag_rate_hz: float = setting(5.0, "warning: below this rate of the magnetometer", unit="Hz", low=0)
    min_height_rate_hz: float = setting(5.0, "warning: where no source of height comes faster", unit="Hz", low=0)
    imu_gap_s: float = setting(
        VerdictThresholds.high_imu_gap_s, "warning: longest time without IMU samples in flight", unit="s", low=0
    )
    aid_gap_s: float = setting(
        1.0, "warning: longest time without samples of another sensor in flight, and", unit="s", low=0
    )
    """EKF2 stops using GNSS, vision and range that are older (`no_aid_timeout_max` and its kin)."""
    aid_gap_factor: float = setting(3.0, "so many times its usual interval, for the logger thins", low=1)
    time_slip_s: float = setting(
        0.1, "warning: IMU time that the filter lost against the clock in flight", unit="s", low=0
    )
    stuck_imu_s: float = setting(
        VerdictThresholds.high_stuck_imu_s, "warning: an axis of the IMU stands still for longer", unit="s", low=0
    )
    stuck_aid_s: tuple[float, float] = setting(
        (1.0, VerdictThresholds.high_stuck_aid_s),
        "warning and failure: another sensor stands still for longer in flight, and",
        unit="s",
        low=0,
    )
    stuck_chance: float = setting(
        1e-9, "chance would let it, by how often it repeats a value, with a probability below this", low=0, high=1
    )
    receivers_apart: float = setting(
        3.0, "warning: GNSS receivers whose reported accuracies differ by more than this factor", low=1
    )
    """Blending weighs them by accuracy, which pays where they are comparable."""
    switches: float = setting(0.0, "warning: changes of the primary estimator instance in flight", low=0)
    whipsaw_window_s: float = setting(10.0, "changes of instance within this time are counted", unit="s", low=1)
    whipsaw: tuple[float, float] = setting((2.0, 4.0), "warning and failure: changes of instance within it", low=0)
