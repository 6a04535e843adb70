"""The rule: the best set that nothing speaks against, if it is better than the present one beyond doubt."""

from collections.abc import Sequence
from dataclasses import dataclass

from fusetune.apply.ranking import RankedSet
from fusetune.apply.settings import DecisionSettings


@dataclass(frozen=True)
class Choice:
    """What to fly.

    Attributes
    ----------
    status : "change", "keep" or "no_evidence"
    chosen : name of the set to fly
    best : the best eligible candidate, whether chosen or not; None where there is none
    exploratory : too few flights for a firm statement
    """

    status: str
    chosen: str
    best: RankedSet | None
    exploratory: bool


def choose(ranked: Sequence[RankedSet], present: str, flights: int, settings: DecisionSettings) -> Choice:
    """Keep the present set unless the best candidate's interval lies wholly below 0.

    Parameters
    ----------
    ranked : from `rank`
    flights : number of scored flights

    Notes
    -----
    With `correct_for_candidates` its p-value must also survive Holm's correction: the best of many candidates
    looks better than it is.
    """
    exploratory = flights < settings.minimum_flights
    candidates = [one for one in ranked if one.status == "candidate" and not one.equal_to_present]
    best = min(candidates, key=lambda one: (one.score, one.name), default=None)
    if flights == 0:
        return Choice("no_evidence", present, None, exploratory)
    if best is not None and is_better(best, settings):
        return Choice("change", best.name, best, exploratory)
    return Choice("keep", present, best, exploratory)


def is_better(candidate: RankedSet, settings: DecisionSettings) -> bool:
    """True where a candidate is better than the present set by the rule of the settings."""
    if not candidate.upper < 0.0:
        return False
    return not settings.correct_for_candidates or candidate.p_holm <= 1.0 - settings.confidence
