"""Ranks the sets by the mean score over the flights and compares each with the present set."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import AIMS, SMOOTHED, UNAIDED, AnalyzedFlight, FlightEvidence
from fusetune.apply.evidence_cost import evidence_lost_percent
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.bootstrap import (
    FEWEST_REDRAWN,
    bootstrap_scores,
    holm,
    probability_best,
    standard_error,
    units_redrawn,
)
from fusetune.apply.statistics.mean_difference import MeanDifference, mean_differences
from fusetune.apply.statistics.rounding import EQUAL_WITHIN, without_rounding
from fusetune.apply.statistics.shrinkage import expected_differences
from fusetune.apply.statistics.sign_flips import family_p_values
from fusetune.apply.worse_aims import mean_weights, worse_aims

Array = npt.NDArray[np.float64]


PRESENT, ELIGIBLE, SAME, NOT_ELIGIBLE, NOT_SCORED = "flies now", "eligible", "same as now", "not eligible", "not scored"
"""Parts that a set can have in the decision, as the tables, the page and the files name them."""


@dataclass(frozen=True)
class RankedSet:
    """One set in the ranking; by default it was scored on no flight.

    What nothing shows the spread of is not known: None.

    Attributes
    ----------
    is_present : whether it is the set that flies now
    reasons : what is held against it, or why it was not scored
    score : mean over the flights, nat; lower is better
    difference, lower, upper : score less that of the present set, and its interval; below 0 is better
    error : standard error of the difference
    expected : the difference that is to be expected, see `fusetune.apply.statistics.shrinkage`
    p_value, p_holm : of the difference against 0, alone and by Holm's correction for all candidates
    p_family : that the best of the candidates is so much better by luck, see `fusetune.apply.statistics.sign_flips`
    bound : upper end of the wider interval of the difference by which a change is decided
    velocity_bound, p_velocity : the same two of the difference in the smoothed velocity alone; None where it is not
        known on all flights
    p_best : share of bootstrap draws in which no set that may be flown scores lower; not known with few units, of which
        the draws are so much alike that a set which is best on all of them would be best for sure
    flights, flights_better : flights behind the score, and on how many of them it beats the present set
    equal_to_present : same results on every flight
    improvement_percent : by how much smaller its typical prediction error is than the present set's
    behind_best, behind_best_error : score less that of the best set, and its standard error; best is the lowest of
        those that are proved better than the present set, or where none is, of all that may be flown
    aims : mean difference of the score to that of the present set in each kind of prediction
    worse_aims : kinds of prediction in which the set is worse than the present one beyond doubt, and that rule it out
    evidence_lost_percent : how much of the evidence it lacks or spoilt by resets of its own, and is charged for
    """

    name: str
    is_present: bool
    reasons: tuple[str, ...]
    score: float = math.nan
    difference: float = math.nan
    lower: float | None = None
    upper: float | None = None
    error: float | None = None
    expected: float = math.nan
    p_value: float | None = None
    p_holm: float | None = None
    p_family: float | None = None
    bound: float | None = None
    velocity_bound: float | None = None
    p_velocity: float | None = None
    p_best: float | None = None
    flights: int = 0
    flights_better: int = 0
    equal_to_present: bool = False
    improvement_percent: float = math.nan
    behind_best: float = math.nan
    behind_best_error: float | None = None
    aims: dict[str, MeanDifference] = field(default_factory=dict)
    worse_aims: tuple[str, ...] = ()
    evidence_lost_percent: float | None = None

    @property
    def status(self) -> str:
        """Its part in the decision."""
        if self.is_present:
            return PRESENT
        if not self.flights:
            return NOT_SCORED
        if self.reasons or self.worse_aims:
            return NOT_ELIGIBLE
        return SAME if self.equal_to_present else ELIGIBLE

    @property
    def is_vetoed(self) -> bool:
        """Whether it was scored, and ruled out by something other than its score."""
        return bool(self.reasons) and self.flights > 0 and not self.is_present

    @property
    def is_eligible(self) -> bool:
        """Whether the set may be chosen, if the evidence is for it."""
        return self.status == ELIGIBLE


def proved_sets(ranked: Sequence[RankedSet], settings: DecisionSettings) -> list[RankedSet]:
    """Sets that are better than the present one beyond doubt, in the order of the ranking.

    A set is so in its whole score, or in the smoothed velocity if it is not worse in the others; either is held to half
    of the error that is allowed. That a change helps at all is shown for all candidates together: one of these must be
    better by more than the luck of the best of many. Once that is shown, any of them may be chosen.
    """
    beyond = [one for one in ranked if one.is_eligible and (gains_enough(one, settings) or is_nearer(one, settings))]
    return beyond if any(_is_no_luck(one, settings) for one in beyond) else []


def gains_enough(candidate: RankedSet, settings: DecisionSettings) -> bool:
    """Whether the whole interval of its difference lies beyond the smallest gain for which a change is made."""
    return candidate.bound is not None and candidate.bound < settings.smallest_gain


def is_nearer(candidate: RankedSet, settings: DecisionSettings) -> bool:
    """Whether its velocity is beyond doubt nearer to the smoothed one, and its predictions are better as well, though
    not beyond doubt: by what matters in the whole score, and by anything without GNSS."""
    unaided = candidate.aims.get(UNAIDED)
    return (
        candidate.velocity_bound is not None
        and candidate.velocity_bound < settings.smallest_gain
        and candidate.difference < settings.smallest_gain
        and unaided is not None
        and unaided.difference <= 0.0
    )


def _is_no_luck(candidate: RankedSet, settings: DecisionSettings) -> bool:
    """Whether what the set is better in is more than the luck of the best of all candidates."""
    most = 1.0 - settings.confidence
    if settings.multiplicity == "none":
        return True
    if settings.multiplicity == "holm":
        return candidate.p_holm is not None and candidate.p_holm <= most
    ways = (
        (candidate.p_family, gains_enough(candidate, settings)),
        (candidate.p_velocity, is_nearer(candidate, settings)),
    )
    return any(better and p_value is not None and p_value <= most for p_value, better in ways)


def rank(
    sets: Sequence[str],
    present: str,
    flights: Sequence[AnalyzedFlight],
    vetoed: Mapping[str, Sequence[str]],
    settings: DecisionSettings,
) -> list[RankedSet]:
    """Rank all sets by score; those that were vetoed after the others, then those never scored.

    Parameters
    ----------
    sets : names, the present one among them
    vetoed : reasons against a set, by name
    """
    evidence = [flight.evidence for flight in flights if flight.evidence is not None]
    by_set = {name: [one for one in evidence if name in one.row] for name in sets}
    complete = [name for name in sets if evidence and len(by_set[name]) == len(evidence)]
    partial = [name for name in sets if 0 < len(by_set[name]) < len(evidence)]
    equal = {
        name
        for name in complete
        if name != present and all(f.summary["sets"][name]["same_results_as_present"] for f in flights if f.evidence)
    }
    ranked: list[RankedSet] = []
    if complete:
        ranked = _compared(complete, present, evidence, vetoed, equal, settings)
        redrawn = bootstrap_scores(evidence, complete, settings.draws, settings.seed)
        ranked = _with_family(ranked, present, evidence, complete, redrawn, settings)
    for name in partial:
        # A set that failed on some flights: its figures come from the others, for information.
        ranked += [one for one in _compared([name], present, by_set[name], vetoed, equal, settings) if one.name == name]
    ranked += [_never_scored(name, present, vetoed) for name in sets if not by_set[name]]
    ranked = [replace(one, evidence_lost_percent=evidence_lost_percent(one.name, flights, settings)) for one in ranked]
    return sorted(ranked, key=lambda one: (not one.flights, one.is_vetoed, one.score, not one.is_present, one.name))


def _compared(
    sets: Sequence[str],
    present: str,
    evidence: Sequence[FlightEvidence],
    vetoed: Mapping[str, Sequence[str]],
    equal: Collection[str],
    settings: DecisionSettings,
) -> list[RankedSet]:
    """Sets that were all scored on all of these flights, against the present one."""
    names = list(dict.fromkeys((present, *sets)))
    scores = np.array([one.scores[one.rows_of(names)] for one in evidence])
    to_present = mean_differences(evidence, names, settings)
    aims = _aims(names, evidence, settings)
    of_velocity = aims[SMOOTHED] if all(one.aim(SMOOTHED) is not None for one in evidence) else None
    weights = mean_weights(evidence)
    return [
        RankedSet(
            name=name,
            is_present=name == present,
            reasons=tuple(vetoed.get(name, ())),
            score=float(np.mean(scores[:, index])),
            difference=compared.difference,
            lower=compared.lower,
            upper=compared.upper,
            error=compared.error,
            expected=compared.difference,
            p_value=compared.p_value,
            p_holm=1.0,
            p_family=1.0,
            bound=compared.upper_at(settings.confidence_of_a_change),
            velocity_bound=of_velocity[index].upper_at(settings.confidence_of_a_change) if of_velocity else None,
            p_best=0.0,
            flights=len(evidence),
            flights_better=int(np.count_nonzero(without_rounding(scores[:, index] - scores[:, 0]) < 0.0)),
            equal_to_present=name in equal,
            improvement_percent=improvement_percent(compared.difference),
            aims=(own := {aim: of_sets[index] for aim, of_sets in aims.items()}),
            worse_aims=worse_aims(own, weights, compared),
        )
        for index, (name, compared) in enumerate(zip(names, to_present, strict=True))
    ]


def _aims(
    names: Sequence[str], evidence: Sequence[FlightEvidence], settings: DecisionSettings
) -> dict[str, list[MeanDifference]]:
    """Differences in each kind of prediction, on the flights that have it."""
    having = {aim: [one for one in evidence if one.aim(aim) is not None] for aim in AIMS}
    return {aim: mean_differences(flights, names, settings, aim) for aim, flights in having.items() if flights}


def _differences(scores: Array, sets: Sequence[str], name: str, base: str) -> Array:
    return np.asarray(scores[:, sets.index(name)] - scores[:, sets.index(base)])


def improvement_percent(difference: float) -> float:
    """By how much smaller the typical prediction error is, in percent.

    The score is a mean of logarithms of prediction errors, so a difference of Δ is a factor exp Δ.
    """
    return 100.0 * (1.0 - math.exp(difference))


def _with_family(
    ranked: list[RankedSet],
    present: str,
    evidence: Sequence[FlightEvidence],
    complete: Sequence[str],
    scores: Array,
    settings: DecisionSettings,
) -> list[RankedSet]:
    """Add what depends on the other sets: the corrections for their number, P(best), the distance to the best."""
    candidates = [one for one in ranked if not (one.is_present or one.is_vetoed or one.equal_to_present)]
    adjusted = dict(zip((one.name for one in candidates), holm([one.p_value for one in candidates]), strict=True))
    eligible = [one.name for one in candidates if one.is_eligible]
    worth = expected_differences([one.difference for one in candidates], [one.error for one in candidates])
    expected = dict(zip((one.name for one in candidates), worth, strict=True))
    family, of_velocity = _family_p_values(eligible, present, evidence, settings)
    able = [one.name for one in ranked if one.status != NOT_ELIGIBLE]
    units = units_redrawn(evidence)
    shares = _shares_of_best(able, complete, scores) if units >= FEWEST_REDRAWN else None
    ranked = [
        replace(
            one,
            p_holm=adjusted.get(one.name, 1.0),
            p_family=family.get(one.name, 1.0),
            p_velocity=of_velocity.get(one.name),
            expected=expected.get(one.name, one.difference),
            p_best=None if shares is None else shares.get(one.name, 0.0),
        )
        for one in ranked
    ]
    return _with_distance_to_the_best(ranked, complete, scores, units, settings)


def _shares_of_best(able: Sequence[str], complete: Sequence[str], scores: Array) -> dict[str, float] | None:
    """Share of draws in which each set is best; None where sets differ and no draw shows by how much that varies."""
    place = {name: column for column, name in enumerate(complete)}
    drawn = scores[:, [place[name] for name in able]]
    differences = drawn - drawn[:, :1]
    if not (differences.std(axis=0) > EQUAL_WITHIN).any() and without_rounding(differences).any():
        return None
    return dict(zip(able, probability_best(drawn).tolist(), strict=True))


def _with_distance_to_the_best(
    ranked: list[RankedSet], complete: Sequence[str], scores: Array, units: int, settings: DecisionSettings
) -> list[RankedSet]:
    able = [one for one in ranked if one.is_present or one.is_eligible]
    proved = proved_sets(ranked, settings)
    lead = min(proved or able, key=lambda one: (one.expected if proved else one.score, one.name))

    def error(name: str) -> float | None:
        if name == lead.name:
            return 0.0
        draws = _differences(scores, complete, name, lead.name)
        return float(np.std(draws)) if standard_error(draws, units) is not None else None

    return [replace(one, behind_best=one.score - lead.score, behind_best_error=error(one.name)) for one in ranked]


def _family_p_values(
    names: Sequence[str], present: str, evidence: Sequence[FlightEvidence], settings: DecisionSettings
) -> tuple[dict[str, float | None], dict[str, float | None]]:
    """Of the whole scores, and of the smoothed velocities where all flights have them; together one family."""
    if not names:
        return {}, {}
    aims = (None, SMOOTHED) if all(one.aim(SMOOTHED) is not None for one in evidence) else (None,)
    kinds = [np.array([one.differences((present, *names), aim)[1:] for one in evidence]) for aim in aims]
    found = family_p_values(np.hstack(kinds), settings.seed).tolist()
    values = [value if math.isfinite(value) else None for value in found]
    total, velocity = values[: len(names)], values[len(names) :]
    return dict(zip(names, total, strict=True)), dict(zip(names, velocity, strict=False))


def _never_scored(name: str, present: str, vetoed: Mapping[str, Sequence[str]]) -> RankedSet:
    return RankedSet(name, name == present, tuple(vetoed.get(name, ())) or ("scored on no flight",))
