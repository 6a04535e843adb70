"""What the benchmark counts as found is what the decision finds."""

import numpy as np
import pytest
from tests.apply.test_ranking import analyzed

from fusetune.apply.ranking import proved_sets, rank
from fusetune.apply.settings import DecisionSettings

pytestmark = pytest.mark.usefixtures("benchmarks")


def test_found_is_what_the_decision_proves() -> None:
    from benchmarks.power_prediction import proved

    settings = DecisionSettings(draws=200, seed=3)
    generator = np.random.default_rng(5)
    counts = []
    for _ in range(12):
        means = np.array([0.0, -0.15, -0.05, 0.02, 0.1])
        scores = means + 0.06 * generator.standard_normal((6, 5))
        scores -= scores[:, :1]
        ranked = rank("abcde", "a", [analyzed(number, list(row)) for number, row in enumerate(scores)], {}, settings)
        names = {one.name for one in proved_sets(ranked, settings)}
        found = {"bcde"[index] for index in np.flatnonzero(proved(scores[:, 1:], settings))}
        # of those that are sure beside one that is no luck the decision takes all, the benchmark those that are none
        assert found <= names
        assert bool(found) == bool(names)
        counts.append(len(found))
    assert 0 < sum(counts) < 48


def test_the_table_has_a_row_for_each_band() -> None:
    from benchmarks.power_prediction import SIZES, Compared, table

    compared = [Compared("w", "s", 5.0, size, 0.25, 0.5) for size in SIZES]
    rows = table(compared).splitlines()[2:]
    assert rows[0] == "| 3 to 7 % (median 5.0) | 1 | 25, 50 | 25, 50 | 25, 50 | 25, 50 |"
    assert rows[1].startswith("| 7 to 14 % (median nan) | 0 | –, –")
