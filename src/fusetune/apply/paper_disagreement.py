"""Where the paper's rule and the decision part, and why: sentences computed from the figures of the flights."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.apply.criteria import is_inside, is_known
from fusetune.apply.evidence import AIMS, AnalyzedFlight, white_shares
from fusetune.apply.paper_mode import (
    PAPER_VARIABLES,
    POSITION_VARIABLES,
    VELOCITY_VARIABLES,
    PaperEntry,
    aggregate_rms,
    root_sum,
)
from fusetune.apply.ranking import RankedSet
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.mean_difference import MeanDifference, mean_differences

WANDERING = 0.6
"""A source whose error is less white than this rewards a filter for following it."""


def is_same_set(one: str, other: str, ranked: Sequence[RankedSet]) -> bool:
    """Whether two sets are one, by name or because both gave the present set's results on every flight."""
    as_now = {entry.name for entry in ranked if entry.is_present or entry.equal_to_present}
    return one == other or {one, other} <= as_now


def why(
    first: str,
    order: Sequence[PaperEntry],
    chosen: str,
    ranked: Sequence[RankedSet],
    flights: Sequence[AnalyzedFlight],
    metrics: pa.Table,
    settings: DecisionSettings,
) -> list[str]:
    """Why the paper's rule and the decision choose the same set or do not, a sentence each.

    Parameters
    ----------
    first, order : the set that the paper's rule takes, and its whole ranking
    chosen : the decision
    ranked : the ranking behind the decision
    metrics : the figures of all flights (columns of `METRICS_SCHEMA`)
    """
    if first == chosen:
        return [f"Both rules choose “{first}”."]
    if is_same_set(first, chosen, ranked):
        return [f"“{first}” gave the same results as “{chosen}” on every flight: the two rules agree."]
    entry = next(one for one in ranked if one.name == first)
    worse = [f"worse than the present set in its {aim} predictions beyond doubt" for aim in entry.worse_aims]
    scored = [flight.name for flight in flights if flight.evidence is not None]
    present = next(one.name for one in ranked if one.is_present)
    case = Disagreement(
        first=paper_view(first, scored, metrics),
        chosen=paper_view(chosen, scored, metrics),
        any_consistent=any(one.consistent for one in order),
        **_log_ratios(first, chosen, flights, settings),
        position_white_share=white_shares(metrics, present).get("gnss_pos", math.nan),
        objections=[*entry.reasons, *worse],
        confidence=settings.confidence,
    )
    return reasons(case)


@dataclass(frozen=True)
class PaperView:
    """What the paper's rule looks at in one set, over all scored flights.

    Attributes
    ----------
    position_rms, velocity_rms : root of the summed squares of the mean RMS of their variables, m and m/s
    flight_rms : aggregate RMS of each flight
    relative_nis : mean NIS of GNSS velocity divided by its expectation; NaN where unknown
    flights_inside, flights : on how many flights that lies inside the paper's two-sided χ² bounds
    """

    name: str
    position_rms: float
    velocity_rms: float
    flight_rms: Mapping[str, float]
    relative_nis: float
    flights_inside: int
    flights: int

    @property
    def aggregate_rms(self) -> float:
        return math.hypot(self.position_rms, self.velocity_rms)

    @property
    def is_consistent(self) -> bool:
        return self.flights > 0 and 2 * self.flights_inside >= self.flights


def paper_view(name: str, flights: Sequence[str], metrics: pa.Table) -> PaperView:
    """Gather what the paper's rule looks at.

    Parameters
    ----------
    flights : names of the scored flights
    metrics : the figures of all flights (columns of `METRICS_SCHEMA`)
    """
    kept = metrics.filter(
        pc.and_(pc.equal(metrics["set"], name), pc.is_in(metrics["flight"], value_set=pa.array(flights, pa.string())))
    )
    rms = kept.filter(pc.equal(kept["metric"], "rms_innovation")).to_pylist()
    values = {(row["flight"], row["source"], row["axis"]): row["value"] for row in rms}
    by_variable = {variable: _by_flight(places, flights, values) for variable, places in PAPER_VARIABLES.items()}
    means = {variable: float(np.mean(list(found.values()))) for variable, found in by_variable.items() if found}
    nis = [
        row
        for row in kept.filter(pc.equal(kept["metric"], "mean_nis")).to_pylist()
        if row["source"] == "gnss_vel" and row["axis"] == "all" and is_known(row)
    ]
    return PaperView(
        name=name,
        position_rms=root_sum(means, POSITION_VARIABLES),
        velocity_rms=root_sum(means, VELOCITY_VARIABLES),
        flight_rms={
            flight: aggregate_rms({variable: found.get(flight, math.nan) for variable, found in by_variable.items()})
            for flight in flights
        },
        relative_nis=float(np.mean([row["value"] for row in nis])) / len(VELOCITY_VARIABLES) if nis else math.nan,
        flights_inside=sum(map(is_inside, nis)),
        flights=len(nis),
    )


def _by_flight(
    places: Sequence[tuple[str, str]], flights: Sequence[str], values: Mapping[tuple[str, str, str], float]
) -> dict[str, float]:
    """Values of the first place that any flight has."""
    for place in places:
        found = {flight: values[flight, *place] for flight in flights if (flight, *place) in values}
        if found:
            return found
    return {}


@dataclass(frozen=True)
class Disagreement:
    """The paper's first set and the decision's set, and how they differ.

    Attributes
    ----------
    any_consistent : whether any set's mean NIS lies inside the paper's bounds on half of the flights at least
    aided, unaided, smoothed, score : by how much the logarithm of an error of the paper's set exceeds that of the
        decision's set; None where no flight tells
    position_white_share : how white the error of GNSS position is; NaN where unknown
    objections : why the decision may not choose the paper's set, in words; empty where it may
    confidence : level of the intervals
    """

    first: PaperView
    chosen: PaperView
    any_consistent: bool
    aided: MeanDifference | None
    unaided: MeanDifference | None
    smoothed: MeanDifference | None
    score: MeanDifference | None
    position_white_share: float
    objections: Sequence[str]
    confidence: float


def _log_ratios(
    one: str, other: str, flights: Sequence[AnalyzedFlight], settings: DecisionSettings
) -> dict[str, MeanDifference | None]:
    """One set against another on the flights that have both: in each kind of prediction, and the score."""
    ratios: dict[str, MeanDifference | None] = dict.fromkeys((*AIMS, "score"))
    both = [evidence for flight in flights if (evidence := flight.evidence) and {one, other} <= set(evidence.sets)]
    if not both:
        return ratios
    # All sets that were scored on these flights, as in the ranking: its intervals come out again.
    common = [name for name in both[0].sets if all(name in flight.row for flight in both)]
    names = list(dict.fromkeys((other, one, *common)))
    ratios["score"] = mean_differences(both, names, settings)[1]
    for aim in AIMS:
        having = [flight for flight in both if flight.aim(aim) is not None]
        if having:
            ratios[aim] = mean_differences(having, names, settings, aim)[1]
    return ratios


def reasons(case: Disagreement) -> list[str]:
    """Why the paper's rule and the decision choose different sets, a sentence each, from the figures of the flights."""
    found = [f"The paper's rule takes “{case.first.name}”, the decision is “{case.chosen.name}”."]
    found += _why_the_paper_prefers(case)
    for ratio, where in (
        (case.aided, "One step ahead, with all sensors in use"),
        (case.unaided, "After seconds without GNSS"),
        (case.smoothed, "Of the velocity, against the smoothed one"),
        (case.score, "All taken together, as the decision weighs them"),
    ):
        if ratio is not None:
            found.append(_prediction(where, ratio, case))
    if case.objections:
        found.append(f"“{case.first.name}” is not eligible: {'; '.join(case.objections)}.")
    elif case.score is not None and not case.score.is_certain:
        found.append(
            "So the flights do not tell the two apart, which the paper's rule, without an interval, cannot see."
        )
    return found


def _why_the_paper_prefers(case: Disagreement) -> list[str]:
    first, chosen = case.first, case.chosen
    if not (math.isfinite(first.aggregate_rms) and math.isfinite(chosen.aggregate_rms)):
        return [f"The innovations of “{chosen.name}” do not cover position and velocity, so the paper cannot rank it."]
    if first.aggregate_rms > chosen.aggregate_rms:
        return [
            f"“{chosen.name}” has the smaller innovations (aggregate RMS {chosen.aggregate_rms:.3g} against "
            f"{first.aggregate_rms:.3g}), but its mean NIS lies inside the paper's χ² bounds on "
            f"{chosen.flights_inside} of {_flights(chosen.flights)} only, that of “{first.name}” on "
            f"{first.flights_inside} of {first.flights}."
        ]
    return [*_smaller_innovations(case), *_consistency(case)]


def _smaller_innovations(case: Disagreement) -> list[str]:
    first, chosen = case.first, case.chosen
    lower = sum(first.flight_rms[name] < chosen.flight_rms[name] for name in first.flight_rms)
    parts = {
        "position and height": (first.position_rms, chosen.position_rms),
        "velocity": (first.velocity_rms, chosen.velocity_rms),
    }
    main, other = sorted(parts, key=lambda name: parts[name][0] ** 2 - parts[name][1] ** 2)
    sentences = [
        f"It has the lower aggregate RMS, {first.aggregate_rms:.3g} against {chosen.aggregate_rms:.3g} "
        f"({_change(first.aggregate_rms, chosen.aggregate_rms)}; lower on {lower} of "
        f"{_flights(len(first.flight_rms))}), mostly by its {main} innovations ({_change(*parts[main])}; {other} "
        f"{_change(*parts[other])})."
    ]
    if main != "velocity" and case.position_white_share < WANDERING:
        sentences.append(
            f"Only {100.0 * case.position_white_share:.0f} % of the GNSS position error is white: a filter that "
            "follows the rest has smaller innovations without knowing its position better."
        )
    return sentences


def _consistency(case: Disagreement) -> list[str]:
    first, chosen = case.first, case.chosen
    if not math.isfinite(first.relative_nis):
        return []
    if not case.any_consistent:
        side = "below" if first.relative_nis < 1.0 else "above"
        return [
            f"The paper's χ² test cannot help: no set passes it (the mean NIS of “{first.name}” is "
            f"{first.relative_nis:.2g} times what it should be, {side} the bounds), so the RMS alone ranks them."
        ]
    if chosen.is_consistent:
        return []
    return [
        f"The mean NIS of “{chosen.name}” lies inside the paper's χ² bounds on {chosen.flights_inside} of "
        f"{_flights(chosen.flights)}, that of “{first.name}” on {first.flights_inside} of {first.flights}; the bounds "
        "take samples as independent, which these are not."
    ]


def _prediction(where: str, ratio: MeanDifference, case: Disagreement) -> str:
    change = 100.0 * math.expm1(ratio.difference)
    span = "how far chance could do that is not known"
    if ratio.lower is not None and ratio.upper is not None:
        low, high = (100.0 * math.expm1(value) for value in (ratio.lower, ratio.upper))
        span = _minus(f"{case.confidence:.0%} interval {low:+.1f} % to {high:+.1f} %")
    size = f"{abs(change):.1f} % {'larger' if change >= 0.0 else 'smaller'}"
    chance = "" if ratio.is_certain or ratio.lower is None else ", which may be chance"
    names = f"the errors of “{case.first.name}” are {size} than those of “{case.chosen.name}”"
    return f"{where}, {names} ({span}){chance}."


def _flights(number: int) -> str:
    return "1 flight" if number == 1 else f"{number} flights"


def _change(value: float, base: float) -> str:
    return _minus(f"{100.0 * (value / base - 1.0):+.1f} %")


def _minus(text: str) -> str:
    return text.replace("-", "−")
