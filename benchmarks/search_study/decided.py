"""What the decision makes of a search, from the sets that were found without each flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.apply.choice import choose
from fusetune.apply.evidence import AimEvidence, AnalyzedFlight, FlightEvidence
from fusetune.apply.ranking import RankedSet, rank
from fusetune.apply.settings import DecisionSettings
from fusetune.set_names import PRESENT

Array = npt.NDArray[np.float64]

FOUND = "found"


@dataclass(frozen=True)
class Decided:
    """Whether a change is recommended, and the found set as the decision sees it."""

    changes: bool
    found: RankedSet


def decided(
    aims: Mapping[str, Array], weights: Mapping[str, Array], settings: DecisionSettings, objections: Sequence[str] = ()
) -> Decided:
    """Decide between the present set and one found.

    Parameters
    ----------
    aims : (F,) differences of the found set to the present one in each kind of prediction, on each flight those of the
        set that was found without it
    weights : (F,) of each kind in the score of the flight
    """
    number = len(next(iter(aims.values())))
    flights = [
        _flight(str(place), {name: (float(weights[name][place]), float(aims[name][place])) for name in aims})
        for place in range(number)
    ]
    ranked = rank([PRESENT, FOUND], PRESENT, flights, {FOUND: objections} if objections else {}, settings)
    evidence = [one.evidence for one in flights if one.evidence is not None]
    choice = choose(ranked, PRESENT, evidence, {FOUND: 1.0}, settings)
    return Decided(choice.chosen == FOUND, next(one for one in ranked if one.name == FOUND))


def _flight(name: str, aims: Mapping[str, tuple[float, float]]) -> AnalyzedFlight:
    """One whose scores are the differences: half the logarithm of the mean square of an error as large as their exp."""
    parts = tuple(
        AimEvidence(
            aim,
            weight,
            (aim,),
            np.ones(1),
            np.ones((1, 1)),
            np.exp(2.0 * np.array([0.0, difference])).reshape(2, 1, 1),
            np.zeros((2, 1, 1)),
        )
        for aim, (weight, difference) in aims.items()
    )
    same = {"same_results_as_present": all(one == 0.0 for _, one in aims.values())}
    summary = {"sets": {PRESENT: {"same_results_as_present": True}, FOUND: same}}
    return AnalyzedFlight(name, Path(name), summary, None, FlightEvidence(name, (PRESENT, FOUND), parts))
