"""Does the choice hold on a flight that it never saw?

Each flight is left out in turn, the best set is chosen from the others, and the choice is judged on the flight that
was left out. This shows how much the choice hangs on single flights and what it is worth on another one. As a proof it
is too weak: where every choice is the same set, its mean is that set's own, lucky or not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from fusetune.apply.evidence import FlightEvidence
from fusetune.apply.statistics.rounding import EQUAL_WITHIN, without_rounding

FEWEST_FLIGHTS = 3


@dataclass(frozen=True)
class LeaveOneOut:
    """Choices from all flights but one, and what they were worth on that one.

    Attributes
    ----------
    chosen : flight that was left out → set chosen from the others, the present one if none beat it
    differences : flight that was left out → score there of the set chosen, less that of the present set
    difference, lower, upper : their mean and its interval by Student's t, None where they do not differ; below 0 the
        choice holds
    stays : number of flights without which the same set as from all flights is chosen
    """

    chosen: dict[str, str]
    differences: dict[str, float]
    difference: float
    lower: float | None
    upper: float | None
    stays: int


def leave_one_out(
    flights: Sequence[FlightEvidence], eligible: Sequence[str], present: str, confidence: float
) -> LeaveOneOut | None:
    """Cross-validate the choice of the set with the lowest mean score; None with fewer than three flights.

    Parameters
    ----------
    eligible : sets to choose from, all scored on every flight
    present : the set to compare with, chosen where no other has a lower score
    """
    if len(flights) < FEWEST_FLIGHTS:
        return None
    names = [present, *(name for name in eligible if name != present)]
    scores = np.array([flight.scores[flight.rows_of(names)] for flight in flights])
    scores = without_rounding(scores - scores[:, :1])
    total = scores.sum(axis=0)
    best = names[int(np.argmin(total))]
    picks = [int(np.argmin(total - row)) for row in scores]
    differences = np.array([row[pick] for row, pick in zip(scores, picks, strict=True)])
    mean = float(differences.mean())
    spread = float(differences.std(ddof=1))
    reach = float(stdtrit(len(flights) - 1, 0.5 + 0.5 * confidence)) * spread / np.sqrt(len(flights))
    known = spread > EQUAL_WITHIN
    return LeaveOneOut(
        chosen={flight.flight: names[pick] for flight, pick in zip(flights, picks, strict=True)},
        differences={flight.flight: float(value) for flight, value in zip(flights, differences, strict=True)},
        difference=mean,
        lower=mean - reach if known else None,
        upper=mean + reach if known else None,
        stays=sum(names[pick] == best for pick in picks),
    )
