"""Lags of made series: those that they were made with, whatever drifts."""

import numpy as np
import pytest

from fusetune.analyze.delays.lag import Lag, LaggedSeries, lag_of

MOTION_TIME = np.arange(0, 60_000_000, 10_000)
STAMPS = np.arange(2_000_000, 58_000_000, 100_000)
LATE_S = 0.213


def speed(seconds: np.ndarray) -> np.ndarray:
    """Something of every period from 2 s to 7 s, m/s."""
    return np.asarray(4.0 * np.sin(0.9 * seconds) + 2.0 * np.cos(1.7 * seconds + 0.4) + np.sin(2.9 * seconds))


def series(noise: float = 0.0, drift: float = 0.0, moving: float = 1.0) -> LaggedSeries:
    """What a sensor that is `LATE_S` behind measures, and a motion that drifts away from it."""
    seconds, stamps = MOTION_TIME * 1e-6, STAMPS * 1e-6
    measured = moving * speed(stamps - LATE_S) + noise * np.random.default_rng(3).normal(size=STAMPS.size)
    motion = moving * speed(seconds) + drift * (0.3 * seconds + 0.02 * seconds**2)
    return LaggedSeries(STAMPS, measured[:, None], MOTION_TIME, motion[:, None])


def found(told_s: float, **changes: float) -> Lag:
    lag = lag_of(series(**changes), told_s)
    assert lag is not None
    return lag


@pytest.mark.parametrize("told_s", [0.0, 0.11, 0.21, 0.3])
def test_the_lag_is_found_exactly_from_whatever_was_told(told_s: float) -> None:
    """Without noise nothing is left to be wrong but the interpolation between samples of the motion."""
    assert found(told_s, noise=1e-4).delay_s == pytest.approx(LATE_S, abs=5e-4)


def test_the_drift_of_the_inertial_solution_is_not_taken_for_a_lag() -> None:
    lag = found(0.11, noise=0.05, drift=1.0)
    assert abs(lag.delay_s - LATE_S) < lag.half_width_s(0.95) < 0.03


def test_without_motion_there_is_no_lag_to_find() -> None:
    lag = lag_of(series(noise=0.1, moving=0.002), 0.11)
    assert lag is None or lag.half_width_s(0.95) > 0.2


def test_a_lag_beyond_what_is_looked_for_is_none() -> None:
    assert lag_of(series(noise=0.05), LATE_S + 0.4) is None


def test_too_few_samples_tell_nothing() -> None:
    assert lag_of(series().rows(np.arange(STAMPS.size) < 30), 0.11) is None
