"""The bootstrap against a slow form, theory where there is one, and scipy."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from fusetune.apply.evidence import AIDED, UNAIDED, AimEvidence, FlightEvidence
from fusetune.apply.statistics.bootstrap import (
    bootstrap_scores,
    expanded_interval,
    holm,
    p_value,
    probability_best,
    spread_of_flights,
)


def aim(
    name: str, generator: np.random.Generator, errors: tuple[float, ...], blocks: int, samples: int, weight: float
) -> AimEvidence:
    unit = generator.standard_normal((blocks, samples, 3))
    nis = np.stack([np.sum((error * unit) ** 2, axis=1) for error in errors])
    count = np.full((blocks, 3), float(samples))
    return AimEvidence(name, weight, ("x", "y", "z"), np.full(3, 1 / 3), count, nis, np.zeros_like(nis))


def evidence(
    seed: int, errors: tuple[float, ...], blocks: int = 6, samples: int = 50, *, unaided: bool = False
) -> FlightEvidence:
    """A flight on which every set's errors are the same random numbers, each set's times its own factor."""
    generator = np.random.default_rng(seed)
    aims = [aim(AIDED, generator, errors, blocks, samples, 0.5 if unaided else 1.0)]
    if unaided:
        aims.append(aim(UNAIDED, generator, errors, blocks, 3, 0.5))
    return FlightEvidence(f"flight{seed}", tuple(f"set{i}" for i in range(len(errors))), tuple(aims))


def test_score_is_the_profiled_likelihood_by_hand() -> None:
    # ν²/S = 4 and ln S = ln 0.25 in the mean: ½ ln 4 + ½ ln 0.25 = 0; the second axis has ν²/S = e² and ln S = 0: 1
    one = AimEvidence(
        AIDED, 1.0, ("x", "y"), np.array([0.75, 0.25]), np.array([[10.0, 4.0]]),
        np.array([[[40.0, 4.0 * np.e**2]]]), np.array([[[10.0 * np.log(0.25), 0.0]]]),
    )  # fmt: skip
    np.testing.assert_allclose(one.column_scores, [[0.0, 1.0]], atol=1e-15)
    np.testing.assert_allclose(one.scores, [0.25])
    assert FlightEvidence("a", ("set0",), (one,)).scores == pytest.approx([0.25])


def test_one_flight_of_one_block_does_not_vary() -> None:
    one = evidence(1, (1.0, 1.3), blocks=1)
    scores = bootstrap_scores([one], ["set0", "set1"], draws=300, seed=0)
    np.testing.assert_allclose(scores, np.broadcast_to(one.scores, scores.shape))


def test_draws_are_those_of_a_plain_loop_in_distribution() -> None:
    flights = [evidence(seed, (1.0, 1.1), unaided=True) for seed in range(4)]
    generator = np.random.default_rng(0)
    slow = []
    for _ in range(3000):
        scores = []
        for flight in generator.integers(0, 4, 4):
            total = np.zeros(2)
            for part in flights[flight].aims:
                pick = generator.integers(0, 6, 6)
                drawn = dataclasses.replace(part, n=part.n[pick], sum_nis=part.sum_nis[:, pick])
                total += (
                    part.weight * dataclasses.replace(drawn, sum_log_variance=part.sum_log_variance[:, pick]).scores
                )
            scores.append(total)
        slow.append(np.mean(scores, axis=0))
    fast = bootstrap_scores(flights, ["set0", "set1"], draws=3000, seed=1)
    np.testing.assert_allclose(fast.mean(0), np.mean(slow, axis=0), atol=6e-3)
    np.testing.assert_allclose(fast.std(0), np.std(slow, axis=0), rtol=0.06)


def test_pairing_takes_out_what_the_sets_have_in_common() -> None:
    flights = [evidence(seed, (1.0, 1.1), unaided=True) for seed in range(5)]
    # The second set's errors are 1.1 times the first's on every sample: the difference is exactly ln 1.1.
    for of in (None, AIDED, UNAIDED):
        scores = bootstrap_scores(flights, ["set0", "set1"], draws=1000, seed=0, aim=of)
        np.testing.assert_allclose(scores[:, 1] - scores[:, 0], np.log(1.1), atol=1e-12)
        assert scores[:, 0].std() > 1e-3


def test_an_aim_is_the_mean_over_the_flights_that_have_it() -> None:
    flights = [evidence(1, (1.0, 1.2), blocks=1, unaided=True), evidence(2, (1.0, 1.2), blocks=1)]
    redrawn = bootstrap_scores(flights, ["set0", "set1"], draws=500, seed=0, aim=UNAIDED)
    only = flights[0].aim(UNAIDED)
    assert only is not None
    drawn = np.isfinite(redrawn[:, 0])
    # Of two flights the first is missing in a quarter of the draws.
    assert 1.0 - drawn.mean() == pytest.approx(0.25, abs=0.06)
    np.testing.assert_allclose(redrawn[drawn], np.broadcast_to(only.scores, (drawn.sum(), 2)))


def test_a_column_without_samples_in_the_drawn_blocks_keeps_its_whole_score() -> None:
    one = evidence(3, (1.0, 1.3), blocks=4)
    (part,) = one.aims
    n, nis = part.n.copy(), part.sum_nis.copy()
    n[1:, 2], nis[:, 1:, 2] = 0.0, 0.0
    one = dataclasses.replace(one, aims=(dataclasses.replace(part, n=n, sum_nis=nis),))
    assert np.isfinite(bootstrap_scores([one], ["set0", "set1"], draws=400, seed=0)).all()


def test_it_does_not_matter_how_many_slots_are_scored_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    flights = [evidence(seed, (1.0, 1.1, 0.9), unaided=True) for seed in range(3)]
    whole = bootstrap_scores(flights, ["set0", "set1", "set2"], draws=50, seed=7)
    monkeypatch.setattr("fusetune.apply.statistics.bootstrap._FIGURES_AT_ONCE", 1)
    assert np.array_equal(whole, bootstrap_scores(flights, ["set0", "set1", "set2"], draws=50, seed=7))


def test_same_seed_same_bytes_and_the_order_of_sets_does_not_matter() -> None:
    flights = [evidence(seed, (1.0, 1.1, 0.9)) for seed in range(5)]
    first = bootstrap_scores(flights, ["set0", "set1", "set2"], draws=500, seed=7)
    again = bootstrap_scores(flights, ["set2", "set0", "set1"], draws=500, seed=7)
    np.testing.assert_array_equal(first, again[:, [1, 2, 0]])
    assert not np.array_equal(first, bootstrap_scores(flights, ["set0", "set1", "set2"], draws=500, seed=8))


def test_expanded_interval_covers_the_truth_with_few_flights() -> None:
    generator = np.random.default_rng(3)
    covered = {"expanded": 0, "plain": 0}
    for _ in range(400):
        flights = generator.standard_normal(6) + 1.0
        draws = flights[generator.integers(0, 6, (1000, 6))].mean(axis=1)
        wide = expanded_interval(draws, 6, 0.95)
        low, high = np.quantile(draws, [0.025, 0.975])
        covered["expanded"] += wide.lower <= 1.0 <= wide.upper
        covered["plain"] += low <= 1.0 <= high
    assert 0.90 <= covered["expanded"] / 400 <= 0.99
    assert covered["plain"] / 400 < 0.92


def test_blocks_do_not_count_the_noise_within_flights_twice() -> None:
    # Flights differ by nothing but the noise of their blocks: redrawing both has twice the variance of the mean.
    generator = np.random.default_rng(6)
    blocks = generator.standard_normal((8, 12))
    flights = blocks.mean(axis=1)
    picks = generator.integers(0, 8, (20_000, 8))
    inner = generator.integers(0, 12, (20_000, 8, 12))
    draws = blocks[picks[..., None], inner].mean(axis=(1, 2))
    alone = flights[picks].mean(axis=1)
    assert draws.std() > 1.2 * alone.std()
    drawn_together = spread_of_flights(draws, flights)
    assert drawn_together.std() == pytest.approx(alone.std(), rel=0.02)
    assert drawn_together.mean() == pytest.approx(draws.mean())
    np.testing.assert_array_equal(spread_of_flights(draws, flights[:2]), draws)


def test_p_value_is_students_with_the_corrected_error() -> None:
    differences = np.random.default_rng(4).normal(0.3, 0.1, 20_000)
    statistic = 0.3 / (np.std(differences) * np.sqrt(6 / 5))
    assert p_value(0.3, differences, 6) == pytest.approx(2.0 * stats.t.sf(statistic, 5))


def test_p_value_without_any_difference() -> None:
    assert p_value(0.0, np.zeros(100), 6) == 1.0


def test_holm_by_hand() -> None:
    # sorted 0.01, 0.02, 0.03, 0.5 times 4, 3, 2, 1, made monotone
    assert holm([0.03, 0.01, 0.5, 0.02]) == pytest.approx([0.06, 0.04, 0.5, 0.06])
    assert holm([0.6, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


def test_probability_best_shares_ties() -> None:
    scores = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 2.0]])
    np.testing.assert_allclose(probability_best(scores), [0.75, 0.25, 0.0])
