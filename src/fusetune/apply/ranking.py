"""Ranks the sets by the mean score over the flights and compares each with the present set."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fusetune.apply.bootstrap import (
    Redrawn,
    bootstrap_scores,
    expanded_interval,
    holm,
    interval_over_flights,
    p_value,
    probability_best,
    spread_of_flights,
)
from fusetune.apply.evidence import AIMS, AnalyzedFlight, FlightEvidence
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.sign_flips import family_p_values

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class AimComparison:
    """A set against the present one in one kind of prediction: mean difference of the score and its interval."""

    difference: float
    lower: float
    upper: float
    flights: int

    @property
    def is_worse(self) -> bool:
        """Worse than the present set beyond doubt."""
        return self.lower > 0.0


@dataclass(frozen=True)
class RankedSet:
    """One set in the ranking.

    Attributes
    ----------
    status : "present", "candidate", "vetoed" or "not_scored"
    score : mean over the flights, nat; lower is better
    difference, lower, upper : score less that of the present set, and its interval; below 0 is better
    p_value, p_holm : of the difference against 0, alone and by Holm's correction for all candidates
    p_family : that the best of the candidates is so much better by luck, see `fusetune.apply.sign_flips`
    p_best : share of bootstrap draws in which no eligible set scores lower
    flights, flights_better : flights behind the score, and on how many of them it beats the present set
    equal_to_present : same results on every flight
    improvement_percent : by how much smaller its typical prediction error is than the present set's
    behind_best, behind_best_error : score less that of the best set, and its standard error; best is the lowest of
        those that are proved better than the present set, or where none is, of all that may be flown
    aims : the comparison in each kind of prediction
    """

    name: str
    status: str
    reasons: tuple[str, ...]
    score: float
    difference: float
    lower: float
    upper: float
    p_value: float
    p_holm: float
    p_family: float
    p_best: float
    flights: int
    flights_better: int
    equal_to_present: bool
    improvement_percent: float
    behind_best: float
    behind_best_error: float
    aims: dict[str, AimComparison]

    @property
    def worse_aims(self) -> tuple[str, ...]:
        """Kinds of prediction in which the set is worse than the present one beyond doubt."""
        return tuple(name for name, aim in self.aims.items() if aim.is_worse)

    @property
    def is_eligible(self) -> bool:
        """Whether the set may be chosen, if the evidence is for it."""
        return self.status == "candidate" and not self.equal_to_present and not self.worse_aims


def is_proved(candidate: RankedSet, settings: DecisionSettings) -> bool:
    """Better than the present set beyond doubt, by itself and as one of many candidates."""
    p_value = {"holm": candidate.p_holm, "sign_flips": candidate.p_family, "none": 0.0}[settings.multiplicity]
    return candidate.upper < 0.0 and p_value <= 1.0 - settings.confidence


def rank(
    sets: Sequence[str],
    present: str,
    flights: Sequence[AnalyzedFlight],
    vetoed: Mapping[str, Sequence[str]],
    settings: DecisionSettings,
) -> list[RankedSet]:
    """Rank all sets; the eligible ones by score, then the vetoed, then those never scored.

    Parameters
    ----------
    sets : names, the present one among them
    vetoed : reasons against a set, by name
    """
    evidence = [flight.evidence for flight in flights if flight.evidence is not None]
    by_set = {name: [one for one in evidence if name in one.sets] for name in sets}
    complete = [name for name in sets if evidence and len(by_set[name]) == len(evidence)]
    partial = [name for name in sets if 0 < len(by_set[name]) < len(evidence)]
    equal = {
        name
        for name in complete
        if name != present and all(f.summary["sets"][name]["same_results_as_present"] for f in flights if f.evidence)
    }
    ranked: list[RankedSet] = []
    if complete:
        redrawn = bootstrap_scores(evidence, complete, settings.draws, settings.seed)
        ranked = [
            _compared(name, present, evidence, complete, redrawn, vetoed, name in equal, settings) for name in complete
        ]
        ranked = _with_family(ranked, present, evidence, complete, redrawn.total, settings)
    for name in partial:
        # A set that failed on some flights: its figures come from the others, for information.
        redrawn = bootstrap_scores(by_set[name], [name, present], settings.draws, settings.seed)
        ranked.append(_compared(name, present, by_set[name], [name, present], redrawn, vetoed, False, settings))
    ranked += [_never_scored(name, vetoed) for name in sets if not by_set[name]]
    order = {"present": 0, "candidate": 0, "vetoed": 1, "not_scored": 2}
    present_first = {True: 0, False: 1}
    return sorted(ranked, key=lambda one: (order[one.status], one.score, present_first[one.name == present], one.name))


def _compared(
    name: str,
    present: str,
    evidence: Sequence[FlightEvidence],
    sets: Sequence[str],
    redrawn: Redrawn,
    vetoed: Mapping[str, Sequence[str]],
    equal: bool,
    settings: DecisionSettings,
) -> RankedSet:
    own = np.array([one.scores[one.sets.index(name)] for one in evidence])
    base = np.array([one.scores[one.sets.index(present)] for one in evidence])
    difference = float(np.mean(own - base))
    differences = spread_of_flights(_differences(redrawn.total, sets, name, present), own - base)
    interval = expanded_interval(differences, len(evidence), settings.confidence)
    reasons = tuple(vetoed.get(name, ()))
    return RankedSet(
        name=name,
        status="present" if name == present else "vetoed" if reasons else "candidate",
        reasons=reasons,
        score=float(np.mean(own)),
        difference=difference,
        lower=interval.lower,
        upper=interval.upper,
        p_value=1.0 if name == present else p_value(difference, differences, len(evidence)),
        p_holm=1.0,
        p_family=1.0,
        p_best=0.0,
        flights=len(evidence),
        flights_better=int(np.count_nonzero(own < base)),
        equal_to_present=equal,
        improvement_percent=improvement_percent(difference),
        behind_best=math.nan,
        behind_best_error=math.nan,
        aims=_aims(name, present, evidence, sets, redrawn, settings),
    )


def _differences(scores: Array, sets: Sequence[str], name: str, base: str) -> Array:
    return np.asarray(scores[:, sets.index(name)] - scores[:, sets.index(base)])


def _aims(
    name: str,
    present: str,
    evidence: Sequence[FlightEvidence],
    sets: Sequence[str],
    redrawn: Redrawn,
    settings: DecisionSettings,
) -> dict[str, AimComparison]:
    compared = {}
    for aim in AIMS:
        flights = [(one, part) for one in evidence if (part := one.aim(aim)) is not None]
        if not flights:
            continue
        found = np.array(
            [part.scores[one.sets.index(name)] - part.scores[one.sets.index(present)] for one, part in flights]
        )
        draws = _differences(redrawn.aims[aim], sets, name, present)
        interval = interval_over_flights(draws, found, settings.confidence)
        compared[aim] = AimComparison(float(np.mean(found)), interval.lower, interval.upper, len(flights))
    return compared


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
    candidates = [one for one in ranked if one.status == "candidate" and not one.equal_to_present]
    adjusted = dict(zip((one.name for one in candidates), holm([one.p_value for one in candidates]), strict=True))
    family = _family_p_values([one.name for one in candidates if one.is_eligible], present, evidence, settings)
    eligible = [one.name for one in ranked if one.status in ("present", "candidate")]
    if not eligible:
        return ranked
    best = probability_best(scores[:, [complete.index(name) for name in eligible]])
    shares = dict(zip(eligible, best, strict=True))
    ranked = [
        replace(
            one,
            p_holm=adjusted.get(one.name, 1.0),
            p_family=family.get(one.name, 1.0),
            p_best=float(shares.get(one.name, 0.0)),
        )
        for one in ranked
    ]
    able = [one for one in ranked if one.status == "present" or one.is_eligible]
    proved = [one for one in able if one.is_eligible and is_proved(one, settings)]
    lead = min(proved or able, key=lambda one: (one.score, one.name))
    return [
        replace(
            one,
            behind_best=one.score - lead.score,
            behind_best_error=float(np.std(_differences(scores, complete, one.name, lead.name))),
        )
        for one in ranked
    ]


def _family_p_values(
    names: Sequence[str], present: str, evidence: Sequence[FlightEvidence], settings: DecisionSettings
) -> dict[str, float]:
    if not names:
        return {}
    rows = [one.scores[[one.sets.index(name) for name in (present, *names)]] for one in evidence]
    differences = np.array([row[1:] - row[0] for row in rows])
    return dict(zip(names, family_p_values(differences, settings.seed).tolist(), strict=True))


def _never_scored(name: str, vetoed: Mapping[str, Sequence[str]]) -> RankedSet:
    nan = math.nan
    reasons = tuple(vetoed.get(name, ())) or ("scored on no flight",)
    return RankedSet(
        name, "not_scored", reasons, nan, nan, nan, nan, 1.0, 1.0, 1.0, 0.0, 0, 0, False, nan, nan, nan, {}
    )
