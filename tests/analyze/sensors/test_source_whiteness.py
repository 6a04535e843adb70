"""White and correlated errors told apart: on made series of known variogram, and on simulated flights."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.replaying.prepared_flight import prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set
from fusetune.analyze.replaying.settings import ReplaySettings
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import scoring_window
from fusetune.analyze.sensors.measurement_errors import ErrorSeries
from fusetune.analyze.sensors.source_whiteness import (
    Whiteness,
    fit_variogram,
    series_whiteness,
    source_whiteness,
    variogram,
    variogram_lags,
)
from fusetune.design.missions.mission import load_mission
from fusetune.execute.simulation import fly
from fusetune.execute.vehicle import GnssError, load_vehicle

STEP_US = 200_000


def made(white: float, correlated: float, tau_s: float, seed: int, samples: int = 3000) -> np.ndarray:
    """White noise plus a first-order Gauss–Markov process, (samples, 1)."""
    rng = np.random.default_rng(seed)
    rho = np.exp(-STEP_US * 1e-6 / tau_s)
    drive = correlated * np.sqrt(1.0 - rho**2) * rng.standard_normal(samples)
    process = np.zeros(samples)
    process[0] = correlated * rng.standard_normal()
    for k in range(1, samples):
        process[k] = rho * process[k - 1] + drive[k]
    return (process + white * rng.standard_normal(samples))[:, None]


def whiteness_of(values: np.ndarray, source: str = "gnss_vel") -> Whiteness:
    time = np.arange(values.shape[0], dtype=np.int64) * STEP_US
    found = series_whiteness(source, ErrorSeries(time, values), [(0, int(time[-1]) + 1)])[0]
    assert found is not None
    return found


def test_the_model_is_recovered_from_its_own_variogram() -> None:
    lag = np.array([0.2, 0.4, 0.6, 1.0, 1.6, 2.4, 3.0])
    gamma = 0.01 + 0.04 * (1.0 - np.exp(-lag / 2.0)) + 0.001 * lag**2
    white, correlated, tau = fit_variogram(lag, gamma, 0.2)
    assert (white, correlated, tau) == (pytest.approx(0.01, rel=1e-4), pytest.approx(0.04, rel=1e-3), 2.0)


def test_white_errors_are_white_and_their_size_is_found() -> None:
    found = whiteness_of(made(0.1, 0.0, 1.0, seed=1))
    assert found.white_share > 0.95
    assert found.white_noise == pytest.approx(0.1, rel=0.05)


def test_correlated_errors_are_not_white() -> None:
    assert whiteness_of(made(0.0, 0.1, 2.0, seed=2)).white_share < 0.02


def test_the_share_is_that_of_the_variances_within_the_horizon() -> None:
    # 0.01 white, 0.01 · (1 − exp(−3 s / 2 s)) correlated within 3 s: share 0.563
    found = whiteness_of(made(0.1, 0.1, 2.0, seed=3, samples=20_000))
    assert found.white_share == pytest.approx(1.0 / (1.0 + 1.0 - np.exp(-1.5)), abs=0.08)


def test_a_drift_of_the_inertial_solution_is_no_fault_of_the_measurement() -> None:
    values = made(0.1, 0.0, 1.0, seed=4)
    drifting = values + 0.03 * np.arange(values.size)[:, None] * STEP_US * 1e-6
    assert whiteness_of(drifting).white_share > 0.9


def test_a_few_wild_samples_do_not_count_as_noise() -> None:
    values = made(0.1, 0.0, 1.0, seed=5)
    values[::100] += 5.0
    # Two pairs in a hundred are off by 5: their mean square would make the noise sqrt(0.01 + 0.02 · 25 / 2) = 0.51.
    assert whiteness_of(values).white_noise == pytest.approx(0.1, rel=0.3)


def test_the_robust_variogram_of_white_noise_is_its_variance_at_every_lag() -> None:
    time = np.arange(20_000, dtype=np.int64) * STEP_US
    values = np.random.default_rng(6).normal(0.0, 2.0, (time.size, 1))
    gamma = variogram(time, values, np.zeros(time.size, dtype=np.int64), np.array([1, 5, 20]))
    np.testing.assert_allclose(gamma[:, 0], 4.0, rtol=0.04)


def test_no_pair_spans_a_cut_or_a_gap() -> None:
    time = np.r_[np.arange(50), np.arange(50) + 500].astype(np.int64) * STEP_US
    values = np.r_[np.zeros(50), np.full(50, 100.0)][:, None]
    within = variogram(time, values, np.zeros(100, dtype=np.int64), np.array([1, 3]))
    apart = variogram(
        time[:50].repeat(1), values[:50], np.r_[np.zeros(25), np.ones(25)].astype(np.int64), np.array([30])
    )
    assert np.all(within == 0.0)
    assert np.isnan(apart).all()


def test_lags_reach_the_horizon_but_no_more_than_a_third_of_the_samples() -> None:
    assert variogram_lags(1000, 0.2, 3.0)[-1] == 15
    assert variogram_lags(30, 0.2, 3.0)[-1] == 10
    assert variogram_lags(30, 0.2, 3.0)[0] == 1


def test_few_samples_tell_nothing() -> None:
    time = np.arange(20, dtype=np.int64) * STEP_US
    assert series_whiteness("gnss_vel", ErrorSeries(time, np.ones((20, 2))), [(0, 10_000_000)]) == [None, None]


@pytest.mark.parametrize("kind", ["white", "correlated"])
def test_simulated_receivers_are_told_apart(kind: str) -> None:
    root = Path(__file__).parents[3] / "config"
    vehicle = load_vehicle(root / "vehicles" / "quadrotor.yaml")
    velocities = {"white": GnssError(0.1, 0.0, 1.0, 1.4), "correlated": GnssError(0.02, 0.12, 2.0, 1.4)}
    positions = {"white": GnssError(0.3, 0.0, 60.0, 1.5), "correlated": GnssError(0.02, 0.6, 20.0, 1.5)}
    gnss = replace(vehicle.gnss, velocity=velocities[kind], position=positions[kind])
    flight = fly(
        load_mission(root / "missions" / "survey.yaml"), replace(vehicle, gnss=gnss), {}, 3, with_estimator=False
    )
    record = replay_set(prepare_flight(flight, ReplaySettings()), "present", {})
    airborne = airborne_intervals(flight, record.flags)
    window = scoring_window(record, airborne, (), ScoringSettings())
    found = source_whiteness(record, record.states(), flight, window.intervals)
    shares = {
        source: np.mean([found[source, axis].white_share for axis in (0, 1)]) for source in ("gnss_vel", "gnss_pos")
    }
    if kind == "white":
        assert shares["gnss_vel"] > 0.75
        assert shares["gnss_pos"] > 0.6
        assert found["gnss_vel", 0].white_noise == pytest.approx(0.1, rel=0.15)
        assert found["gnss_pos", 0].white_noise == pytest.approx(0.3, rel=0.2)
    else:
        assert shares["gnss_vel"] < 0.15
        assert shares["gnss_pos"] < 0.1
    # The barometer's white noise is 0.18 m, the magnetometer's 0.006 G, in both.
    assert found["baro_hgt", 0].white_noise == pytest.approx(0.18, rel=0.1)
    assert found["mag", 0].white_noise == pytest.approx(0.006, rel=0.1)


@pytest.mark.parametrize(
    ("source", "white", "correlated", "tau_s", "interval_s", "expected"),
    [
        ("gnss_vel", 0.1, 0.0, 1.0, 0.2, 0.1),
        # 2 · 1 s / 0.2 s = 10 samples that are alike
        ("gnss_vel", 0.1, 0.05, 1.0, 0.2, np.sqrt(0.01 + 0.0025 * 10.0)),
        # no longer than the horizon of velocities, 3 s
        ("gnss_vel", 0.1, 0.05, 8.0, 0.2, np.sqrt(0.01 + 0.0025 * 30.0)),
        # what forgets within a sample is white
        ("ev_vel", 0.1, 0.05, 0.1, 0.5, np.sqrt(0.01 + 0.0025)),
        # a log thinned to 1 Hz: the vehicle takes GNSS five times as often
        ("gnss_vel", 0.1, 0.05, 1.0, 1.0, np.sqrt(0.01 + 0.0025 * 10.0)),
    ],
)
def test_the_equivalent_noise_counts_samples_that_are_alike(
    source: str, white: float, correlated: float, tau_s: float, interval_s: float, expected: float
) -> None:
    found = Whiteness(source, 0, white, correlated, tau_s, 300, interval_s)
    assert found.equivalent_noise == pytest.approx(expected)


def test_the_mean_of_a_wandering_error_scatters_as_its_equivalent_noise_says() -> None:
    # a Gauss-Markov process of 0.05 over 1 s: its mean over 100 s scatters as that of 500 white samples of 0.158
    found = Whiteness("gnss_vel", 0, 0.0, 0.05, 1.0, 500, 0.2)
    means = [made(0.0, 0.05, 1.0, seed, 500).mean() for seed in range(200)]
    assert np.std(means) == pytest.approx(found.equivalent_noise / np.sqrt(500), rel=0.1)
