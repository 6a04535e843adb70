"""The rule: a set that nothing speaks against, if it is better than the present one beyond doubt."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fusetune.apply.evidence import FlightEvidence
from fusetune.apply.ranking import RankedSet, proved_sets
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.leave_one_out import LeaveOneOut, leave_one_out
from fusetune.set_names import DELAY_MENDED, is_mended


@dataclass(frozen=True)
class Choice:
    """What to fly.

    Attributes
    ----------
    status : "change", "keep" or "no_evidence"
    chosen : name of the set to fly
    best : the eligible candidate with the lowest score, whether chosen or not; None where there is none
    pick : the candidate that is chosen instead of the present set; None if that is kept
    exploratory : too few flights for a firm statement
    leave_one_out : what choices from all flights but one were worth on that one; None with too few flights
    beyond_mending : where delays are mended, the chosen set less the present one with no more than that mended; None
        where the chosen set is that one, and where none is mended
    """

    status: str
    chosen: str
    best: RankedSet | None
    pick: RankedSet | None
    exploratory: bool
    leave_one_out: LeaveOneOut | None
    beyond_mending: RankedSet | None = None

    @property
    def mends_delays(self) -> bool:
        """Whether the chosen set is one with mended delays."""
        return is_mended(self.chosen)


def choose(
    ranked: Sequence[RankedSet],
    present: str,
    evidence: Sequence[FlightEvidence],
    distances: Mapping[str, float],
    settings: DecisionSettings,
) -> Choice:
    """Keep the present set unless the best candidate is better beyond doubt.

    Parameters
    ----------
    ranked : from `rank`
    evidence : of the scored flights
    distances : how far each set's parameters are from the present ones, from `parameter_distance`

    Notes
    -----
    Eligible is a candidate that is not worse than the present set, beyond doubt, in any kind of prediction. Proved
    better are those whose interval lies wholly beyond the smallest gain, if one of them is better in spite of the
    number of candidates (`fusetune.apply.ranking.proved_sets`). The proved set of which most is to be expected is
    chosen, or one that is proved, within one standard error of it, hardly worse in expectation and at worst
    (`DecisionSettings.equivalence_percent`) and nearer to the present parameters.
    """
    exploratory = len(evidence) < settings.minimum_flights
    eligible = [one for one in ranked if one.is_eligible]
    best = min(eligible, key=lambda one: (one.score, one.name), default=None)
    if not evidence:
        return Choice("no_evidence", present, None, None, exploratory, None)
    names = [one.name for one in eligible if one.flights == len(evidence)]
    validated = leave_one_out(evidence, names, present, settings.confidence)
    proved = proved_sets(ranked, settings)
    if not proved:
        return Choice("keep", present, best, None, exploratory, validated)
    first = min(proved, key=lambda one: (one.expected, one.name))
    hardly = math.log1p(0.01 * settings.equivalence_percent)
    near = [
        one
        for one in proved
        if one.expected - first.expected <= min(one.behind_best_error or 0.0, hardly)
        and (one.bound or 0.0) - (first.bound or 0.0) <= hardly
    ]
    pick = min([first, *near], key=lambda one: (distances.get(one.name, math.inf), one.expected, one.name))
    return Choice("change", pick.name, best, pick, exploratory, validated)


def choose_after_mending(
    choice: Choice, ranked: Sequence[RankedSet], among_mended: Choice, name: str = DELAY_MENDED
) -> Choice:
    """First the delays that are proved wrong, then all else.

    That a delay is wrong is proved by the sensors, not by how well a set predicts, so the present set with the delays
    mended needs no further proof; it is enough that it is not worse. What else is to be changed is judged with the
    delays mended: beside a wrong delay other parameters are tuned to hide it.

    Parameters
    ----------
    choice : among all sets, against the present one
    ranked : all sets against the present one
    among_mended : among the sets with mended delays, against the present one with these mended
    name : of the present set with the delays mended
    """
    by_name = {one.name: one for one in ranked}
    mended = by_name.get(name)
    if mended is None or not (mended.is_eligible and mended.difference <= 0.0) or choice.status == "no_evidence":
        return choice
    return replace(
        choice,
        status="change",
        chosen=among_mended.chosen,
        pick=by_name[among_mended.chosen],
        leave_one_out=among_mended.leave_one_out if among_mended.pick else None,
        beyond_mending=among_mended.pick,
    )


def parameter_distance(values: Mapping[str, float], present: Mapping[str, float]) -> float:
    """Root of the summed squared logarithms of the ratios of a set's values to the present ones.

    A value that has no such ratio, as for switches and zeros, counts as 1 if it differs.
    """
    total = 0.0
    for name, value in values.items():
        now = present.get(name, math.nan)
        if value != now:
            total += math.log(value / now) ** 2 if value > 0.0 and now > 0.0 else 1.0
    return math.sqrt(total)
