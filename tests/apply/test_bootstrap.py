"""The bootstrap against a slow form, theory where there is one, and scipy."""

import numpy as np
import pytest
from scipy import stats

from fusetune.apply.bootstrap import bootstrap_scores, expanded_interval, holm, p_value, probability_best
from fusetune.apply.evidence import FlightEvidence, score_of_sums


def evidence(seed: int, errors: tuple[float, ...], blocks: int = 6, samples: int = 50) -> FlightEvidence:
    generator = np.random.default_rng(seed)
    unit = generator.standard_normal((blocks, samples, 3))
    nis = np.stack([np.sum((error * unit) ** 2, axis=1) for error in errors])
    names = tuple(f"set{i}" for i in range(len(errors)))
    return FlightEvidence(f"flight{seed}", names, np.full((blocks, 3), float(samples)), nis, np.zeros_like(nis))


def test_score_is_the_profiled_likelihood_by_hand() -> None:
    # one axis, ν²/S = 4 in the mean, ln S = ln 0.25 in the mean: ½ ln 4 + ½ ln 0.25 = 0
    score = score_of_sums(np.array([10.0]), np.array([40.0]), np.array([10.0 * np.log(0.25)]))
    assert score == pytest.approx(0.0, abs=1e-15)


def test_one_flight_of_one_block_does_not_vary() -> None:
    one = evidence(1, (1.0, 1.3), blocks=1)
    scores = bootstrap_scores([one], ["set0", "set1"], draws=300, seed=0)
    np.testing.assert_allclose(scores, np.broadcast_to(one.scores, scores.shape))


def test_draws_are_those_of_a_plain_loop_in_distribution() -> None:
    flights = [evidence(seed, (1.0, 1.1)) for seed in range(4)]
    generator = np.random.default_rng(0)
    slow = []
    for _ in range(3000):
        scores = []
        for flight in generator.integers(0, 4, 4):
            one = flights[flight]
            pick = generator.integers(0, 6, 6)
            scores.append(
                score_of_sums(one.n[pick].sum(0), one.sum_nis[:, pick].sum(1), one.sum_log_variance[:, pick].sum(1))
            )
        slow.append(np.mean(scores, axis=0))
    fast = bootstrap_scores(flights, ["set0", "set1"], draws=3000, seed=1)
    np.testing.assert_allclose(fast.mean(0), np.mean(slow, axis=0), atol=4e-3)
    np.testing.assert_allclose(fast.std(0), np.std(slow, axis=0), rtol=0.06)


def test_pairing_takes_out_what_the_sets_have_in_common() -> None:
    flights = [evidence(seed, (1.0, 1.1)) for seed in range(5)]
    scores = bootstrap_scores(flights, ["set0", "set1"], draws=1000, seed=0)
    # The second set's errors are 1.1 times the first's on every sample: the difference is exactly 3 ln 1.1.
    np.testing.assert_allclose(scores[:, 1] - scores[:, 0], 3.0 * np.log(1.1), atol=1e-12)
    assert scores[:, 0].std() > 1e-3


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
