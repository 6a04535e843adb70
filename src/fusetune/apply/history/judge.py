"""What the flights after a change show of it.

Two measures, for neither says all:

* **Paired**: on every flight after the change the values before and after it are replayed. Wind, route and sensors of
  the day are then the same for both, and none of these flights had a part in the choice. One comparison, fixed
  beforehand: there is nothing to correct for. By this a change is confirmed or refuted.
* **Unpaired**: what the filter did on board, before and after, each flight with the parameters that it flew. Nothing is
  replayed that was not flown, but the days differ, so it takes far more flights; it is shown beside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import stdtrit

from fusetune.apply.criteria import metrics_of
from fusetune.apply.evidence import AIMS, AnalyzedFlight, FlightEvidence
from fusetune.apply.history.entries import AFTER, BEFORE, DecisionEntry, EvidenceFlight, Gain, OutcomeEntry
from fusetune.apply.ranking import improvement_percent
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.mean_difference import mean_differences
from fusetune.apply.vetoes import break_rates, vetoes

CONFIRMED, REFUTED, UNKNOWN = "confirmed", "refuted", "not yet known"
AS_PREDICTED, LESS, MORE = "as predicted", "less", "more"


def judge_change(
    entry: DecisionEntry, measured: Sequence[AnalyzedFlight], settings: DecisionSettings
) -> OutcomeEntry | None:
    """What flights after a change show of it; None where none of them tells anything.

    It is *refuted* where something rules the new parameters out on these flights, or where even the upper end of the
    paired interval is below the smallest gain for which a change is made; *confirmed* where the lower end is above 0;
    else it is *not yet known*.

    Parameters
    ----------
    measured : flights after it, with the sets `BEFORE` and `AFTER`
    """
    telling = [one for one in measured if one.evidence is not None]
    evidence = [one.evidence for one in telling if one.evidence is not None]
    if not evidence:
        return None
    both = [one for one in evidence if AFTER in one.sets]
    objections = vetoes(AFTER, BEFORE, measured, break_rates(metrics_of(measured)), settings)
    paired = _paired(both, settings)
    after = [EvidenceFlight(one.flight, "", "", *_own_scores(one)) for one in both]
    return OutcomeEntry(
        of=entry.key,
        written="",
        status=_status(paired, objections, settings),
        paired=paired,
        unpaired=unpaired_gain(entry.evidence, after, settings.confidence),
        against_prediction=_against(entry.predicted, paired),
        objections=objections,
        flights=[one.summary["checksum"] for one in telling],
        names=[one.name for one in telling],
    )


def _paired(both: Sequence[FlightEvidence], settings: DecisionSettings) -> Gain:
    """The gain on the flights on which both could be scored."""
    if not both:
        return Gain(None, None, None, 0, settings.confidence)
    one = mean_differences(both, [BEFORE, AFTER], settings)[1]
    return _gain(one.difference, one.lower, one.upper, one.flights, settings.confidence)


def unpaired_gain(before: Sequence[EvidenceFlight], after: Sequence[EvidenceFlight], confidence: float) -> Gain:
    """The gain from some flights to others, each with what it flew (Welch's interval); the aims that all have, weighed
    alike on all, as a flight's own weights follow from its day."""
    flights = [*before, *after]
    if not before or not after:
        return Gain(None, None, None, 0, confidence)
    shared = [aim for aim in AIMS if all(aim in one.scores for one in flights)]
    weights = {aim: float(np.mean([one.weights.get(aim, 0.0) for one in flights])) for aim in shared}
    total = sum(weights.values())
    if total <= 0.0:
        return Gain(None, None, None, 0, confidence)
    first, second = (
        np.array([sum(weights[aim] * one.scores[aim] for aim in shared) / total for one in group])
        for group in (before, after)
    )
    difference = float(second.mean() - first.mean())
    if min(first.size, second.size) < 2:
        return _gain(difference, None, None, second.size, confidence)
    shares = np.array([first.var(ddof=1) / first.size, second.var(ddof=1) / second.size])
    if shares.sum() == 0.0:
        return _gain(difference, None, None, second.size, confidence)
    freedom = shares.sum() ** 2 / np.sum(shares**2 / (np.array([first.size, second.size]) - 1))
    reach = -float(stdtrit(freedom, 0.5 * (1.0 - confidence)) * np.sqrt(shares.sum()))
    return _gain(difference, difference - reach, difference + reach, second.size, confidence)


def _own_scores(evidence: FlightEvidence) -> tuple[dict[str, float], dict[str, float]]:
    """Score and weight of each aim on a flight after the change, of the parameters that it flew."""
    index = evidence.sets.index(AFTER)
    scores = {aim.name: float(aim.scores[index]) for aim in evidence.aims}
    return scores, {aim.name: aim.weight for aim in evidence.aims}


def _gain(difference: float, lower: float | None, upper: float | None, flights: int, confidence: float) -> Gain:
    low, high = (None if end is None else improvement_percent(end) for end in (upper, lower))
    return Gain(improvement_percent(difference), low, high, flights, confidence)


def _status(paired: Gain, objections: Sequence[str], settings: DecisionSettings) -> str:
    if objections or (paired.upper is not None and paired.upper < settings.smallest_gain_percent):
        return REFUTED
    return CONFIRMED if paired.lower is not None and paired.lower > 0.0 else UNKNOWN


def _against(predicted: Gain, measured: Gain) -> str:
    if predicted.lower is None or predicted.upper is None or measured.lower is None or measured.upper is None:
        return ""
    if measured.upper < predicted.lower:
        return LESS
    return MORE if measured.lower > predicted.upper else AS_PREDICTED
