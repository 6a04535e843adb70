"""Ranks the sets by the mean score over the flights and compares each with the present set."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fusetune.apply.bootstrap import bootstrap_scores, expanded_interval, holm, p_value, probability_best
from fusetune.apply.evidence import AnalyzedFlight, FlightEvidence
from fusetune.apply.settings import DecisionSettings

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RankedSet:
    """One set in the ranking.

    Attributes
    ----------
    status : "present", "candidate", "vetoed" or "not_scored"
    score : mean scale-profiled NLL over the flights, nat; lower is better
    difference, lower, upper : score less that of the present set, and its interval; below 0 is better
    p_value, p_holm : of the difference against 0, alone and corrected for all candidates
    p_best : share of bootstrap draws in which no eligible set scores lower
    flights, flights_better : flights behind the score, and on how many of them it beats the present set
    equal_to_present : same results on every flight
    improvement_percent : by how much smaller its typical prediction error is than the present set's
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
    p_best: float
    flights: int
    flights_better: int
    equal_to_present: bool
    improvement_percent: float


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
    scores = bootstrap_scores(evidence, complete, settings.draws, settings.seed) if complete else np.zeros((0, 0))
    ranked = [_scored(name, present, evidence, complete, scores, vetoed, equal, settings) for name in complete]
    ranked = _with_family(ranked, complete, scores)
    ranked += [_partly_scored(name, present, by_set[name], vetoed, settings) for name in partial]
    ranked += [_never_scored(name, vetoed) for name in sets if not by_set[name]]
    order = {"present": 0, "candidate": 0, "vetoed": 1, "not_scored": 2}
    present_first = {True: 0, False: 1}
    return sorted(ranked, key=lambda one: (order[one.status], one.score, present_first[one.name == present], one.name))


def _scored(
    name: str,
    present: str,
    evidence: Sequence[FlightEvidence],
    complete: Sequence[str],
    scores: Array,
    vetoed: Mapping[str, Sequence[str]],
    equal: set[str],
    settings: DecisionSettings,
) -> RankedSet:
    differences = scores[:, complete.index(name)] - scores[:, complete.index(present)]
    return _compared(name, present, evidence, differences, vetoed, name in equal, settings)


def _partly_scored(
    name: str,
    present: str,
    evidence: Sequence[FlightEvidence],
    vetoed: Mapping[str, Sequence[str]],
    settings: DecisionSettings,
) -> RankedSet:
    """A set that failed on some flights: its figures come from the others, for information."""
    scores = bootstrap_scores(evidence, [name, present], settings.draws, settings.seed)
    return _compared(name, present, evidence, scores[:, 0] - scores[:, 1], vetoed, False, settings)


def _compared(
    name: str,
    present: str,
    evidence: Sequence[FlightEvidence],
    differences: Array,
    vetoed: Mapping[str, Sequence[str]],
    equal: bool,
    settings: DecisionSettings,
) -> RankedSet:
    own = np.array([one.scores[one.sets.index(name)] for one in evidence])
    base = np.array([one.scores[one.sets.index(present)] for one in evidence])
    difference = float(np.mean(own - base))
    interval = expanded_interval(differences, len(evidence), settings.confidence)
    axes = evidence[0].n.shape[1]
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
        p_best=0.0,
        flights=len(evidence),
        flights_better=int(np.count_nonzero(own < base)),
        equal_to_present=equal,
        improvement_percent=improvement_percent(difference, axes),
    )


def improvement_percent(difference: float, axes: int) -> float:
    """By how much smaller the typical prediction error is, in percent.

    The profiled score is, per axis, the logarithm of a prediction error relative to its expected course, so a
    difference of Δ over `axes` axes is a factor exp(Δ / axes).
    """
    return 100.0 * (1.0 - math.exp(difference / axes))


def _with_family(ranked: list[RankedSet], complete: Sequence[str], scores: Array) -> list[RankedSet]:
    """Add what depends on the other sets: Holm's correction over the candidates, and P(best)."""
    candidates = [one for one in ranked if one.status == "candidate" and not one.equal_to_present]
    adjusted = dict(zip((one.name for one in candidates), holm([one.p_value for one in candidates]), strict=True))
    eligible = [one.name for one in ranked if one.status in ("present", "candidate")]
    if not eligible:
        return ranked
    best = probability_best(scores[:, [complete.index(name) for name in eligible]])
    shares = dict(zip(eligible, best, strict=True))
    return [replace(one, p_holm=adjusted.get(one.name, 1.0), p_best=float(shares.get(one.name, 0.0))) for one in ranked]


def _never_scored(name: str, vetoed: Mapping[str, Sequence[str]]) -> RankedSet:
    nan = math.nan
    reasons = tuple(vetoed.get(name, ())) or ("scored on no flight",)
    return RankedSet(name, "not_scored", reasons, nan, nan, nan, nan, 1.0, 1.0, 0.0, 0, 0, False, nan)
