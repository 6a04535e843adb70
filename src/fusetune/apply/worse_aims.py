"""Which kinds of prediction rule a set out: those in which it is worse beyond doubt, and that are trusted enough.

A kind of prediction supports a set with its weight in the score. It must not count against one with more: where the
flights themselves give it little weight, as the aided part where the receiver's error wanders, being worse in it does
not rule out a set that is better beyond doubt in all of them together.
"""

from collections.abc import Mapping, Sequence

from fusetune.apply.evidence import FlightEvidence
from fusetune.apply.statistics.mean_difference import MeanDifference

TRUSTED_SHARE = 0.5
"""A kind of prediction is trusted from so much of an equal share of the weight on."""


def mean_weights(flights: Sequence[FlightEvidence]) -> dict[str, float]:
    """Weight of each kind of prediction, the mean over the flights; where a flight lacks one it is 0 there."""
    weights: dict[str, float] = {}
    for flight in flights:
        for aim in flight.aims:
            weights[aim.name] = weights.get(aim.name, 0.0) + aim.weight / len(flights)
    return weights


def worse_aims(
    aims: Mapping[str, MeanDifference], weights: Mapping[str, float], total: MeanDifference
) -> tuple[str, ...]:
    """Kinds of prediction that rule a set out.

    Parameters
    ----------
    aims : mean difference to the present set in each kind; above 0 is worse
    weights : of the kinds, from `mean_weights`
    total : mean difference of the whole score

    Returns
    -------
    Those with a weight in which the set is worse beyond doubt; where it is better beyond doubt in total, only those
    with at least `TRUSTED_SHARE` of an equal share of the weight.
    """
    least = TRUSTED_SHARE / max(sum(weight > 0.0 for weight in weights.values()), 1)
    better = total.is_certain and total.difference < 0.0
    asked = least if better else 0.0
    return tuple(
        name for name, one in aims.items() if one.is_worse and weights.get(name, 0.0) > 0.0 and weights[name] >= asked
    )
