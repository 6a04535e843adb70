"""The test by sign flips: by hand, under the null hypothesis, and against Holm's correction."""

import numpy as np
import pytest
from scipy import stats

from fusetune.apply.statistics.bootstrap import holm
from fusetune.apply.statistics.sign_flips import family_p_values


def test_one_candidate_by_hand() -> None:
    # All eight differences are below 0: only the unflipped signs reach so much, one of 256 flips, of which half counts.
    differences = -np.array([0.1, 0.2, 0.15, 0.3, 0.25, 0.12, 0.18, 0.22])[:, None]
    assert family_p_values(differences, 0) == pytest.approx([0.5 / 256])
    # With the smallest one above 0 one flip reaches further.
    differences[0] *= -1.0
    assert family_p_values(differences, 0) == pytest.approx([1.5 / 256])


def test_a_twin_costs_nothing_and_a_hopeless_set_neither() -> None:
    generator = np.random.default_rng(0)
    one = generator.normal(-0.05, 0.05, (8, 1))
    hopeless = generator.normal(1.0, 0.05, (8, 3))
    alone = family_p_values(one, 0)
    family = family_p_values(np.hstack([one, one, hopeless]), 0)
    np.testing.assert_allclose(family[:2], alone[0])
    assert (family[2:] == 1.0).all()


def test_the_best_of_equal_candidates_is_rarely_called_better() -> None:
    generator = np.random.default_rng(1)
    called = 0
    for _ in range(600):
        common = generator.normal(0.0, 0.1, (8, 1))
        called += family_p_values(common + generator.normal(0.0, 0.1, (8, 7)), 0).min() <= 0.05
    # 5 % within three standard deviations of 600 draws
    assert called / 600 <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 600)


def test_it_finds_a_better_set_among_similar_ones_more_often_than_holm() -> None:
    generator = np.random.default_rng(2)
    found = {"sign flips": 0, "holm": 0}
    for _ in range(200):
        common = generator.normal(-0.08, 0.06, (8, 1))
        differences = common + generator.normal(0.0, 0.02, (8, 20))
        found["sign flips"] += family_p_values(differences, 0).min() <= 0.05
        p_values = stats.ttest_1samp(differences, 0.0, alternative="less").pvalue
        found["holm"] += min(holm(list(p_values))) <= 0.05
    assert found["sign flips"] > found["holm"] + 20


def test_many_flights_are_flipped_at_random_but_alike_for_the_same_seed() -> None:
    differences = np.random.default_rng(3).normal(-0.02, 0.1, (20, 3))
    np.testing.assert_array_equal(family_p_values(differences, 5), family_p_values(differences, 5))
    one_sided = stats.ttest_1samp(differences[:, 0], 0.0, alternative="less").pvalue
    assert family_p_values(differences[:, :1], 5)[0] == pytest.approx(one_sided, abs=0.03)


def test_of_one_flight_nothing_is_known() -> None:
    assert np.isnan(family_p_values(np.array([[-1.0, -2.0]]), 0)).all()


def test_equal_within_rounding_is_no_luck_and_no_merit() -> None:
    generator = np.random.default_rng(4)
    one = generator.normal(-0.05, 0.05, (8, 1))
    rounding = np.full((8, 1), -3e-17)
    found = family_p_values(np.hstack([one, rounding]), 0)
    assert found[1] == 1.0
    assert found[0] == family_p_values(one, 0)[0]


def test_a_large_gain_that_varies_is_found_beside_a_small_even_one() -> None:
    """Measured by Student's t alone the small one, 3 % that hardly varies, hides it: t is −60 against −2.6."""
    large = np.array([-0.8, -0.6, -0.1, -0.5, -0.05])
    small = np.array([-0.03, -0.031, -0.029, -0.03, -0.032])
    generator = np.random.default_rng(5)
    others = generator.normal(0.0, 0.03, (5, 6))
    found = family_p_values(np.column_stack([large, small, others]), 0)
    assert found[0] <= 0.05


def test_five_flights_that_agree_are_enough_and_three_are_not() -> None:
    for flights, enough in ((3, False), (4, True), (5, True)):
        one = -np.linspace(0.1, 0.2, flights)[:, None]
        # of 2^n flips the unflipped one alone reaches so far, and half of it counts
        assert family_p_values(one, 0) == pytest.approx([0.5 / 2**flights])
        assert (family_p_values(one, 0)[0] <= 0.05) == enough
