"""Figures of made noise against what it was made of; `python -m benchmarks.sensor_noise` does it at length."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.sensor_noise import Case, figures_of, flicker_noise, made_noise, outcome

from fusetune.analyze.sensor_noise.allan import KINDS, allan_curve
from fusetune.analyze.sensor_noise.allan_fit import NoiseFigure, allan_figures, needed_s

DRAWS = range(60)


HOUR = Case("an hour", 3600.0, 5.0, 0.2, 0.1, 0.01)


@pytest.fixture(scope="module")
def hour() -> dict[str, list[NoiseFigure]]:
    return figures_of(HOUR, DRAWS)


@pytest.mark.parametrize("kind", KINDS)
def test_figures_of_a_long_record_are_the_truth_within_a_tenth(hour: dict[str, list[NoiseFigure]], kind: str) -> None:
    found = outcome(hour[kind], HOUR.truth[kind])
    # the walk rises above the flicker for the last octaves only: half of the draws tell it, and none is told wrong
    assert found.told > (0.3 if kind == "walk" else 0.95)
    assert found.median_error < 0.1
    # 95 % less three standard deviations of a share of 60 draws
    assert found.covered >= 0.86


def test_noise_density_needs_half_a_minute_only() -> None:
    case = Case("before arming", 30.0, 200.0, 1.0, 0.05, 0.001)
    found = figures_of(case, DRAWS)
    density = outcome(found["white"], 1.0)
    assert density.told == 1.0
    assert density.median_error < 0.02
    assert density.covered >= 0.86
    for kind in ("flicker", "walk"):
        assert outcome(found[kind], case.truth[kind]).told < 0.05
        assert outcome(found[kind], case.truth[kind]).bounded > 0.9


def test_a_refusal_says_how_long_the_log_stands_still_and_what_is_needed() -> None:
    figures = allan_figures(allan_curve([np.random.default_rng(1).standard_normal(6000)], 0.005))
    assert figures.bias_instability.value is None
    assert "stands still for only 30 s: the bias instability needs about" in figures.bias_instability.refusal
    assert "the rate random walk needs about" in figures.random_walk.refusal
    nothing = allan_figures(allan_curve([], 0.005))
    assert nothing.noise_density.value is None
    assert "only 0 s: the noise density needs" in nothing.noise_density.refusal


def test_needed_length_gives_the_degrees_of_freedom_of_three_standard_deviations() -> None:
    # flicker at large m: 5 r² / (4 (r + 3)) ≥ 18 with r = N / m → r = 17 (17.0 < 18 at r = 16)
    assert needed_s("flicker", 60.0) == pytest.approx(17 * 60.0)
    assert 5.0 * 17.0**2 / (4.0 * 20.0) >= 18.0 > 5.0 * 16.0**2 / (4.0 * 19.0)


def test_twelve_short_stretches_tell_more_than_one() -> None:
    case = Case("several", 30.0, 50.0, 1.0, several=12)
    rng = np.random.default_rng(2)
    stretches = [made_noise(rng, case) for _ in range(case.several)]
    one, all_of_them = (allan_figures(allan_curve(found, 0.02)).noise_density for found in (stretches[:1], stretches))
    assert one.high is not None
    assert all_of_them.high is not None
    # twelve times the samples make an interval √12 = 3.5 times as narrow, give or take how well the curve is fitted
    assert (one.high - one.low) / (all_of_them.high - all_of_them.low) > 1.8
    assert all_of_them.low <= 1.0 <= all_of_them.high


def test_made_flicker_noise_is_flat_at_two_thirds_of_its_instability() -> None:
    # √(2 ln 2 / π) = 0.664 (IEEE Std 952-1997, C.1.3)
    values = flicker_noise(np.random.default_rng(3), 40_000, 3, 0.1, 0.5)
    curve = allan_curve([values], 0.1)
    middle = curve.deviation[3:9]
    assert middle == pytest.approx(np.full(len(middle), 0.664 * 0.5), rel=0.1)


def test_a_low_pass_at_the_short_end_is_left_out() -> None:
    values = np.random.default_rng(4).standard_normal((20_003, 3))
    smooth = (values[3:] + values[2:-1] + values[1:-2] + values[:-3]) / 4.0
    figures = allan_figures(allan_curve([smooth], 0.01))
    assert figures.from_s > 0.01
    assert figures.noise_density.value == pytest.approx(0.1, rel=0.1)
