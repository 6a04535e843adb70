"""What all flights of a vehicle tell of each effect, together.

Flights are joined as random effects (`analyze/metrics/random_effects`), so what a vehicle's flights differ by counts. A
ballistic coefficient is pooled as its reciprocal, which is what a flight tells with an even error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import stdtrit

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.metrics.random_effects import random_effects

CONFIDENCE = 0.95
RECIPROCALS = ("EKF2_BCOEF_X", "EKF2_BCOEF_Y")
_LEAST_SHARE = 1e-6
"""Of a value, that its standard error is at least: one that is held by a limit of PX4 has none."""


def pooled(effects: Sequence[Effect]) -> Mapping[str, Estimate]:
    """Name of each estimate → the mean over the flights, with the interval of Student's t over them.

    Parameters
    ----------
    effects : of the flights of one vehicle, oldest first; what the newest was told counts as told

    Returns
    -------
    Of what a single flight tells, that flight's own; `Estimate.is_apart_from_told` says whether told and found differ
    beyond doubt
    """
    by_name: dict[str, list[Estimate]] = {}
    for effect in effects:
        for one in effect.estimates:
            by_name.setdefault(one.name, []).append(one)
    return {name: found[0] if len(found) == 1 else _joined(found) for name, found in by_name.items()}


def _joined(found: Sequence[Estimate]) -> Estimate:
    turned = found[0].name in RECIPROCALS
    values = np.array([1.0 / one.value if turned else one.value for one in found])
    errors = np.array([one.standard_error / one.value**2 if turned else one.standard_error for one in found])
    mean = random_effects(values.tolist(), np.maximum(errors, _LEAST_SHARE * np.maximum(np.abs(values), 1e-6)))
    half = float(stdtrit(mean.freedom, 0.5 + 0.5 * CONFIDENCE)) * mean.standard_error
    lower, upper, value, error = mean.mean - half, mean.mean + half, mean.mean, mean.standard_error
    if turned:
        value, error = 1.0 / mean.mean, mean.standard_error / mean.mean**2
        lower, upper = 1.0 / upper, (1.0 / lower if lower > 0.0 else np.inf)
    newest = found[-1]
    return Estimate(newest.name, newest.unit, newest.told, value, lower, upper, error, sum(one.n for one in found))
