"""By how much a set's differences vary from flight to flight, and how much of that longer flights would take away.

The standard deviation of a difference grows with its size, more slowly than in proportion: in the sixteen worlds of
docs/decision.md as its 0.86th power (median of the worlds; 0.39 to 1.27), size being the root mean square over the
flights. What a set of another size would show is therefore taken from all sets tried, the ones of like size counting
most, each carried over by `GROWTH`. What varies within flights is known from their blocks of about 10 s, by leaving out
one at a time (delete-one jackknife: Efron and Stein, Annals of Statistics 9(3), 1981); that part shrinks with time in
the air.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.likelihood import profile_nll
from fusetune.apply.evidence import AimEvidence, FlightEvidence
from fusetune.apply.statistics.moderated import first_twins, moderated
from fusetune.apply.statistics.rounding import EQUAL_WITHIN, without_rounding

Array = npt.NDArray[np.float64]

GROWTH = 0.85
"""Power of its size with which the standard deviation of a difference grows."""

LIKE_SIZE = 2.0
"""A set whose size is so many times another counts exp(−½) as much as one of the same size."""

MOST_RIVALS = 16
"""Other sets, the best ones, that a planted one is tried beside; clearly worse ones are no rivals in the rule."""

_FIXED_POINT_STEPS = 50


@dataclass(frozen=True)
class Spread:
    """How the differences of C sets to the present one vary over F flights, nat.

    Attributes
    ----------
    differences : (F, C), without twins and sets that are equal to the present one
    sizes, deviations : (C,) root mean square over the flights, and standard deviation between them, steadied by those
        of the other sets as in the rule (`moderated`)
    within_share : share of the variance that blocks within the flights account for; None where flights have one block
    """

    differences: Array
    sizes: Array
    deviations: Array
    within_share: float | None

    def of_gain(self, difference: float, draws: int) -> Array:
        """(D,) standard deviations that a set of this true mean difference may have, ascending.

        The quantiles of the sets tried, each carried over to the size and counted by how little it had to be.
        """
        base = np.log(self.deviations) - GROWTH * np.log(self.sizes)
        # size² = difference² + deviation², so the deviation stands on both sides; GROWTH < 1 makes this contract
        size = np.full(base.shape, abs(difference))
        for _ in range(_FIXED_POINT_STEPS):
            size = np.hypot(difference, np.exp(base + GROWTH * np.log(size)))
        deviation = np.exp(base + GROWTH * np.log(size))
        nearness = -0.5 * np.square(np.log(self.sizes / size) / np.log(LIKE_SIZE))
        weight = np.exp(nearness - nearness.max())
        order = np.argsort(deviation, kind="stable")
        reached = np.cumsum(weight[order]) / weight.sum()
        wanted = (np.arange(draws) + 0.5) / draws
        return np.asarray(deviation[order][np.minimum(np.searchsorted(reached, wanted), order.size - 1)])

    def factor(self, times_longer: float) -> float:
        """Of the standard deviations, on flights so many times longer; 1 where what blocks account for is not known."""
        share = self.within_share or 0.0
        return math.sqrt(1.0 - share + share / times_longer)


def spread_of(evidence: Sequence[FlightEvidence], names: Sequence[str]) -> Spread | None:
    """The spread of sets that were scored on all flights; None where nothing shows it.

    Parameters
    ----------
    evidence : of the flights that decide; at least two show a spread
    names : the present set first
    """
    if len(evidence) < 2 or len(names) < 2:
        return None
    all_differences = without_rounding([one.differences(names) for one in evidence])[:, 1:]
    twin_of = first_twins(all_differences)
    varies = all_differences.std(axis=0) > EQUAL_WITHIN
    own = [index for index, first in enumerate(twin_of) if first == index and varies[index]]
    if not own:
        return None
    differences = all_differences[:, own]
    errors = np.array([one.error or 0.0 for one in moderated(differences)])
    within = [within_variances(one, [names[0], *(names[1 + index] for index in own)]) for one in evidence]
    known = np.array([one[1:] for one in within if one is not None])
    share = None
    if len(known):
        # of each set, then the median of the sets: a quotient of few flights has no mean to speak of
        variance = np.maximum(differences.var(axis=0, ddof=1), EQUAL_WITHIN**2)
        share = float(np.median(np.minimum(known.mean(axis=0) / variance, 1.0)))
    return Spread(
        differences,
        np.sqrt(np.square(differences).mean(axis=0)),
        errors * np.sqrt(len(evidence)),
        share,
    )


def within_variances(one: FlightEvidence, names: Sequence[str]) -> Array | None:
    """(N,) variance of each set's difference to the first on a flight, by what varies between its blocks.

    The aims are taken for unrelated. None with fewer than two blocks in any of them.
    """
    rows = one.rows_of(names)
    total = np.zeros(len(rows))
    for aim in one.aims:
        if aim.weight <= 0.0:
            continue
        if aim.n.shape[0] < 2:
            return None
        total += aim.weight**2 * _jackknife(aim, rows)
    return total


def _jackknife(aim: AimEvidence, rows: npt.NDArray[np.int64]) -> Array:
    n = aim.n.sum(axis=0) - aim.n
    nis, log_variance = (sums[rows].sum(axis=1, keepdims=True) - sums[rows] for sums in _sums(aim))
    with np.errstate(divide="ignore", invalid="ignore"):
        columns = profile_nll(nis / n, log_variance / n)
    # a column that lies in one block alone varies by nothing that could be left out
    scores = np.where(np.isfinite(columns), columns, 0.0) @ aim.column_weights
    differences = scores - scores[:1]
    blocks = aim.n.shape[0]
    return np.asarray((blocks - 1) * differences.var(axis=1))


def _sums(aim: AimEvidence) -> tuple[Array, Array]:
    return aim.sum_nis, aim.sum_log_variance
