"""An estimator in flight, as a starting point for tests of single aid sources."""

from __future__ import annotations

import numpy as np

from fusetune.ekf2.filter.common.parameters import complete, parameter_record
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.filter.estimator import ekf_record, initialise_estimator
from fusetune.ekf2.numerics.rotations import quat_to_dcm
from fusetune.ekf2.releases import behaviours
from fusetune.px4.releases import BASELINE

START_US = 100_000_000
INTERVAL_US = 10_000
CONSTANTS_ONE_G = 9.80665


def parameters(**overrides: float) -> np.ndarray:
    """Defaults of the baseline release with some replaced; a one-element record array."""
    return parameter_record(complete({}, overrides, BASELINE))


def new_estimator(params: np.ndarray | None = None, release: str = behaviours.BASELINE) -> np.ndarray:
    """A one-element array of the record `ekf` of a release, as at switch-on."""
    memory = np.zeros(1, ekf_record(release))
    initialise_estimator(memory[0], (parameters() if params is None else params)[0])
    return memory


def hovering(params: np.ndarray, release: str = behaviours.BASELINE) -> np.ndarray:
    """Level, still, aligned, 10 m above flat ground, with the covariance of a settled filter."""
    memory = new_estimator(params, release)
    ekf = memory[0]
    ekf["cs"]["tilt_align"] = True
    ekf["cs"]["in_air"] = True
    ekf["cs_prev"] = ekf["cs"]
    ekf["P"] = np.diag(np.full(ERROR_STATE_SIZE, 0.01))
    ekf["gpos_alt"] = 10.0
    ekf["terrain"] = 0.0
    ekf["terrain_valid"] = True
    ekf["accel_magnitude_filt"] = CONSTANTS_ONE_G
    quat_to_dcm(ekf["q"], ekf["R_to_earth"])
    ekf["imu_delayed"]["delta_vel"] = [0.0, 0.0, -CONSTANTS_ONE_G * 0.01]
    ekf["imu_delayed"]["delta_vel_dt"] = 0.01
    ekf["imu_delayed"]["delta_ang_dt"] = 0.01
    set_time(ekf, START_US)
    for timer in ("time_last_hgt_fuse", "time_good_vert_accel", "time_last_hor_vel_fuse", "time_last_hor_pos_fuse"):
        ekf[timer] = START_US
    return memory


def set_time(ekf: np.void, time_us: int) -> None:
    """Move the fusion time horizon, and everything that a sample's age is compared with."""
    ekf["time_delayed_us"] = time_us
    ekf["time_latest_us"] = time_us
    ekf["imu_delayed"]["time_us"] = time_us
    ekf["time_good_vert_accel"] = time_us
